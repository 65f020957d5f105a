# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The messages of one chunk."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.cdr import kernels
from damadics_fd.bag.grouping import grouped

MESSAGE_HEAD = kernels.BODY_AT  # [B] of a Message record before its data


@dataclass
class Batch:
    """
    The messages of one chunk, to be used until the next one is read.

    :param data: Message records, uint8.
    :param words: the same as words.
    :param channels: channel number of each message.
    :param starts: place of the data of each message.
    :param sizes: size of the data of each message [B].
    :param offset: place of the chunk in the file.
    :param places: of the Message records in the chunk as the file has it.
    """

    data: NDArray[np.uint8]
    words: kernels.Words
    channels: NDArray[np.uint16]
    starts: NDArray[np.int64]
    sizes: NDArray[np.int64]
    offset: int
    places: NDArray[np.int64]

    def log_times(self, rows: NDArray[np.generic] | slice = slice(None)) -> NDArray[np.int64]:
        """Return the log times of some messages [ns]."""
        return self.words.w8[self.starts[rows] + kernels.LOG_TIME].view(np.int64)

    def by_channel(self) -> Iterator[tuple[int, NDArray[np.int64]]]:
        """Yield the channels that have messages, each with the rows of these in order."""
        yield from grouped(self.channels)

    def beginning(self, row: int) -> bytes:
        """Return the first bytes of one message."""
        start = self.starts[row]
        return self.data[start : start + min(self.sizes[row], 4)].tobytes()

    def message(self, row: int) -> bytes:
        """Return one serialised message."""
        start = self.starts[row]
        return self.data[start : start + self.sizes[row]].tobytes()
