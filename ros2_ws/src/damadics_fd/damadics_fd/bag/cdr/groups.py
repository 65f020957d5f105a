# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages that all have their fields at the same places, decoded in one pass over a chunk."""

from collections.abc import Iterable, Mapping
from typing import Self

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.arrays import Columns
from damadics_fd.bag.cdr import kernels
from damadics_fd.bag.cdr.kernels import BODY_AT, LOG_TIME, Words
from damadics_fd.bag.cdr.layout import Layout, Place
from damadics_fd.bag.mcap.records import HEAD, MESSAGE, Op

WIDE = ('f8', 'i8', 'u8')
FIRST = 1000  # records of a chunk looked at for the first message of a channel


class Alike:
    """
    Decode messages of one layout and size of which only 64-bit fields and times are read.

    :param layout: the layout, little endian.
    :param size: size of each message [B].
    :param places: what to read by column: places of 64-bit fields, the bare offset for times.
    """

    def __init__(self, layout: Layout, size: int, places: Mapping[str, Place | int]):
        wide = {name: place for name, place in places.items() if isinstance(place, Place)}
        times = {name: place for name, place in places.items() if isinstance(place, int)}
        self.size = size
        self.kinds = {name: place.dtype for name, place in wide.items()}
        self.kinds |= dict.fromkeys(('log_time', *times), 'i8')
        self._places = _in_record(place for place, _ in layout.lengths)
        self._values = np.array([value for _, value in layout.lengths], np.uint32)
        self._offsets = _in_record([*(p.offset for p in wide.values()), LOG_TIME])
        self._times = _in_record(times.values())

    @classmethod
    def of(cls, layout: Layout, size: int, places: Mapping[str, Place | int]) -> Self | None:
        """Return the decoder, None where a field is no 64-bit number or time."""
        fields = [place for place in places.values() if isinstance(place, Place)]
        fit = all(p.dtype in WIDE and p.repeat is None and not p.text for p in fields)
        return cls(layout, size, places) if fit and layout.order == '<' else None

    def block(self, rows: int) -> NDArray[np.uint64]:
        """Return memory for the columns of so many messages."""
        return np.empty((len(self.kinds), rows), np.uint64)

    def decode(
        self, words: Words, end: int, number: int, block: NDArray[np.uint64], first: int = 0
    ) -> int:
        """
        Decode the messages of one channel in a chunk.

        :param words: the chunk.
        :param end: its size [B].
        :param number: number of the channel.
        :param block: memory for the columns.
        :param first: row of the first message in it.
        :return: number of messages, -1 where one of them or the chunk is not as expected.
        """
        return int(
            kernels.decode(
                words,
                end,
                number,
                self.size,
                self._places,
                self._values,
                self._offsets,
                self._times,
                block,
                first,
            )
        )

    def columns(self, block: NDArray[np.uint64]) -> Columns:
        """View a block as columns."""
        return {name: block[row].view(kind) for row, (name, kind) in enumerate(self.kinds.items())}


def _in_record(places: Iterable[int]) -> NDArray[np.uint64]:
    """Count places in the data of a message from the begin of its record."""
    return np.array([BODY_AT + place for place in places], np.uint64)


def first_message(data: NDArray[np.uint8], number: int) -> tuple[int, int] | None:
    """
    Find a message of a channel at the beginning of a chunk.

    :param data: records.
    :param number: number of the channel.
    :return: place and size of its data, None where there is none.
    """
    at = 0
    for _ in range(FIRST):
        if at + MESSAGE.size > len(data):
            break
        op, length, channel, *_ = MESSAGE.unpack_from(data.data, at)
        if op == Op.MESSAGE and channel == number:
            return at + MESSAGE.size, length + HEAD.size - MESSAGE.size
        at += HEAD.size + length
    return None
