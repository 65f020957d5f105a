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

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.judging.cusum import R1
from damadics_fd.core.scada.judging.residuals import speaks
from damadics_fd.core.scada.model import advance_stem, copy_stem
from damadics_fd.core.scada.settings import ScadaConfig
from damadics_fd.core.scada.state import HISTORY_LENGTH, LAW, MonitorState, Reference

LOOKS = (240, 560, 1440)  # samples of the first look and of the later, finer ones
SHORTEST = 60
ARRIVED = 40  # samples after which a stem that began at rest is where it is sent
EXPLAINED = 1.3  # of the variance that was learned: what is left is no other fault's
STEP = 0.02  # of the logarithm of the air
LEAST, MOST = -0.3, 0.3  # what a day of much motion makes of it
# Standard errors of r1 for air that was found: per its logarithm, and until the last look at it.
OTHER_AIR, UNSETTLED = 10.0, 2.0
# By which air that is found must be likelier than none: at first it is on trial, and nothing has
# been tested yet; what shows late may be a fault that grows.
NATS = (4.0, 6.0, 20.0)


@jit
def seek_air(s: MonitorState, cfg: ScadaConfig, ref: Reference) -> None:
    """
    Before the first test after a start, take the air with which the models follow the stem.

    What was found is looked at again when there are more samples.

    :param s: record of `MonitorState`, after a sample.
    :param cfg: record of `SETTINGS`.
    :param ref: record of `REFERENCE`.
    """
    look = s.air_looks
    n = min(s.filled - s.air_since, LOOKS[look])
    if look > 0:
        ready = n == LOOKS[look] and not speaks(s, ref, R1)
    else:
        n = min(s.filled - ARRIVED, LOOKS[0])
        first_test = max(s.t_test, s.t_stem)
        ready = n >= SHORTEST and s.t + 1.5 * max(cfg.period_s, ref.period) >= first_test
    if ref.stem_kind == LAW or s.stood or not ready:
        return
    s.air_looks += 1
    s.air_since = s.filled  # the next look is at samples of the model as it is from now on
    learned = ref.s1 * ref.s1
    without = left_with(s, cfg, n, 0.0)
    step = STEP
    before = left_with(s, cfg, n, -step)
    least = without
    after = left_with(s, cfg, n, step)
    best = 0.0
    if before < after:
        step = -step
        before, after = after, before
    while after < least and LEAST <= best + step <= MOST:
        best += step
        before, least = least, after
        after = left_with(s, cfg, n, best + step)
    best += vertex(before, least, after, step)
    best = max(best, -ref.air - s.air)  # running takes air: never less than none
    found = left_with(s, cfg, n, best)
    none = without if s.air == 0.0 else left_with(s, cfg, n, -s.air)
    gain = 0.5 * n / ref.kap2 * math.log(none / max(found, 0.5 * learned))
    likely = found < EXPLAINED * learned and gain > NATS[look]
    if not likely or (look == 2 and s.air == 0.0 and best < 0.0):
        best = -s.air  # what shows late, the other way, is something else
    s.air += best
    for i in range(2):
        s.stem[i].m_a *= math.exp(best)
    s.air_doubt = 0.0
    if s.air != 0.0:
        s.air_doubt = OTHER_AIR * abs(s.air) + (UNSETTLED if s.air_looks < len(LOOKS) else 0.0)


@jit
def vertex(before: float, least: float, after: float, step: float) -> float:
    """
    Return how far from the middle one of three values their parabola is least, a step at most.

    :param step: between two of them.

    >>> round(vertex(1.5**2, 0.5**2, 0.5**2, 1.0), 6)
    0.5
    """
    bend = before + after - 2.0 * least
    if not bend > 0.0:
        return math.copysign(step, before - after)
    value: float = 0.5 * step * min(max((before - after) / bend, -2.0), 2.0)
    return value


@jit
def left_with(s: MonitorState, cfg: ScadaConfig, n: int, more: float) -> float:
    """
    Return the variance of r1 over the last n samples, had the model held more air.

    The mean does not count: a stem that is off is no slower for it.

    :param more: logarithm of the share of air.
    """
    first = s.samples - n
    trial = s.stem[2]
    copy_stem(s.history[first % HISTORY_LENGTH].stem, trial)
    trial.m_a *= math.exp(more)
    total = 0.0
    squares = 0.0
    counted = 0
    for i in range(first, s.samples):
        e = s.history[i % HISTORY_LENGTH]
        x = advance_stem(
            trial, cfg.act, s.fault[0], e.t0, e.t, e.cv0, e.cv, e.dp0, e.dp, e.slope0, e.slope
        )
        error = e.x - x - e.correction
        if math.isnan(error):
            continue
        counted += 1
        total += error
        squares += error * error
    if counted < n // 2:
        return math.nan
    mean = total / counted
    value: float = squares / counted - mean * mean
    return value
