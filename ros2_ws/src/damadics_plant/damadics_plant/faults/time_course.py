# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The time course of a fault."""

from damadics_fd.core.jit import jit


@jit
def strength_at(strength: float, start: float, end: float, development: float, t: float) -> float:
    """
    Evaluate the time course of a fault: a ramp to full strength, then constant.

    :param strength: full strength, signed.
    :param start: when it begins [s].
    :param end: when it ends [s].
    :param development: from no fault to full strength [s].
    :param t: time [s].
    :return: signed strength, 0 outside [start, end).
    """
    if t < start or t >= end:
        return 0.0
    if t - start >= development:
        return strength
    return strength * (t - start) / development
