# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the signature is doing, since when, and how much motion it has judged since."""

from damadics_fd.core.jit import jit
from damadics_fd.core.signature.state import Phase


@jit
def enter(s: Phase, state: int, t: int) -> None:
    """
    Begin a phase.

    :param s: state record.
    :param state: a STATE constant.
    :param t: [ns] now.
    """
    s.state = state
    s.since = t
    s.n_moving = 0.0


@jit
def count_moving(s: Phase, weight: float) -> None:
    """
    Count a moving block.

    :param s: state record.
    :param weight: of it, at most 1.
    """
    s.n_moving += weight


@jit
def shift_phase(s: Phase, shift: int) -> None:
    """
    Follow a clock that was set back.

    :param s: state record.
    :param shift: [ns] new time minus old time.
    """
    s.since += shift
