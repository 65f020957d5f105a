# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tell live that a position stands still while its control value moves (IN-4)."""

import math

from damadics_fd.core.sample import Sample
from damadics_fd.core.stamps import SECOND

LONG = 3.0  # s
MOVED = 0.15  # of the range of the control value
STILL = 1e-4  # of the stroke


class FrozenPosition:
    """Watch one position against its control value."""

    def __init__(self) -> None:
        self._place = math.nan
        self._since = 0.0  # stamp [s]
        self._low = self._high = math.nan
        self._now = 0.0
        self.waiting: list[Sample] = []  # what is noted when somebody asks

    def note(self, stamp: int, cv: float, x1: float) -> None:
        """
        Take a measurement.

        :param stamp: of it [ns].
        :param cv: control value [1].
        :param x1: stem position [1].
        """
        now = stamp / SECOND
        if abs(x1 - self._place) <= STILL and now >= self._since:
            self._now = now
            if cv < self._low:
                self._low = cv
            elif cv > self._high:
                self._high = cv
        else:
            self._place, self._since, self._now = x1, now, now
            self._low = self._high = cv

    @property
    def problem(self) -> str:
        """What is wrong, '' if nothing."""
        waiting, self.waiting[:] = self.waiting.copy(), []
        for sample in waiting:
            self.note(sample.stamp, sample.cv, sample.x1)
        still, moved = self._now - self._since, self._high - self._low
        if still < LONG or not moved > MOVED:
            return ''
        return (
            f'the position has not moved for {still:.0f} s while the control value moved by '
            f'{100.0 * moved:.0f} %: stem or position sensor'
        )
