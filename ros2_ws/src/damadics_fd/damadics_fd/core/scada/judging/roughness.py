# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Follow how rough the residuals are: noise or motion that has grown since learning is no fault.

A residual's change from sample to sample, and from half a minute to the next, shows how much it
moves by itself and hardly ever a fault, which moves the residual once and then stays. Where the
changes have become larger than those of the fault-free record, the sigma of the residual's tests
grows with them, up to a limit.
"""

import math

import numpy as np

from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats
from damadics_fd.core.scada.judging.cusum import R2
from damadics_fd.core.scada.state import (
    HISTORY_LENGTH,
    LAW,
    N_ROUGH,
    MonitorState,
    Reference,
)

BLOCK = 30  # samples whose mean shows what is slow
MEMORY = (120, 20)  # changes of samples, of block means
SETTLED = 4  # a part of the memory that says something
LARGE = 4.0  # multiples of the usual change beyond which one is a step of something
ROOM = (1.05, 1.3)  # by which the roughness may exceed the learned one at no consequence
LARGEST = 4.0  # what has grown by more than this is worth an alarm
USUAL = 0.9  # quantile of the roughness over the record


@jit
def follow_roughness(s: MonitorState, ref: Reference, flow: float) -> None:
    """
    Take what a sample shows of how much each residual moves, unless a fault stands.

    :param s: record of `MonitorState` with the residuals of the sample.
    :param ref: record of `REFERENCE`.
    :param flow: F', scaled.
    """
    entry = s.history[(s.samples - 1) % HISTORY_LENGTH]
    for r in range(N_ROUGH):
        value = s.residual[r]
        if r == 0:
            value = entry.r1
        elif r == R2 and ref.flow_kind == LAW:
            value = math.nan if s.masked else (flow - s.f) / s.sq
        elif r == R2 and s.testable[R2] == 0:
            value = math.nan
        if math.isnan(value):
            s.rough_last[r, 0] = math.nan
            continue
        take_change(s, ref, r, 0, value)
        s.rough_sum[r] += value
        s.rough_size[r] += 1
        if s.rough_size[r] == BLOCK:
            take_change(s, ref, r, 1, s.rough_sum[r] / BLOCK)
            s.rough_sum[r] = 0.0
            s.rough_size[r] = 0


@jit
def break_off(s: MonitorState) -> None:
    """Take no change over a gap: the next sample, the next block do not follow on the last."""
    s.rough_last[:] = math.nan
    s.rough_sum[:] = 0.0
    s.rough_size[:] = 0


@jit
def take_change(s: MonitorState, ref: Reference, r: int, scale: int, value: float) -> None:
    """Take a change of a residual (scale 0) or of its block mean (scale 1)."""
    change = abs(value - s.rough_last[r, scale])
    first = s.rough_count[r, scale] == 0
    s.rough_last[r, scale] = value
    if first:
        s.rough_count[r, scale] = 1
        return
    if math.isnan(change) or s.stood:
        return
    n = s.rough_count[r, scale]
    if n > SETTLED:
        change = min(change, LARGE * max(s.rough[r, scale], ref.rough[r, scale]))
    s.rough[r, scale] += (change - s.rough[r, scale]) / n
    s.rough_count[r, scale] = min(n + 1, MEMORY[scale])


@jit
def rougher(s: MonitorState, ref: Reference, r: int, scales: int) -> float:
    """
    Return by which factor a residual moves more than it was learned to; 1 where it does not.

    :param r: which residual; scales: 1 from sample to sample, 2 also from block to block.
    """
    factor = 1.0
    if r >= N_ROUGH:
        return factor
    for scale in range(scales):
        if ref.rough[r, scale] > 0.0 and s.rough_count[r, scale] >= MEMORY[scale] // SETTLED:
            factor = max(factor, s.rough[r, scale] / (ROOM[scale] * ref.rough[r, scale]))
    return min(factor, LARGEST)


def usual_roughness(values: Floats) -> Floats:
    """
    Return how rough each residual of a fault-free record is.

    :param values: as followed, one row per sample; shape (n, residuals, scales).
    :return: what the record hardly exceeded.
    """
    settled = values[2 * MEMORY[0] :]
    if not len(settled):
        return np.zeros(values.shape[1:])
    usual: Floats = np.quantile(settled, USUAL, axis=0)
    return usual
