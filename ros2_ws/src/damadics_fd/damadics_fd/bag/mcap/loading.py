# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Chunks of a file, loaded by other cores before they are asked for."""

import os
from collections import deque
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.mcap.unpack import Slot

THREADS = min(3, len(os.sched_getaffinity(0)))
AHEAD = THREADS + 1  # chunks loaded and not yet asked for
FEW = 3  # chunks, for which no thread is started
LARGE = 1 << 24  # [B] a larger chunk is not loaded ahead, so that memory stays bounded
KEPT = 1 << 22  # [B] memory of a slot that the next file takes over
_spare: list[Slot] = []  # of files that are closed: new memory costs as much as what is read


class _Ahead(NamedTuple):
    """A chunk on its way."""

    at: int
    length: int
    slot: Slot
    data: Future[NDArray[np.uint8]]


class Loader:
    """
    Load the chunks of a file.

    Reading, decompression and CRC run in threads and without Python's lock. They follow the chunk
    index, but nothing is believed of it: it only says what will probably be asked for next.

    :param fd: file.
    :param limits: what a chunk may ask for.
    :param listed: place and length of the content of each chunk by the index; none is no thread.
    """

    def __init__(self, fd: int, limits: Limits, listed: Mapping[int, int]):
        self._fd, self._limits = fd, limits
        self._careful = replace(limits, chunk=min(limits.chunk, LARGE))
        self._listed = deque(sorted(listed.items()))
        self._free: list[Slot] = []
        self._present: Slot | None = None
        self._ahead: deque[_Ahead] = deque()
        self._pool: ThreadPoolExecutor | None = None
        if THREADS > 1 and len(listed) > FEW:
            self._pool = ThreadPoolExecutor(THREADS, 'chunks')

    def load(self, at: int, length: int) -> NDArray[np.uint8]:
        """
        Return the records of a chunk, to be used until the next call.

        :param at: place of its content.
        :param length: length of its content [B].
        :raises BagError: where it is damaged or asks for too much.
        """
        if self._present:
            self._free.append(self._present)
            self._present = None
        while self._ahead and self._ahead[0].at < at:  # not asked for after all
            passed = self._ahead.popleft()
            passed.data.exception()
            self._free.append(passed.slot)
        self._look_ahead(at)
        if self._ahead and self._ahead[0][:2] == (at, length):
            found = self._ahead.popleft()
            self._present = found.slot
            try:
                return found.data.result()
            except BagError:
                pass  # for its size, perhaps
        else:
            self._present = self._slot()
        return self._present.load(self._fd, at, length, self._limits)

    def _slot(self) -> Slot:
        for slots in (self._free, _spare):
            try:
                return slots.pop()
            except IndexError:  # of `_spare` other threads take, too
                continue
        return Slot()

    def _look_ahead(self, at: int) -> None:
        while self._pool and self._listed and len(self._ahead) < AHEAD:
            place, length = self._listed.popleft()
            if place >= at and length <= LARGE:
                slot = self._slot()
                data = self._pool.submit(slot.load, self._fd, place, length, self._careful)
                self._ahead.append(_Ahead(place, length, slot, data))

    def close(self) -> None:
        """End the threads."""
        if self._pool:
            self._pool.shutdown(cancel_futures=True)
            self._pool = None
        # not the present one: its chunk may still be looked at
        slots = [*self._free, *(one.slot for one in self._ahead)]
        self._free.clear()
        self._ahead.clear()
        small = [slot for slot in slots if slot.size <= KEPT]
        _spare.extend(small[: max(AHEAD - len(_spare), 0)])
