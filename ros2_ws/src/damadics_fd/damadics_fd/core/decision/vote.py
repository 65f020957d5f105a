# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""From residual and threshold to a decision: end-stop gates and M of N samples at three levels."""

from typing import Annotated

from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.jit import jit
from damadics_fd.core.modes import PHASE_MONITOR, PHASE_PAPER
from damadics_fd.core.record import Ints, Record
from damadics_fd.core.settings import Settings

LEVELS = 3


class Votes(Record):
    """Say which of the last samples exceeded, at each level."""

    history: Annotated[Ints, LEVELS]
    count: Annotated[Ints, LEVELS]


@jit
def armed(phase: int) -> bool:
    """
    Tell whether decisions count in a phase.

    :param phase: phase of the estimator.
    :return: True in MONITOR and PAPER.
    """
    return phase in (PHASE_MONITOR, PHASE_PAPER)


@jit
def gated(c: Settings, e: Estimate) -> bool:
    """
    Tell whether an end stop may be what pushes the residual.

    At the open stop only a residual that points away from the stop is its reaction. Near the
    closed stop the plug force is too steep in the position to be trusted in either direction.

    :param c: settings record.
    :param e: estimate record.
    :return: True where the residual must not count.
    """
    if e.phase != PHASE_MONITOR:
        return False
    x = e.x1_hat + e.xi1 - c.spring_origin  # the filtered position
    return x > 1.0 - c.gate_high or (x < c.gate_low and e.xi2 > 0.0)


@jit
def clear(s: Votes) -> None:
    """
    Forget the samples seen.

    :param s: state record.
    """
    for i in range(LEVELS):
        s.history[i] = 0
        s.count[i] = 0


@jit
def vote(s: Votes, c: Settings, exceed: bool, ratio: float) -> int:
    """
    Count the sample in and return the level that M of the last N samples have reached.

    :param s: state record.
    :param c: settings record.
    :param exceed: the residual counts and is not below the threshold.
    :param ratio: residual / threshold.
    :return: 0 for no decision, 1 maintenance, 2 out of specification, 3 failure.
    """
    if not exceed and s.count[0] == 0:
        return 0  # nothing to count, nothing to forget: the other levels have seen less
    level = 0
    newest = 1 << (c.decide_n - 1)
    limit = c.level_maintenance
    for i in range(LEVELS):
        if i == 1:
            limit = c.level_specification
        elif i == 2:
            limit = c.level_failure
        history = s.history[i]
        s.count[i] -= history & 1  # the bit that leaves the window
        history >>= 1
        if exceed and ratio >= limit:
            history |= newest
            s.count[i] += 1
        s.history[i] = history
        if s.count[i] >= c.decide_m:
            level = i + 1
    return level
