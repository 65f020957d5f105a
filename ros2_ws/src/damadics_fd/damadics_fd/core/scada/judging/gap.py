# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a gap leaves: the models start again, the alarm goes on, the evidence is forgotten."""

import math

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.judging.cusum import R1
from damadics_fd.core.scada.judging.decide import silence
from damadics_fd.core.scada.judging.pressure import TAPS
from damadics_fd.core.scada.judging.roughness import break_off
from damadics_fd.core.scada.laws.stem_law import doubt, start_track
from damadics_fd.core.scada.model import air_over_rest, copy_stem, start_stem
from damadics_fd.core.scada.settings import ScadaConfig
from damadics_fd.core.scada.state import LAW, MonitorState, Reference

FORGET_S = 300.0
SETTLING_PERIODS = 10.0
MISSED = 1.5  # periods: one sample of CV at least is missing, which a law follows at once
FORGOTTEN, FADING = 4.0, 1.0  # lags
FEW_MISSED = 3.5  # periods: one sample or two are missing
CV, USUAL = 0, 0.4  # of a spike of CV: three standard deviations of its change
MOST_THROWN = 60  # samples that r1 waits for a model that a wrong CV has thrown
ARRIVED = 4.0  # sigma within which it is back
GAP_PERIODS = 5.0  # sample periods without a sample that are no gap yet


@jit
def settling(cfg: ScadaConfig, ref: Reference) -> float:
    """Return how long the models take from a start at the measured position, s."""
    if ref.stem_kind != LAW:
        value: float = cfg.settle_s
        return value
    law = ref.stem_law
    return min(cfg.settle_s, law.dead_s + 5.0 * law.lag_s + SETTLING_PERIODS * ref.period)


@jit
def begin_again(s: MonitorState, cfg: ScadaConfig, ref: Reference, t: float) -> None:
    """
    Keep what is worth anything after a gap that ends at t: the alarm, not the evidence.

    What stood is taken to stand until it can be told; after a long gap new evidence decides.
    """
    silence(s)
    break_off(s)
    if ref.stem_kind == LAW:  # it starts at the measured position: only r1 has to wait
        s.t_stem = max(s.t_stem, t + settling(cfg, ref))
    else:
        s.t_test = max(s.t_test, t + settling(cfg, ref))
    if t - s.t > FORGET_S:
        s.stands[:] = 0
        s.stood = False
        s.t_gone = t
        s.level[:] = math.nan
        s.air_looks = 0
        s.air_nats = 0.0


@jit
def missing(ref: Reference, periods: float) -> bool:
    """Tell whether so much is missing before a sample that the stem's model may be off."""
    enough = MISSED if ref.stem_kind == LAW else GAP_PERIODS
    return periods > enough


@jit
def bridge(s: MonitorState, ref: Reference, t: float, lags: float = FORGOTTEN) -> None:
    """
    Make no test of r1 for a while after t: which way CV went since the last sample is open.

    :param lags: of an identified stem, until what it did is forgotten.
    """
    wait = SETTLING_PERIODS * ref.period
    if ref.stem_kind == LAW:
        wait = ref.period + ref.stem_law.dead_s + lags * ref.stem_law.lag_s
    s.t_stem = max(s.t_stem, t + wait)
    break_off(s)


@jit
def miss(s: MonitorState, ref: Reference, cv: float, dt: float) -> None:
    """
    Allow for what CV may have been while samples are missing before this one.

    Where one or two are missing and it answers at once, the law is doubted by what CV usually
    does meanwhile, and r1 waits for what it may have done once; else r1 waits for all to fade.

    :param cv: of this sample, to which the law has been brought.
    :param dt: s since the sample before.
    """
    law = ref.stem_law
    at_once = law.dead_s < ref.period and law.stick == 0.0
    if ref.stem_kind == LAW and at_once and dt < FEW_MISSED * ref.period:
        doubt(s.track, law, USUAL * ref.spike[CV] + abs(cv - s.cv[0]), dt)
        bridge(s, ref, s.t, FADING)
    else:
        bridge(s, ref, s.t)


@jit
def wait_for_the_model(s: MonitorState, ref: Reference) -> None:
    """Make no test of r1 until a model that a wrong CV has thrown is back at the stem."""
    if s.thrown == 0:
        return
    s.thrown -= 1
    if s.testable[R1] > 0 and abs(s.residual[R1]) < ARRIVED * ref.s1:
        s.thrown = 0
    elif s.thrown > 0:
        s.testable[R1] = 0


@jit
def restart(
    s: MonitorState,
    cfg: ScadaConfig,
    ref: Reference,
    t: float,
    cv: float,
    x: float,
    p1: float,
    p2: float,
) -> None:
    """Start the models and the pressure filter at this sample."""
    start_track(s.track, t, cv)
    if ref.stem_kind == LAW:
        s.track.lagged[:] = (x - ref.stem_law.offset) / ref.stem_law.gain
        s.track.held[:] = s.track.lagged[0]
    s.f_lagged[:] = math.nan
    s.f_slow[:] = math.nan
    s.last[:] = math.nan
    more = air_over_rest(s.stem[0], cfg.act) if s.filled > 0 else math.exp(ref.air)
    start_stem(s.stem[0], cfg.act, t)
    s.stem[0].m_a *= more
    copy_stem(s.stem[0], s.stem[1])
    s.fault[1].f4 = cfg.wide_play - cfg.act.stem_play
    s.filled = 0
    s.steady = 0
    for i in range(4):
        s.cv[i] = cv
    s.dp[:] = p1 - p2 if math.isfinite(p1 - p2) else ref.dp_mean
    s.blind = 0
    s.xm[:] = 0.0
    s.xd = 0.0
    for i in range(TAPS):
        s.past[0, i] = p1
        s.past[1, i] = p2
    s.p_hat[0] = p1
    s.p_hat[1] = p2
