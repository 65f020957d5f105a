# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Refuse single wrong samples, as a disturbance of the wiring makes them.

A sample in which a signal has left its place by more than a valve can do is held back: where the
next one has left it that way, too, it is believed; where that one is back, it was wrong. So what
is true is believed a sample later, and what is wrong alone never reaches the filters.
"""

import math

from damadics_fd.core.jit import jit
from damadics_fd.core.quality import Quality
from damadics_fd.core.settings import Settings

# By how much a signal may differ from the last good one, as a share of its range: at once, and per
# second that has passed. A spring that breaks throws the stem; pressures take their time.
X_STEP, PS_STEP, P_STEP = 0.05, 0.02, 0.04
X_RATE, PS_RATE, P_RATE = 20.0, 2.0, 5.0
CONFIRMED = 0.75  # of the way from there, that it may be off where the sample before had it
X1, P1, P2, PS = 1, 2, 3, 6  # places in SIGNALS


@jit
def has_left(value: float, good: float, held: float, limit: float) -> bool:
    """
    Tell whether a signal has left its place, and not where the sample before had it already.

    :param value: the signal; good: of the last good sample.
    :param held: of the sample that is held back; NaN: none is.
    :param limit: by how much it may differ.

    >>> [has_left(0.9, 0.5, held, 0.1) for held in (math.nan, 0.7, 0.1)]
    [True, False, True]
    """
    away = abs(value - good)
    return away > limit and not abs(value - held) < CONFIRMED * away


@jit
def is_spike(
    q: Quality, c: Settings, stamp: int, x1: float, p1: float, p2: float, ps: float
) -> bool:
    """
    Tell whether a sample that is good by itself has to wait for the next one; remember it.

    :param q: quality record, written.
    :param c: settings record.
    :param stamp: of the sample [ns]; the rest are its signals, in Pa or as shares.
    :return: True where it is to be refused.
    """
    which = 0
    if q.started:
        dt = (stamp - q.stamp) * 1e-9
        process = (P_STEP + P_RATE * dt) * c.p_max
        if has_left(x1, q.x1, q.held_x1, X_STEP + X_RATE * dt):
            which = X1
        elif has_left(ps, q.ps, q.held_ps, (PS_STEP + PS_RATE * dt) * c.ps_max):
            which = PS
        elif has_left(p1, q.p1, q.held_p1, process):
            which = P1
        elif has_left(p2, q.p2, q.held_p2, process):
            which = P2
    if which > 0:
        q.spike = which
        q.held_x1, q.held_p1, q.held_p2, q.held_ps = x1, p1, p2, ps
        return True
    q.x1, q.p1, q.p2, q.ps = x1, p1, p2, ps
    q.held_x1 = q.held_p1 = q.held_p2 = q.held_ps = math.nan
    return False
