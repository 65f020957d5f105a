# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Single wrong samples: what one of them brings is taken back when the next has come back."""

import math

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.judging.cusum import R1, TEST_RESIDUAL
from damadics_fd.core.scada.judging.roughness import rougher
from damadics_fd.core.scada.state import N_RESIDUALS, N_TESTS, MonitorState, Reference

JUMP = 6.0  # sigma from one sample to the next that may be a spike
RETURNED = 0.3  # of a jump, by which the value may still be off when it has come back
BACK = 4.0  # sigma within which it has come back
FIRST, ALONE = 1, 2  # a jump that may be a spike; one out of calm, which raises no alarm by itself
CV = 0  # place among the last samples of CV, X, P1, P2, F
CV_SPIKE = 0.02  # of the stroke: smaller ones move the model of the stem by too little


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
def taken_back(s: MonitorState, ref: Reference) -> bool:
    """Tell whether any signal jumped with the sample before and has come back with this one."""
    for i in range(CV + 1, 5):
        if ref.spike[i] > 0.0 and came_back(s, i, ref.spike[i], 1):
            return True
    return cv_came_back(s, ref)


@jit
def reject_spikes(s: MonitorState, ref: Reference) -> None:
    """Take back what a single sample brought that has come back at the next one."""
    back = taken_back(s, ref)
    for r in range(N_RESIDUALS):
        value = s.residual[r]
        jumped = s.jumped[r]
        far = False
        calm = False
        for i in range(N_TESTS):
            if TEST_RESIDUAL[i] != r or not ref.sd[i] > 0.0 or math.isnan(value):
                continue
            z = abs(value - ref.mu[i]) / (ref.sd[i] * rougher(s, ref, r, 1))
            if jumped > 0 and (back or z < BACK):
                for j in range(N_TESTS):
                    if TEST_RESIDUAL[j] == r:
                        s.g[j, 0] = s.saved[j, 0]
                        s.g[j, 1] = s.saved[j, 1]
                if r == R1:
                    s.llr = s.saved_llr
                s.spikes[r] += 1
                jumped = 0
            if jumped == 0 and z > JUMP:
                far = s.g[i, 0] < ref.h[i] and s.g[i, 1] < ref.h[i]
                for j in range(N_TESTS):
                    if TEST_RESIDUAL[j] == r:
                        s.saved[j, 0] = s.g[j, 0]
                        s.saved[j, 1] = s.g[j, 1]
                if r == R1:
                    s.saved_llr = s.llr
            calm = s.far_before[r] < BACK
            s.far_before[r] = z
            break  # the first test of a residual judges the jump
        s.jumped[r] = (ALONE if calm else FIRST) if far else 0
