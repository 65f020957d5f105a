# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Find the records behind a damaged place."""

import re
from collections.abc import Callable

from damadics_fd.bag.mcap.records import HEAD, Op
from damadics_fd.bag.mcap.wellformed import well_formed

BEGIN = 512  # [B] of the content of a record, read with its head
WINDOW = 1 << 20  # [B] searched at a time
LINKS = 3  # records that follow each other are no accident
_HEAD_PATTERN = re.compile(rb'[\x01-\x0f](?=.{4}\x00{4})', re.DOTALL)
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
        for match in _HEAD_PATTERN.finditer(data):
            if chunked and data[match.start()] == Op.MESSAGE:
                continue
            if follows(read, at + match.start(), size, most):
                return at + match.start()
        at += window
        window = min(4 * window, WINDOW)
    return None


def follows(read: Read, at: int, size: int, most: int, links: int = LINKS) -> bool:
    """Tell whether whole records follow each other from a place, parameters as above."""
    for _ in range(links):
        begin = read(at, HEAD.size + BEGIN)
        if len(begin) < HEAD.size:
            return False
        op, length = HEAD.unpack_from(begin)
        end = at + HEAD.size + length
        if not 0 < op < 0x10 or end > size or (length > most and op != Op.ATTACHMENT):
            return False
        if not well_formed(Op(op), begin[HEAD.size :][:length], length):
            return False
        if op == Op.FOOTER or end == size:
            return True
        at = end
    return True
