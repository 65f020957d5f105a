# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Blocks of measurements, checked before compiled code sees them."""

import zlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from damadics_msgs.msg import FleetLayout

from damadics_fd.core.record import Floats, Ints
from damadics_fd.nodes.fleet.raw_block import RawBlock

MOST_ROWS = 1_000_000  # of one block
MOST_SENDERS = 100  # that are told apart: frame_id is text from outside
ELSEWHERE, UNNAMED = -1, -2  # instead of a valve: one of another process, none
LAYOUT, LENGTHS, ROWS = 'another layout', 'lengths differ', 'too many rows'
UNKNOWN, STAMP = 'unknown valve', 'stamp before time began'
UNREADABLE = 'no readable block'


class Rows(NamedTuple):
    """Hold the rows of a block that a bank may take."""

    valve: Ints  # index into the layout
    stamp: Ints  # ns
    signals: dict[str, Floats]  # those that are measured


class Refusal(NamedTuple):
    """Say what of a block was refused: all of it, or some rows."""

    reason: str
    rows: Ints  # indices of the valves that the rows name, where they are known


def layout_version(valves: Sequence[str], actuators: Sequence[str]) -> int:
    """
    Give a list of valves a number, so that a block of another list is told from its own.

    :param valves: namespaces.
    :param actuators: tags.
    :return: 1 .. 2**32 - 1.

    >>> layout_version(['/lv1'], ['LV-1']) == layout_version(['/lv2'], ['LV-2'])
    False
    """
    text = '\n'.join([*valves, '', *actuators])
    return zlib.crc32(text.encode()) or 1


class OtherLayouts:
    """
    Say which valves of a fleet the indices of other senders mean, by the layouts they publish.

    :param valves: namespaces of the fleet, in the order of its own numbers.
    """

    def __init__(self, valves: Sequence[str]) -> None:
        self._number = {name: n for n, name in enumerate(valves)}
        self._numbers: dict[int, Ints] = {}

    def learn(self, layout: FleetLayout) -> None:
        """
        Take note of a list of valves, which may hold such as are not of this fleet.

        :param layout: of a gateway, or of the fleet itself.
        """
        if len(layout.valve) > MOST_ROWS:
            return
        while len(self._numbers) >= MOST_SENDERS and layout.version not in self._numbers:
            del self._numbers[next(iter(self._numbers))]
        names = ('/' + name.strip('/') for name in layout.valve)
        self._numbers[layout.version] = np.array(
            [self._number.get(name, ELSEWHERE) for name in names], np.int64
        )

    def numbers(self, version: int) -> Ints | None:
        """
        Return what the indices of a layout mean.

        :param version: of the layout.
        :return: numbers of the fleet by index, `ELSEWHERE` for a valve that is not of it; None
            where the layout is not known.
        """
        return self._numbers.get(version)


def check(
    block: RawBlock, version: int, count: int, others: OtherLayouts | None = None
) -> tuple[Rows, list[Refusal]]:
    """
    Check a block.

    :param block: as it came.
    :param version: of the fleet's own layout.
    :param count: number of valves in it.
    :param others: layouts of senders, which it may refer to as well.
    :return: the rows that may be taken, and what was refused and why. Rows of valves that other
        processes judge are neither.
    """
    own = block.layout == version
    index, stamp = block.valve.astype(np.int64), block.stamp
    n = len(index)
    signals = {name: column for name, column in block.signals.items() if len(column)}
    even = len(stamp) == n and all(len(column) == n for column in signals.values())
    if own and even and 0 < n <= MOST_ROWS and index.max() < count and stamp.min() >= 0:
        return Rows(index, stamp, signals), []  # as nearly every block
    numbers = np.arange(count) if own else others.numbers(block.layout) if others else None
    if numbers is None:
        # the indices mean other valves there
        return nothing(), [Refusal(LAYOUT, np.empty(0, np.int64))]
    wrong = [] if even else [LENGTHS]
    wrong += [ROWS] if n > MOST_ROWS else []
    valve = np.full(len(index), UNNAMED)
    valve[index < len(numbers)] = numbers[index[index < len(numbers)]]
    if wrong:
        return nothing(), [Refusal(wrong[-1], valve[valve >= 0])]
    refused = []
    good = valve != ELSEWHERE
    for reason, bad in ((UNKNOWN, valve == UNNAMED), (STAMP, stamp < 0)):
        if (bad & good).any():
            rows = valve[bad & good]
            refused.append(Refusal(reason, rows[rows >= 0]))
            good &= ~bad
    if good.all():
        return Rows(valve, stamp, signals), refused
    return (
        Rows(valve[good], stamp[good], {name: signals[name][good] for name in signals}),
        refused,
    )


def nothing() -> Rows:
    """
    Return no rows.

    :return: empty columns.
    """
    return Rows(np.empty(0, np.int64), np.empty(0, np.int64), {})


class Refused:
    """
    Count what was refused, per valve and per sender.

    :param count: number of valves.
    """

    def __init__(self, count: int) -> None:
        self.by_valve = np.zeros(count, np.int64)
        self.by_reason: dict[str, int] = {}
        self.by_sender: dict[str, int] = {}

    def note(self, refusals: Sequence[Refusal], sender: str) -> None:
        """
        Count refusals.

        :param refusals: of one block.
        :param sender: what the block's frame_id names.
        """
        for refusal in refusals:
            np.add.at(self.by_valve, refusal.rows, 1)
            self.by_reason[refusal.reason] = self.by_reason.get(refusal.reason, 0) + 1
            if sender in self.by_sender or len(self.by_sender) < MOST_SENDERS:
                self.by_sender[sender] = self.by_sender.get(sender, 0) + 1
