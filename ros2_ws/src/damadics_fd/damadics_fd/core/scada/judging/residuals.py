# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Form the residuals of one sample, less what the models do not know for sure."""

import math

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.judging.cusum import P1, P2, PROCESS, QUICK, R1, R2, T1, TEST_RESIDUAL
from damadics_fd.core.scada.judging.gap import wait_for_the_model
from damadics_fd.core.scada.judging.leverage import lever
from damadics_fd.core.scada.judging.predict import repeated, stands_still
from damadics_fd.core.scada.judging.roughness import follow_roughness
from damadics_fd.core.scada.laws.flow_law import END, flow_doubt, near_end, slope
from damadics_fd.core.scada.laws.stem_law import outside, shrink, stem_doubt, transient_doubt
from damadics_fd.core.scada.state import (
    HISTORY_LENGTH,
    LAW,
    N_TESTS,
    N_WEIGHTS,
    MonitorState,
    Reference,
)

DOUBT = 3.0  # standard deviations of a law that are no evidence
X = 2  # place of the position among the signals
NEAR = 0.01  # of the stroke, still where it was learned
BENT = 0.02  # by which the gain of a stem may be another where it was not learned
STOP = 0.015  # this near to an end of the stroke the stem is at its stop
STOP_DOUBT = 0.05  # of the stroke, at a stop and for a while after it has left
STOP_S = 60.0
# What a quarter of an hour does not show and a day does: how a plant changes over hours.
HOURS_S = 10800.0
STEM_HOURS = 0.0015  # standard deviation, share of stroke, for tests of what lasts some seconds
STEM_LASTING = 0.0005  # and in addition for tests of what lasts for minutes
FLOW_HOURS = 0.05  # share of the flow
FIRST = 0.1  # share of the next two while no test is made: a record may begin elsewhere
STEM_DRIFT_S = 600.0  # so slowly a drift is followed: of the stem
FLOW_DRIFT_S = 1800.0  # of the flow
STEM_DRIFT = 0.02  # of the stroke
FLOW_DRIFT = 0.1  # of log F
STEM_TOLD, FLOW_TOLD = 0.005, 0.05  # drifts that are told
CALM = 0.5  # of a limit of a quick test: nothing speaks of a fault
SEAT = 0.03  # of the stroke, so near to its seat a plug throttles as it likes
LEAST = 0.03  # of the meter's range: it shows no less
AGAIN = 2  # times that the largest flow of all was shown: the end of its range
FOLLOW_S = 600.0  # a process pressure is followed this slowly
FOLLOW_FAR_S = 3600.0  # and this slowly while it is far off
MOVED = 0.03  # a flow that moved by this share explains a pressure


@jit
def hours_unseen(ref: Reference) -> float:
    """Return which part of the slow changes of a plant the record was too short to show, 0..1."""
    value: float = math.sqrt(HOURS_S / (HOURS_S + ref.seconds))
    return value


@jit
def residuals(
    s: MonitorState, ref: Reference, x: float, p1: float, p2: float, t1: float, flow: float
) -> None:
    """Form r1 = X' - model, r2 = (F' - flow law) / sigma and what the inputs show."""
    s.testable[:] = 1
    s.inside = 1 if ref.low[X] - NEAR <= s.xm[0] <= ref.high[X] + NEAR else 0
    entry = s.history[(s.samples - 1) % HISTORY_LENGTH]
    correction = 0.0
    xm = s.xm[0]
    if ref.stem_kind == LAW:
        raw = outside(x - s.drift[0], xm, s.xs, s.xq)
        stick = ref.stem_law.stick
        follow_drift(s, ref, 0, shrink(x - xm, stick), STEM_DRIFT, 2.0 * ref.s1, STEM_DRIFT_S)
        doubt = DOUBT * stem_doubt(ref.stem_law, xm) + DOUBT * STEM_HOURS * hours_unseen(ref)
        doubt += stick + transient_doubt(s.track, ref.stem_law)
        beyond = max(ref.low[X] - xm, xm - ref.high[X], 0.0)
        doubt += (abs(ref.stem_law.gain - 1.0) + BENT) * beyond
        s.lasting = DOUBT * STEM_LASTING * hours_unseen(ref)
        s.away[0] = 0.0
        s.lever[0] = 1.0
    else:
        for i in range(N_WEIGHTS):
            correction += ref.w[i] * s.phi[i]
        raw = x - xm - correction
        doubt = 0.0
        s.away[0] = (xm - ref.x_mean) / ref.x_sd
        s.lever[0] = lever(s.away[0])
    if min(xm, s.cv[0]) < STOP or max(xm, s.cv[0]) > 1.0 - STOP:
        s.t_stop = s.t + STOP_S
    if s.t < s.t_stop:
        doubt += STOP_DOUBT
    s.residual[R1] = shrink(raw, doubt)
    s.residual[R2] = flow_residual(s, ref, x, flow)
    s.testable[R1] = 1 if s.t >= s.t_stem else 0
    wait_for_the_model(s, ref)
    still = stands_still(s, ref)
    if still or (repeated(s) and ref.stem_kind == LAW):
        s.testable[R1] = 0
    if still or (repeated(s) and ref.flow_kind == LAW) or s.t < s.t_flow:
        s.testable[R2] = 0
    s.residual[P1] = s.innovation[0]
    s.residual[P2] = s.innovation[1]
    s.residual[T1] = t1
    s.residual[PROCESS] = process_residual(s, ref, p1, p2, flow)
    entry.correction = correction
    entry.r1 = raw
    entry.r2 = s.residual[R2]
    follow_roughness(s, ref, flow)


@jit
def speaks(s: MonitorState, ref: Reference, residual: int) -> bool:
    """Tell whether a residual speaks of a fault: a quick test begins to, or a slow one does."""
    for i in range(N_TESTS):
        least = CALM if ref.k[i] >= QUICK else 1.0
        if TEST_RESIDUAL[i] == residual and s.ratios[i] > least:
            return True
    return False


@jit
def follow_drift(
    s: MonitorState,
    ref: Reference,
    which: int,
    error: float,
    limit: float,
    step: float,
    memory_s: float,
) -> None:
    """
    Follow what a plant changes over hours, within a limit and while nothing speaks of a fault.

    :param which: 0 the stem, 1 the flow.
    :param error: measured less model, the drift not taken off.
    :param limit: largest drift that is followed; step: largest error that counts.
    :param memory_s: how slowly it is followed, s.
    """
    if s.filled < 1 or speaks(s, ref, R1 if which == 0 else R2):
        return
    dt = s.t - s.history[(s.samples - 1) % HISTORY_LENGTH].t0
    if s.t < s.t_test:
        memory_s *= FIRST
    away = min(max(error - s.drift[which], -step), step)
    moved = s.drift[which] + (1.0 - math.exp(-dt / memory_s)) * away
    s.drift[which] = min(max(moved, -limit), limit)


@jit
def flow_residual(s: MonitorState, ref: Reference, x: float, flow: float) -> float:
    """Return r2 in sigma; 0 and not testable where meter or law say nothing."""
    s.away[1] = 0.0
    s.lever[1] = 1.0
    if ref.flow_kind != LAW:
        if s.masked:
            s.testable[R2] = 0
            return math.nan if math.isnan(s.f) else 0.0
        # what is uncertain by a sigma of where it was learned may be many of a smaller one
        s.away[1] = (s.f - ref.f_mean) / ref.f_sd * max(ref.f_sigma / s.sq, 1.0)
        s.lever[1] = lever(s.away[1])
        return (flow - ref.g0 - ref.g1 * s.f) / s.sq  # NaN where not measured
    law = ref.flow_law
    s.testable[R2] = 0
    if s.masked:
        return math.nan if math.isnan(flow) else 0.0
    hours = FLOW_HOURS * hours_unseen(ref)
    drift = math.exp(s.drift[1])
    doubt = flow_doubt(law, x, s.size)
    drifted = abs(slope(law, x) * s.drift[0])  # of the stem, or of its sensor alone
    band = math.exp(DOUBT * math.sqrt(doubt * doubt + hours * hours) + drifted)
    scale = law.range if law.range > 0.0 else ref.flow_max
    floor = 0.005 * scale
    low = min(s.f, s.f_slow[0]) * drift / band - floor
    high = max(s.f, s.f_slow[0]) * drift * band + floor
    top = law.range
    if s.top_count >= AGAIN and s.top_flow >= END * ref.flow_max:
        top = min(top, s.top_flow) if top > 0.0 else s.top_flow
    near = near_end(top, law.noise)
    ended = top > 0.0 and flow >= near
    sigma = s.sq
    if top > 0.0 and low > near:  # this is all that it can show, with the noise that is left there
        low = near
        sigma = math.hypot(law.noise, top * law.spread)
    if ended or max(x, s.xm[0]) > 1.0 - SEAT:
        low = -math.inf  # the flow may be anything above what is shown
    elif flow < LEAST * scale:
        low = min(low, LEAST * scale)  # and here anything below
        if low < LEAST * scale * 1.5:
            low = -math.inf
    elif s.f > LEAST * scale:
        step = 2.0 * law.spread
        follow_drift(s, ref, 1, math.log(flow / s.f), FLOW_DRIFT, step, FLOW_DRIFT_S)
    value = 0.0
    if flow > high:
        value = flow - high
    elif flow < low:
        value = flow - low
    s.testable[R2] = 1 if value != 0.0 or not ended else 0
    return value / sigma


@jit
def process_residual(s: MonitorState, ref: Reference, p1: float, p2: float, flow: float) -> float:
    """
    Return 1 where a pressure left its level so far and so fast that no load change explains it.

    A load change moves pressures and flow together: more flow takes the inlet pressure down and
    the outlet pressure up. A pressure that moves against the flow, or without it, is not that.
    """
    if not ref.drop > 0.0 or math.isnan(p1) or math.isnan(p2):
        s.testable[PROCESS] = 0
        return math.nan
    if math.isnan(s.level[0]):
        s.level[0] = p1
        s.level[1] = p2
        s.level_flow = flow
    dt = s.t - s.history[(s.samples - 1) % HISTORY_LENGTH].t0
    d1 = p1 - s.level[0]
    d2 = p2 - s.level[1]
    more = 0.0
    if not math.isnan(flow):
        change = (flow - s.level_flow) / max(s.level_flow, 0.02 * ref.flow_max)
        ended = flow >= END * ref.flow_law.range and ref.flow_law.range > 0.0
        more = 1.0 if ended or change > MOVED else -1.0 if change < -MOVED else 0.0
    fell = d1 < -ref.swing[0] and more <= 0.0
    rose = d1 > ref.swing[0] and more >= 0.0
    fell2 = d2 < -ref.swing[1] and more >= 0.0
    rose2 = d2 > ref.swing[1] and more <= 0.0
    far = fell or rose or fell2 or rose2
    before = s.process
    s.process = (1 if fell else 0) + (2 if rose else 0) + (4 if fell2 else 0) + (8 if rose2 else 0)
    # wrong samples of two pressures in a row are not one that stays away
    lasts = far and (before == 0 or (before & s.process) > 0)
    share = 1.0 - math.exp(-dt / (FOLLOW_FAR_S if far else FOLLOW_S))
    s.level[0] += share * d1
    s.level[1] += share * d2
    if not math.isnan(flow):
        if math.isnan(s.level_flow):
            s.level_flow = flow
        s.level_flow += share * (flow - s.level_flow)
    return 1.0 if lasts else 0.0
