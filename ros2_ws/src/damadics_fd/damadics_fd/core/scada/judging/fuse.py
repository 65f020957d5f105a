# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Fuse the pressures with what is predicted of them; know wrong samples from steps."""

import math

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.judging.gap import bridge
from damadics_fd.core.scada.judging.pressure import (
    TAPS,
    fuse_pressure,
    innovation,
    is_far,
    predict_pressure,
    push,
)
from damadics_fd.core.scada.judging.spikes import wary
from damadics_fd.core.scada.state import LAW, MonitorState, Reference

BELIEVED = -1  # a pressure far from its prediction; before that how often it was doubted in a row
MOST_DOUBTS = 3  # samples after which it is believed wherever it is
ALIKE = 0.5  # of a jump, by which the next may differ and speak for the same
FIRST = 2  # place of P1 among the last samples


@jit
def convinces(s: MonitorState, i: int, doubts: int, predicted: float) -> bool:
    """Tell whether a pressure far from its prediction is true, after so many that were doubted."""
    before = s.last[1, FIRST + i]
    same = abs(s.last[0, FIRST + i] - before) < ALIKE * abs(before - predicted)
    enough = doubts > 1 if wary(s) else doubts > 0
    return doubts >= MOST_DOUBTS or (same and enough)


@jit
def filter_pressures(s: MonitorState, ref: Reference, p1: float, p2: float) -> None:
    """
    Fuse each pressure with its prediction; do not believe a single value far from it.

    A second one that is where the first was is believed, in a record that shows wrong samples a
    third; where the next has come back, none of them was true.
    """
    s.innovation[:] = math.nan
    law = ref.stem_kind == LAW
    for i in range(2):
        measured = p1 if i == 0 else p2
        filt = ref.pressure[i]
        kept = measured
        if math.isnan(measured):  # what comes after it is no continuation of what was before
            s.past[i, :] = math.nan
        elif math.isnan(s.past[i, 0]):
            s.past[i, :] = measured
            s.steady = 1
        if math.isnan(measured) or s.filled < TAPS or not filt.sigma > 0.0:
            s.p_hat[i] = measured
            s.doubtful[i] = 0
        else:
            if s.doubtful[i] == BELIEVED and not is_far(filt, s.instead[i], measured):
                s.past[i, :] = s.instead[i]
                if not law:
                    bridge(s, ref, s.t)
            elif s.doubtful[i] == BELIEVED:  # a step: it goes on as before, from where it is now
                s.past[i, :] = s.instead[i] + (s.past[i, 0] - s.instead[i, 0])
            far = is_far(filt, s.past[i], measured)
            doubts = max(s.doubtful[i], 0)
            predicted = predict_pressure(filt, s.past[i])
            if far and s.steady > TAPS and not convinces(s, i, doubts, predicted):
                s.doubtful[i] = doubts + 1
                kept = predicted
                s.p_hat[i] = kept
            else:
                s.doubtful[i] = 0
                if far and doubts > 0:
                    s.doubtful[i] = BELIEVED
                    s.instead[i, :] = s.past[i]
                    push(s.instead[i], predicted)
                s.p_hat[i] = fuse_pressure(filt, s.past[i], measured)
            if s.steady > TAPS:
                s.innovation[i] = innovation(filt, s.past[i], measured)
        if math.isnan(kept):
            continue
        push(s.past[i], kept)
