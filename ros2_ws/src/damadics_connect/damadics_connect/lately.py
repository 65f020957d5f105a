# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The largest of what was seen lately."""


class Lately:
    """
    Remember the largest value of the last one to two windows.

    :param window: its length, on the clock of `take`.
    """

    def __init__(self, window: int) -> None:
        self._window = window
        self._since = self._before = self._present = 0

    def take(self, value: int, now: int) -> None:
        """
        Take a value.

        :param value: not negative.
        :param now: time of a clock that nobody sets.
        """
        self._turn(now)
        if value > self._present:
            self._present = value

    def largest(self, now: int) -> int:
        """
        Return the largest value.

        :param now: as for `take`.
        :return: 0 where there was none.
        """
        self._turn(now)
        return max(self._before, self._present)

    def _turn(self, now: int) -> None:
        passed = now - self._since
        if passed > self._window:
            self._before = self._present if passed <= 2 * self._window else 0
            self._present, self._since = 0, now
