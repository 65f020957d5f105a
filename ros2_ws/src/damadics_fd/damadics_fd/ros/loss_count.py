# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages that were published and never arrived."""

from collections.abc import Iterable


class Sequence:
    """
    Count the messages of a topic that were lost on the way, by the numbers of its publisher.

    Each publisher numbers its messages, but a message does not say who published it: where the
    publishers change or are several, nothing is counted.
    """

    def __init__(self) -> None:
        self.lost = 0
        self._recent = 0
        self._last = 0
        self._sources: frozenset[bytes] = frozenset()

    def note(self, number: int) -> None:
        """Take the number of a message; the first of a publisher is 1."""
        if 0 < self._last < number - 1:
            self._recent += number - self._last - 1
        self._last = number

    def settle_unchanged(self) -> None:
        """Count what was missed since the last call, where the publishers are known the same."""
        self.settle(self._sources)

    def settle(self, sources: Iterable[bytes]) -> None:
        """
        Count what was missed since the last call if there was one publisher and no other came.

        :param sources: identities of the present publishers.
        """
        present = frozenset(sources)
        if len(self._sources) == 1 and present <= self._sources:
            self.lost += self._recent
        if present != self._sources:
            self._last = 0
        self._recent = 0
        self._sources = present
