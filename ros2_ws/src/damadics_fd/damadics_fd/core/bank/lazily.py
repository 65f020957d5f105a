# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Records of thousands of valves that take memory only where something is written."""

import mmap

import numpy as np

from damadics_fd.core.record import Array

SMALL_PAGES = getattr(mmap, 'MADV_NOHUGEPAGE', None)  # where the system has such


def copies(first: Array, count: int) -> Array:
    """
    Return copies of a record that is zero for the most part.

    :param first: the record, in an array of length 1.
    :param count: how many; a whole page of zeros takes no memory until it is written.
    :return: structured array of that length.
    """
    kind = first.dtype
    room = mmap.mmap(-1, max(count * kind.itemsize, 1))
    if SMALL_PAGES is not None:
        room.madvise(SMALL_PAGES)
    rows: Array = np.frombuffer(room, kind, count)
    for name in kind.names or ():
        if any(first[name].tobytes()):
            rows[name] = first[name][0]
    return rows
