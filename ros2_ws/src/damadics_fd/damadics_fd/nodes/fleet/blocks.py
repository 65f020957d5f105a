# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Blocks of measurements, checked before compiled code sees them."""

import zlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from damadics_msgs.msg import MeasurementBlock

from damadics_fd.core.record import Floats, Ints
from damadics_fd.core.sample import SIGNALS

MOST_ROWS = 1_000_000  # of one block
MOST_SENDERS = 100  # that are told apart: frame_id is text from outside
LAYOUT, LENGTHS, ROWS = 'another layout', 'lengths differ', 'too many rows'
UNKNOWN, STAMP = 'unknown valve', 'stamp before time began'


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


def check(message: MeasurementBlock, version: int, count: int) -> tuple[Rows, list[Refusal]]:
    """
    Check a block.

    :param message: the block.
    :param version: of the layout that it must refer to.
    :param count: number of valves in the layout.
    :return: the rows that may be taken, and what was refused and why.
    """
    valve = np.asarray(message.valve, np.uint32).astype(np.int64)
    stamp = np.asarray(message.stamp, np.int64)
    known = valve[valve < count]
    if message.layout != version:
        # the indices mean other valves there
        return nothing(), [Refusal(LAYOUT, np.empty(0, np.int64))]
    if len(valve) > MOST_ROWS:
        return nothing(), [Refusal(ROWS, known)]
    columns = {name: np.asarray(getattr(message, name), np.float64) for name in SIGNALS}
    signals = {name: column for name, column in columns.items() if len(column)}
    if any(len(column) != len(valve) for column in (stamp, *signals.values())):
        return nothing(), [Refusal(LENGTHS, known)]
    refused = []
    good = np.ones(len(valve), np.bool_)
    for reason, wrong in ((UNKNOWN, valve >= count), (STAMP, stamp < 0)):
        if wrong.any():
            rows = valve[wrong & good]
            refused.append(Refusal(reason, rows[rows < count]))
            good &= ~wrong
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
