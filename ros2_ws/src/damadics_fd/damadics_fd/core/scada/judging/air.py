# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Find how much air the model of the stated actuator has to start with.

In DABLib p V / m_a is no constant: the play takes a little from it with every reversal, a quarter
in a day of the benchmark, and the valve answers slower by as much. A model that begins anew, an
hour or a day after its plant, has to find out; one that was only interrupted goes on with what it
had.
"""

import math

import numpy as np

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.judging.cusum import R1
from damadics_fd.core.scada.judging.residuals import speaks
from damadics_fd.core.scada.model import advance_two, copy_stem
from damadics_fd.core.scada.settings import ScadaConfig
from damadics_fd.core.scada.state import (
    FIRST_TRIAL,
    HISTORY_LENGTH,
    LAW,
    MonitorState,
    Reference,
)

LOOKS = (60, 560, 1440)  # samples of the first look, at least, and of the later, finer ones
ARRIVED = 40  # samples after which a stem that began at rest is where it is sent
EXPLAINED = 1.5  # of the variance that was learned: what is left is no other fault's
# More air of the models that are compared, as a logarithm, by look; 0 is the one that is followed.
OFFSETS = np.array(
    [[-0.06, 0.0, 0.05, 0.1, 0.16, 0.23, 0.31]] + 2 * [[-0.04, 0.0, 0.04] + 4 * [math.nan]]
)
MODELS = (7, 3, 3)  # of them, at most one more than TRIALS
# Standard errors of r1 for air that was found: per its logarithm, and until the last look at it.
OTHER_AIR, UNSETTLED = 10.0, 2.0
# By which air must be likelier than none, by look, when it is first found: nothing has been tested
# yet at the first; what shows late may be a fault that grows. And for what was found to stay, by
# all samples since the start.
NATS, STAYS = (4.0, 6.0, 20.0), (4.0, 4.0, 8.0)
STEPS = 64  # between the least and the most air that are compared
E, EE, NEXT = range(3)  # sums over r1 of a model: itself, its square, times that of the next model


@jit
def seek_air(s: MonitorState, cfg: ScadaConfig, ref: Reference) -> None:
    """
    Before the first test after a start, take the air with which the models follow the stem.

    What was found is looked at again when there are more samples. Copies of the model with other
    air run beside it meanwhile: so many valves that start together have no common moment of much
    work.

    :param s: record of `MonitorState`, after a sample.
    :param cfg: record of `SETTINGS`.
    :param ref: record of `REFERENCE`.
    """
    if ref.stem_kind == LAW:
        return
    if s.filled <= ARRIVED or s.stood:
        begin_trials(s, s.air_looks)
        return
    follow_trials(s, cfg, s.air_looks)
    look, n = s.air_looks, s.air_count
    if look > 0:
        ready = not speaks(s, ref, R1)
    else:
        ready = s.t + 1.5 * max(cfg.period_s, ref.period) >= max(s.t_test, s.t_stem)
    if not ready or n < LOOKS[look]:
        return
    s.air_looks += 1
    learned = ref.s1 * ref.s1
    best = likeliest(s, ref, look)
    if left_with(s, look, best) >= EXPLAINED * learned:
        best = 0.0
    nats = evidence(s, ref, look, best)
    if nats <= (NATS if s.air == 0.0 else STAYS)[look]:
        best, nats = -s.air, 0.0
    s.air += best
    s.air_nats = nats
    for i in range(2):
        s.stem[i].m_a *= math.exp(best)
    s.air_doubt = 0.0
    if s.air != 0.0:
        s.air_doubt = OTHER_AIR * abs(s.air) + (UNSETTLED if s.air_looks < len(LOOKS) else 0.0)
    if s.air_looks < len(LOOKS):
        begin_trials(s, s.air_looks)


@jit
def begin_trials(s: MonitorState, look: int) -> None:
    """Let copies of the model go on from here with other air."""
    trial = FIRST_TRIAL
    for k in range(MODELS[look]):
        if OFFSETS[look, k] != 0.0:
            copy_stem(s.stem[0], s.stem[trial])
            s.stem[trial].m_a *= math.exp(OFFSETS[look, k])
            trial += 1
    s.air_count = 0
    s.air_fit[:] = 0.0


@jit
def follow_trials(s: MonitorState, cfg: ScadaConfig, look: int) -> None:
    """Advance the copies by a sample, and sum up what r1 would be with each."""
    a = s.history[(s.samples - 1) % HISTORY_LENGTH]
    x = s.air_x
    for k in range(0, MODELS[look] - 1, 2):
        x[k], x[k + 1] = advance_two(
            s.stem[FIRST_TRIAL + k],
            s.stem[FIRST_TRIAL + k + 1],
            cfg.act,
            s.fault[0],
            s.fault[0],
            a.t0,
            a.t,
            a.cv0,
            a.cv,
            a.dp0,
            a.dp,
            a.slope0,
            a.slope,
        )
    if math.isnan(a.r1):
        return
    s.air_count += 1
    trial = 0
    before = 0.0
    for k in range(MODELS[look]):
        e = a.r1
        if OFFSETS[look, k] != 0.0:
            e += a.xm - x[trial]
            trial += 1
        s.air_fit[k, E] += e
        s.air_fit[k, EE] += e * e
        if k > 0:
            s.air_fit[k - 1, NEXT] += before * e
        before = e


@jit
def spread_between(s: MonitorState, k: int) -> tuple[float, float, float]:
    """
    Return variances and covariance of r1 of model k and the next one.

    The mean does not count: a stem that is off is no slower for it.
    """
    n = s.air_count
    one, other = s.air_fit[k], s.air_fit[k + 1]
    mean, mean_o = one[E] / n, other[E] / n
    return (
        one[EE] / n - mean * mean,
        other[EE] / n - mean_o * mean_o,
        one[NEXT] / n - mean * mean_o,
    )


@jit
def between(one: float, other: float, both: float, share: float) -> float:
    """
    Return the variance of r1 of a model that is moved by a share of the way to the next one.

    >>> between(4.0, 1.0, 2.0, 0.0), between(4.0, 1.0, 2.0, 1.0), between(4.0, 1.0, -2.0, 0.5)
    (4.0, 1.0, 0.25)
    """
    rest = 1.0 - share
    return max(rest * rest * one + share * share * other + 2.0 * rest * share * both, 0.0)


@jit
def evidence(s: MonitorState, ref: Reference, look: int, more: float) -> float:
    """
    Return by how much more air than now is likelier than none, nats.

    What was found before counts with the samples that told it: a parabola that is 0 at none.
    """
    least = 0.5 * ref.s1 * ref.s1
    none, left = max(left_with(s, look, -s.air), least), max(left_with(s, look, more), least)
    before = s.air_nats * (1.0 - (more / s.air) ** 2) if s.air != 0.0 else 0.0
    return before + 0.5 * s.air_count / ref.kap2 * math.log(none / left)


@jit
def likeliest(s: MonitorState, ref: Reference, look: int) -> float:
    """Return the more air that all samples so far speak for; running takes air: none or more."""
    low, high = OFFSETS[look, 0], OFFSETS[look, MODELS[look] - 1]
    if look == 2 and s.air == 0.0:
        low = 0.0  # what shows late, the other way, is something else
    best, most = 0.0, -math.inf
    for i in range(STEPS + 1):
        more = low + (high - low) * i / STEPS
        if more >= -ref.air - s.air:
            nats = evidence(s, ref, look, more)
            if nats > most:
                best, most = more, nats
    return best


@jit
def left_with(s: MonitorState, look: int, more: float) -> float:
    """
    Return the variance of r1, had the model held more air.

    :param more: logarithm of the share of air; beyond the models the last line goes on.
    """
    k = 0
    while k < MODELS[look] - 2 and more > OFFSETS[look, k + 1]:
        k += 1
    one, other, both = spread_between(s, k)
    share = (more - OFFSETS[look, k]) / (OFFSETS[look, k + 1] - OFFSETS[look, k])
    return between(one, other, both, share)
