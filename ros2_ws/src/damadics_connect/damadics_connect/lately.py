# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The largest of what was seen lately."""

PARTS = 8  # of the window: as exactly is forgotten what is older


class Lately:
    """
    Remember the largest value of a time that has just passed.

    :param window: for how long at least, on the clock of `take`; an eighth longer at most.

    >>> lately = Lately(80)
    >>> lately.take(5, now=100)
    >>> lately.take(2, now=150)
    >>> [lately.largest(now) for now in (180, 191, 241)]
    [5, 2, 0]
    """

    def __init__(self, window: int) -> None:
        self._part = max(1, window // PARTS)
        self._kept: list[tuple[int, int]] = []  # part and value, each smaller than the one before

    def take(self, value: int, now: int) -> None:
        """
        Take a value.

        :param value: not negative.
        :param now: time of a clock that nobody sets.
        """
        kept = self._kept
        while kept and kept[-1][1] <= value:
            kept.pop()
        part = now // self._part
        if value and not (kept and kept[-1][0] == part):
            kept.append((part, value))

    def largest(self, now: int) -> int:
        """
        Return the largest value.

        :param now: as for `take`.
        :return: 0 where there was none.
        """
        kept = self._kept
        while kept and now // self._part - kept[0][0] > PARTS:
            kept.pop(0)
        return kept[0][1] if kept else 0
