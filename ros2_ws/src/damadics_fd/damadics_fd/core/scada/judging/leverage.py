# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Say how unsure a line is away from where it was learned.

A line that was fitted to a record is off by an error of its offset and by one of its slope, which
are independent in the middle of the record. A test that sums a residual up takes in the first with
every sample, the second with the distance from the middle: what lies on either side of it cancels.
So a valve that works as it did while learning loses next to nothing, and one that works elsewhere
all that is not known there.
"""

import math

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.state import MonitorState


@jit
def lever(away: float) -> float:
    """
    Return the standard error of a line at a place over that in the middle of what was learned.

    :param away: distance from that middle, in standard deviations of what was learned.
    """
    return math.sqrt(1.0 + away * away)


@jit
def more_unsure(s: MonitorState, i: int, side: int, away: float) -> float:
    """
    Take a sample into the stretch a test sums up; return by how much the sum is less sure for it.

    :param s: record of `MonitorState`.
    :param i: which test; side: 0 up, 1 down.
    :param away: of the sample, see `lever`.
    :return: standard errors of the sum beyond those of samples in the middle; 0 where the stretch
        comes back towards the middle, so that evidence never grows from that.
    """
    n = s.stretch[i, side, 0] + 1.0  # element by element: a view costs more than all the rest
    total = s.stretch[i, side, 1] + away
    cost = s.stretch[i, side, 2]
    more: float = max(math.sqrt(n * n + total * total) - n - cost, 0.0)
    s.stretch[i, side, 0] = n
    s.stretch[i, side, 1] = total
    s.stretch[i, side, 2] = cost + more
    return more
