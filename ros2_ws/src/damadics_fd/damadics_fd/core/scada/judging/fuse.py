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
from damadics_fd.core.scada.state import LAW, MonitorState, Reference

DOUBTED, BELIEVED = 1, 2  # a pressure far from its prediction: the first, a second in a row


@jit
def filter_pressures(s: MonitorState, ref: Reference, p1: float, p2: float) -> None:
    """
    Fuse each pressure with its prediction; do not believe a single value far from it.

    A second one is believed; where the third has come back, neither was true.
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
            if far and s.doubtful[i] != DOUBTED and s.steady > TAPS:
                s.doubtful[i] = DOUBTED
                kept = predict_pressure(filt, s.past[i])
                s.p_hat[i] = kept
            else:
                second = far and s.doubtful[i] == DOUBTED
                s.doubtful[i] = 0
                if second:
                    s.doubtful[i] = BELIEVED
                    s.instead[i, :] = s.past[i]
                    push(s.instead[i], predict_pressure(filt, s.past[i]))
                s.p_hat[i] = fuse_pressure(filt, s.past[i], measured)
            if s.steady > TAPS:
                s.innovation[i] = innovation(filt, s.past[i], measured)
        if math.isnan(kept):
            continue
        push(s.past[i], kept)
