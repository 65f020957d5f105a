# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Feed the tests and keep what stands: one occurrence for as long as a fault is there."""

import math

import numpy as np

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.judging.cusum import FRICTION_TEST, QUICK, R1, R2, TEST_RESIDUAL, TESTS
from damadics_fd.core.scada.judging.leverage import more_unsure
from damadics_fd.core.scada.judging.roughness import rougher
from damadics_fd.core.scada.judging.spikes import ALONE, CONFIRMED, count_wrong, reject_spikes
from damadics_fd.core.scada.laws.stem_law import shrink
from damadics_fd.core.scada.state import LAW, N_RESIDUALS, N_TESTS, MonitorState, Reference

LLR_CLIP = 8.0  # nats that one sample brings at most, and one slip
AGREED = 1.0  # sigma within which the models with and without friction are at one place
MOTION = 0.003  # of the stroke: the stem has moved
HELD = 10  # samples at rest after which its play may hold a stem beside its law
SHOWN = 60  # samples after a motion that show its friction
FIRST_OF_R1 = [test.residual for test in TESTS].index(R1)
SCALES = np.array([2 if test.block >= 30 else 1 for test in TESTS])  # of the roughness
# Multiples of its limit beyond which a statistic does not grow, so that it comes back in time
# after the fault: by how quick the test is.
CAPS = (3.0, 1.2, 1.05)
ONE_SAMPLE = 0.8  # of a limit, the most that a single sample brings
ALMOST = 0.99  # of a limit, the most that one brings it to that may be a spike
# How long a residual must be testable in a row, without evidence, until its fault has gone.
RECOVERY_S, FEWEST_GOOD = 60.0, 30  # s, samples
# A fault that shows now and then, as when the stem turns, must stay away longer every time.
AGAIN_S = 600.0
LONGEST_RECOVERY = 3600
RECOVERY_TRAVEL = 0.05  # of the stroke, that the stem moves meanwhile where r1 showed the fault


@jit
def silence(s: MonitorState) -> None:
    """Forget the evidence so far: no test yet."""
    s.g[:] = 0.0
    s.saved[:] = 0.0
    s.zero[:] = s.t
    s.stretch[:] = 0.0
    s.llr = 0.0
    s.llr_before = 0.0
    s.llr_zero = s.t
    s.ratios[:] = 0.0
    s.good[:] = 0
    s.jumped[:] = 0


@jit
def decide(s: MonitorState, ref: Reference) -> None:
    """Feed every test; the first statistic to reach its limit raises the alarm."""
    s.ratio = 0.0
    count_wrong(s, ref)
    if s.t < s.t_test:
        silence(s)
        s.ratio = 1.0 if s.stood else 0.0
        return
    reject_spikes(s, ref)
    if ref.stem_kind == LAW:
        allow_for_play(s, ref)
    onset = s.t
    top = 0.0
    for i in range(N_TESTS):
        r = TEST_RESIDUAL[i]
        value = s.residual[r]
        if math.isnan(value):
            s.testable[r] = 0
        if math.isnan(value) or not ref.sd[i] > 0.0:
            continue
        s.beyond[i] = 0
        law = ref.stem_kind == LAW if r == R1 else r == R2 and ref.flow_kind == LAW
        if s.testable[r] > 0:
            if law and s.inside == 0 and ref.k[i] < QUICK:
                value = ref.mu[i]  # slow tests of a law believe it only where it was learned
            if law and r == R1 and ref.k[i] <= QUICK:
                value = shrink(value, s.lasting)
            z = (value - ref.mu[i]) / (ref.sd[i] * rougher(s, ref, r, SCALES[i]))
            z = min(max(z, -ref.clip[i]), ref.clip[i])
            k = ref.k[i]
            unsure = 0.0
            if r <= R2:
                k += ref.se[i] * s.air_doubt if r == R1 else 0.0
                unsure = ref.se[i] * (s.lever[r] - 1.0)
            s.beyond[i] = 1 if abs(z) > k + unsure else 0
            brings = CAPS[0] if s.jumped[r] == CONFIRMED else ONE_SAMPLE
            most = k + unsure + brings * ref.h[i]
            z = min(max(z, -most), most)
            for side in range(2):
                g = s.g[i, side] + (z if side == 0 else -z) - k
                if r <= R2 and ref.se[i] > 0.0:
                    g -= ref.se[i] * more_unsure(s, i, side, s.away[r])
                if g <= 0.0:
                    g = 0.0
                    s.zero[i, side] = s.t
                    s.stretch[i, side, 0] = 0.0
                    s.stretch[i, side, 1] = 0.0
                    s.stretch[i, side, 2] = 0.0
                g = min(g, s.g[i, side] + brings * ref.h[i])
                cap = CAPS[0 if ref.k[i] > 1.0 else 1 if ref.k[i] >= QUICK else 2]
                if s.jumped[r] >= ALONE and s.g[i, side] < ref.h[i]:
                    cap = ALMOST
                s.g[i, side] = min(g, cap * ref.h[i])
        side = 0 if s.g[i, 0] >= s.g[i, 1] else 1
        s.ratios[i] = s.g[i, side] / ref.h[i]
        if s.ratios[i] > top:
            top = s.ratios[i]
            s.worst = i
            onset = s.zero[i, side]
    if ref.stem_kind != LAW:
        test_friction(s, ref)
        if s.ratios[FRICTION_TEST] > top:
            top = s.ratios[FRICTION_TEST]
            s.worst = FRICTION_TEST
            onset = s.llr_zero
    for i in range(N_TESTS + 1):
        s.peaks[i] = max(s.peaks[i], s.ratios[i])
    s.ratio = top
    stands = keep_standing(s, ref)
    if not stands:
        return
    if s.ratio < 1.0:
        s.ratio = 1.0
    if not s.stood:
        s.occurrence += 1
        again = s.occurrence > 1 and s.t - s.t_gone < AGAIN_S
        s.recovery = min(2 * s.recovery, LONGEST_RECOVERY) if again else needed_good(ref)
        s.t_raised = s.t
        s.t_onset = onset
        s.t_shown[:] = math.nan
        s.sign[:] = 0.0
        s.test = s.worst
    s.stood = True
    note_evidence(s)
    if not s.alarm:
        s.alarm = True
        s.t_alarm = s.t


@jit
def note_evidence(s: MonitorState) -> None:
    """Note which residuals show the present fault, since when and which way."""
    for i in range(N_TESTS):
        r = TEST_RESIDUAL[i]
        if s.ratios[i] >= 1.0 and math.isnan(s.t_shown[r]):
            s.t_shown[r] = s.t
            s.sign[r] = 1.0 if s.g[i, 0] >= s.g[i, 1] else -1.0


@jit
def rests(x: float, anchor: float, rest: int) -> int:
    """
    Return the samples since the stem has moved.

    A stem at rest shows the same distance between the two models again and again: an hour of it
    tells as little of the play as a minute.

    >>> rests(0.51, 0.5, 7), rests(0.501, 0.5, 7)
    (0, 8)
    """
    return 0 if abs(x - anchor) > MOTION else rest + 1


@jit
def allow_for_play(s: MonitorState, ref: Reference) -> None:
    """Let a stem stand beside a law that rests by as much as it did in the record."""
    s.rest = rests(s.xm[0], s.anchor, s.rest)
    if s.rest == 0:
        s.anchor = s.xm[0]
    if s.rest >= HELD:
        s.lasting = max(s.lasting, ref.wander)


@jit
def weigh(llr: float, before: float, gain: float, wider: float) -> tuple[float, float]:
    """
    Add the evidence of a sample to a likelihood ratio for friction.

    While the two models are apart, one and the same slip that came early or late shows sample for
    sample: it counts as one, however long it lasts.

    :param before: of the likelihood ratio, when the models agreed last.
    :param gain: of this sample, nats.
    :param wider: distance between the models, sigma.
    :return: likelihood ratio with it; and before this slip.
    """
    if abs(wider) < AGREED:
        before = llr
    return min(llr + min(max(gain, -LLR_CLIP), LLR_CLIP), before + LLR_CLIP), before


@jit
def test_friction(s: MonitorState, ref: Reference) -> None:
    """Compare the model with a copy of three times the play by their likelihoods."""
    s.rest = rests(s.xm[0], s.anchor, s.rest)
    if s.rest == 0:
        s.anchor = s.xm[0]
    if s.testable[R1] > 0 and s.rest < SHOWN:
        s1 = ref.s1 * rougher(s, ref, R1, 1)
        z1 = s.residual[R1] / s1
        wider = (s.xm[0] - s.xd) / s1
        z1d = z1 + wider
        # away from where it was learned the bias of the model may favour the wider play
        unsure = ref.se[FIRST_OF_R1] * (s.lever[R1] - 1.0 + s.air_doubt)
        gain = (0.5 * (z1 * z1 - z1d * z1d) - abs(wider) * unsure) / ref.kap2
        cap = ALMOST if s.jumped[R1] >= ALONE and s.llr < ref.llr_limit else CAPS[0]
        s.llr, s.llr_before = weigh(s.llr, s.llr_before, gain, wider)
        s.llr = min(s.llr, cap * ref.llr_limit)
        if s.llr <= 0.0:
            s.llr = 0.0
            s.llr_zero = s.t
    s.ratios[FRICTION_TEST] = s.llr / ref.llr_limit


@jit
def needed_good(ref: Reference) -> int:
    """Return the testable samples in a row without evidence after which a fault has gone."""
    return max(FEWEST_GOOD, int(RECOVERY_S / max(ref.period, 1.0)))


@jit
def keep_standing(s: MonitorState, ref: Reference) -> bool:
    """
    Tell whether a fault stands; what cannot be tested now is not good.

    A residual that showed a fault must be testable, without evidence, for as long as
    `needed_good` says, and a stem must have moved meanwhile.
    """
    s.travel += abs(s.xm[0] - s.xm[1])
    any_stands = False
    if not s.stood and s.ratio < 0.2:
        s.level_before[0] = s.level[0]
        s.level_before[1] = s.level[1]
    for r in range(N_RESIDUALS):
        bad = False
        for i in range(N_TESTS + 1):
            of = R1 if i == FRICTION_TEST else TEST_RESIDUAL[i]
            if of == r and s.ratios[i] >= 1.0:
                bad = True
                if i == FRICTION_TEST or s.beyond[i] > 0:
                    s.t_evidence = s.t
        if bad:
            s.stands[r] = 1
            s.good[r] = 0
            if r == R1:
                s.travel = 0.0
        elif s.testable[r] > 0:
            s.good[r] += 1
        if (
            s.stands[r] > 0
            and s.good[r] >= max(s.recovery, needed_good(ref))
            and (r != R1 or s.travel >= RECOVERY_TRAVEL)
        ):
            s.stands[r] = 0
        any_stands = any_stands or s.stands[r] > 0
    if s.stood and not any_stands:
        s.stood = False
        s.t_gone = s.t
    return any_stands
