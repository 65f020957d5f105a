# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Find the records behind a damaged place."""

from collections.abc import Callable

import numpy as np

from damadics_fd.bag.cdr.kernels import words
from damadics_fd.bag.mcap.records import HEAD, Op
from damadics_fd.bag.mcap.wellformed import well_formed

BEGIN = 512  # [B] of the content of a record, read with its head
WINDOW = 1 << 20  # [B] searched at a time
KNOWN = 0x10  # opcodes from here on belong to later versions and other programs
LINKS = 3  # records that follow each other are no accident
Read = Callable[[int, int], bytes]  # place, size


def find_records(read: Read, at: int, size: int, most: int, chunked: bool) -> int | None:
    """
    Find the next place where records follow each other again.

    :param read: reads bytes of the file.
    :param at: where to begin.
    :param size: size of the file [B].
    :param most: longest record but attachments [B].
    :param chunked: the file has chunks: what looks like a message is a piece of a damaged one,
        as compression may leave it.
    :return: the place, None where there is none.
    """
    window = 1 << 12
    while at < size:
        data = read(at, window + HEAD.size)
        for place in _heads(data, window, size - at, chunked):
            if follows(read, at + place, size, most):
                return at + place
        at += window
        window = min(4 * window, WINDOW)
    return None


def _heads(data: bytes, window: int, left: int, chunked: bool) -> list[int]:
    """
    Return the places in a window where a record may begin.

    Where the next record would begin within it, there has to be one, too.

    :param data: the window, and the head of a record behind it.
    :param window: its size [B].
    :param left: size of the file from the window on [B].
    :param chunked: as `find_records`.
    """
    view = words(np.frombuffer(bytearray(data), np.uint8))
    last = min(window, len(data) - HEAD.size + 1)
    if last <= 0:
        return []
    heads = (view.w1 - np.uint8(1) < KNOWN - 1)[:last] & (view.w4[5 : last + 5] == 0)
    if chunked:
        heads &= view.w1[:last] != Op.MESSAGE
    places = np.flatnonzero(heads)
    behind = places + HEAD.size + view.w4[places + 1].astype(np.int64)
    within = behind + HEAD.size <= len(data)
    following = behind[within]
    good = (view.w1[following] - np.uint8(1) < KNOWN - 1) & (view.w4[following + 5] == 0)
    good |= view.w1[places[within]] == Op.FOOTER
    good |= following == left
    keep = np.ones(len(places), bool)
    keep[within] = good
    found: list[int] = places[keep].tolist()
    return found


def follows(read: Read, at: int, size: int, most: int, links: int = LINKS) -> bool:
    """Tell whether whole records follow each other from a place, parameters as above."""
    for _ in range(links):
        begin = read(at, HEAD.size + BEGIN)
        if len(begin) < HEAD.size:
            return False
        op, length = HEAD.unpack_from(begin)
        end = at + HEAD.size + length
        if not 0 < op < KNOWN or end > size or (length > most and op != Op.ATTACHMENT):
            return False
        if not well_formed(Op(op), begin[HEAD.size :][:length], length):
            return False
        if op == Op.FOOTER or end == size:
            return True
        at = end
    return True
