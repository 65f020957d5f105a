# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Wrong samples: what one of them brings is taken back when the next has come back.

Of X, P1 and P2 two in a row are waited for as well, while the flow tells that nothing has moved,
and of any signal in a record that has shown several wrong samples lately. An X that the flow
confirms is not wrong at all.
"""

import math

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.judging.cusum import PROCESS, R1, R2, TEST_RESIDUAL
from damadics_fd.core.scada.judging.roughness import rougher
from damadics_fd.core.scada.laws.clean import CV_SPIKE
from damadics_fd.core.scada.state import LAW, N_RESIDUALS, N_TESTS, MonitorState, Reference

JUMP = 6.0  # sigma from one sample to the next that may be a spike
RETURNED = 0.3  # of a jump, by which the value may still be off when it has come back
BACK = 4.0  # sigma within which it has come back
ANSWER = 0.15  # of what the flow should be off by, that shows that something moved it
FAR_PROCESS = 0.5  # its residual is 0 or 1
# A jump that may be a spike; one out of calm, which raises no alarm by itself; one that the next
# sample has not taken back, but the flow does not know of.
FIRST, ALONE, UNANSWERED = 1, 2, 3
CONFIRMED = -1  # a jump of X that the flow shows, too
CV, X, P2, F = 0, 1, 3, 4  # places among the last samples of CV, X, P1, P2, F
MOST_AWAY = 2  # samples in a row that are taken back
SEVERAL = 2.0  # wrong samples lately, beyond which two in a row are to be expected
LATELY = 3600.0  # samples
AGREES = 3.0  # sigma within which the flow is where X says


@jit
def came_back(s: MonitorState, i: int, least: float, length: int) -> bool:
    """Tell whether a signal was another for so many samples and has come back with this one."""
    before = s.last[length + 1, i]
    there = math.inf
    for k in range(1, length + 1):
        there = min(there, abs(s.last[k, i] - before))
    back: bool = there > least and abs(s.last[0, i] - before) < RETURNED * there
    return back


@jit
def cv_came_back(s: MonitorState, ref: Reference) -> bool:
    """
    Tell whether CV was another for a sample, or two.

    The stem of a true one has answered, that of a wrong one has not: the models cannot know.
    """
    least = max(ref.spike[CV], CV_SPIKE)
    return came_back(s, CV, least, 1) or came_back(s, CV, least, 2)


@jit
def cv_jumped(s: MonitorState, ref: Reference) -> bool:
    """Tell whether CV goes on otherwise than before, and so may come back."""
    turn = s.last[0, CV] - 2.0 * s.last[1, CV] + s.last[2, CV]
    jumped: bool = abs(turn) > 2.0 * max(ref.spike[CV], CV_SPIKE)
    return jumped


@jit
def away(s: MonitorState, ref: Reference, i: int) -> int:
    """Return for how many samples, two at most, a signal was another before it came back."""
    for length in range(1, MOST_AWAY + 1):
        if ref.spike[i] > 0.0 and came_back(s, i, ref.spike[i], length):
            return length
    return 0


@jit
def wrong_before(s: MonitorState, ref: Reference) -> int:
    """Return for how many samples, two at most, X, P1 or P2 was another before it came back."""
    longest = 0
    for i in range(X, P2 + 1):
        longest = max(longest, away(s, ref, i))
    return longest


@jit
def taken_back(s: MonitorState, ref: Reference) -> bool:
    """Tell whether any signal jumped one sample ago, or two, and has come back with this one."""
    if wrong_before(s, ref) > 0 or away(s, ref, F) > 0:
        return True
    return cv_came_back(s, ref)


@jit
def wary(s: MonitorState) -> bool:
    """Tell whether the record has shown so many wrong samples that two in a row may be wrong."""
    many: bool = s.wrong > SEVERAL
    return many


@jit
def count_wrong(s: MonitorState, ref: Reference) -> None:
    """Count the wrong samples that the record has shown lately."""
    s.wrong *= 1.0 - 1.0 / LATELY
    for i in range(F + 1):
        if ref.spike[i] > 0.0 and came_back(s, i, max(ref.spike[i], CV_SPIKE), 1):
            s.wrong += 1.0


@jit
def confirmed(s: MonitorState, ref: Reference) -> bool:
    """
    Tell whether the flow is where X says, and far from where the model of the stem says.

    X is not wrong then, nor the flow: the stem is elsewhere. A wrong CV, which moves the model
    alone, would look like it.
    """
    if ref.stem_kind == LAW or ref.flow_kind == LAW or s.testable[R2] == 0:
        return False
    turn = abs(s.last[0, CV] - 2.0 * s.last[1, CV] + s.last[2, CV])
    if wary(s) or turn > ref.spike[CV]:
        return False
    there: bool = abs(s.residual[R2]) < AGREES and abs(s.f - s.f_model) > JUMP * s.sq
    return there


@jit
def left_the_flow(s: MonitorState, ref: Reference) -> bool:
    """
    Tell whether X was another for one sample, with which the flow could not agree.

    If it does not agree with the next either, a positioner has followed its own transmitter.
    """
    if ref.flow_kind == LAW or wary(s) or not ref.spike[X] > 0.0:
        return False
    return came_back(s, X, ref.spike[X], 1)


@jit
def off(s: MonitorState, i: int, ago: int) -> float:
    """Return how far from its place two samples ago, and from the way it went, a signal was."""
    place = s.last[2, i]
    further = (2 - ago) * (place - s.last[3, i])
    away: float = min(abs(s.last[ago, i] - place), abs(s.last[ago, i] - place - further))
    return away


@jit
def unanswered(s: MonitorState, ref: Reference) -> bool:
    """
    Tell whether X, P1 or P2 has been away for two samples and the flow has not.

    A stem or a pressure that moved would have moved the flow, as r2 says, and so would a
    positioner that was deceived by its own transmitter.
    """
    if s.testable[R2] == 0 or math.isnan(s.residual[R2]) or abs(s.residual[R2]) < JUMP:
        return False
    answer = max(off(s, F, 0), off(s, F, 1))
    if answer > max(ANSWER * abs(s.residual[R2]) * s.sq, ref.spike[F]):
        return False
    for i in range(X, P2 + 1):
        if ref.spike[i] > 0.0 and min(off(s, i, 0), off(s, i, 1)) > ref.spike[i]:
            return True
    return False


@jit
def reject_spikes(s: MonitorState, ref: Reference) -> None:
    """Take back what a wrong sample brought, or two, when the signal has come back."""
    back = taken_back(s, ref)
    waits = wary(s) or unanswered(s, ref)
    jump = BACK if wary(s) else JUMP
    for r in range(N_RESIDUALS):
        value = s.residual[r]
        jumped = s.jumped[r]
        far = False
        calm = False
        returned = FAR_PROCESS if r == PROCESS else BACK
        for i in range(N_TESTS):
            if TEST_RESIDUAL[i] != r or not ref.sd[i] > 0.0 or math.isnan(value):
                continue
            z = abs(value - ref.mu[i]) / (ref.sd[i] * rougher(s, ref, r, 1))
            if jumped > 0 and z > JUMP and r == R2 and left_the_flow(s, ref):
                jumped = 0
            if jumped > 0 and (back or z < returned):
                for j in range(N_TESTS):
                    if TEST_RESIDUAL[j] == r:
                        s.g[j, 0] = s.saved[j, 0]
                        s.g[j, 1] = s.saved[j, 1]
                if r == R1:
                    s.llr = s.saved_llr
                s.spikes[r] += 1
                jumped = 0
            if jumped <= 0 and z > (FAR_PROCESS if r == PROCESS else jump):
                far = s.g[i, 0] < ref.h[i] and s.g[i, 1] < ref.h[i]
                for j in range(N_TESTS):
                    if TEST_RESIDUAL[j] == r:
                        s.saved[j, 0] = s.g[j, 0]
                        s.saved[j, 1] = s.g[j, 1]
                if r == R1:
                    s.saved_llr = s.llr
            calm = s.far_before[r] < returned
            s.far_before[r] = z
            break  # the first test of a residual judges the jump
        if jumped == ALONE and waits:
            s.jumped[r] = UNANSWERED
        elif far and r == R1 and confirmed(s, ref):
            s.jumped[r] = CONFIRMED
        else:
            s.jumped[r] = (ALONE if calm else FIRST) if far else 0
