# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The summary at the end of a finished MCAP file."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.mcap.crc import crc32
from damadics_fd.bag.mcap.records import (
    CHUNK_INDEX,
    FOOTER,
    FOOTER_SIZE,
    HEAD,
    MAGIC,
    Channel,
    Fields,
    Op,
    Schema,
    parse_channel,
    parse_schema,
)

TAIL = 1 << 22  # [B] searched where bytes were lost or added before the summary
_DATA_END = HEAD.pack(Op.DATA_END, 4)
Read = Callable[[int, int], bytes]  # place, size


@dataclass
class Summary:
    """
    What the end of a file says about it.

    :param counts: messages by channel.
    :param chunks: by the place of each chunk the places of its message indexes.
    :param lengths: by the place of each chunk the length of its record [B].
    :param present: it was there and its CRC was right.
    :param moved: bytes are missing or were added before it, so that no place in it is right.
    """

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    chunks: dict[int, dict[int, int]] = field(default_factory=dict)
    lengths: dict[int, int] = field(default_factory=dict)
    present: bool = False
    moved: bool = False


def read_summary(read: Read, size: int, limits: Limits) -> Summary:
    """
    Read the summary of a file.

    :param read: reads bytes of the file.
    :param size: size of the file [B].
    :param limits: what the file may ask for.
    :return: an empty one where it is absent or damaged.
    """
    end = size - len(MAGIC) - FOOTER_SIZE
    tail = read(max(0, end), FOOTER_SIZE + len(MAGIC))
    if len(tail) < FOOTER_SIZE + len(MAGIC) or not tail.endswith(MAGIC):
        return Summary()
    op, length = HEAD.unpack_from(tail)
    stated, _, crc = FOOTER.unpack_from(tail, HEAD.size)
    if op != Op.FOOTER or length != FOOTER.size or not stated:
        return Summary()
    for start in _starts(read, stated, end, limits):
        data = read(start, end - start + FOOTER_SIZE - 4)
        if crc32(data) == crc or (crc == 0 and start == stated):
            try:
                summary = _parse(memoryview(data)[: end - start])
            except (BagError, ValueError):
                return Summary()
            summary.present, summary.moved = True, start != stated
            return summary
    return Summary()


def _starts(read: Read, stated: int, end: int, limits: Limits) -> Iterator[int]:
    """Yield where the summary may begin: where the footer says, or behind the data section."""
    if stated <= end <= stated + limits.record:
        yield stated
    first = max(0, end - TAIL)
    tail = read(first, end - first)
    at = tail.rfind(_DATA_END)
    if at >= 0:
        yield first + at + len(_DATA_END) + 4


def _parse(data: memoryview) -> Summary:
    summary = Summary()
    at = 0
    while at < len(data):
        fields = Fields(data[at:])
        op, length = fields.unpack(HEAD)
        content = fields.take(length)
        at += HEAD.size + length
        if op == Op.SCHEMA:
            schema = parse_schema(content)
            summary.schemas[schema.id] = schema
        elif op == Op.CHANNEL:
            channel = parse_channel(content)
            summary.channels[channel.id] = channel
        elif op == Op.CHUNK_INDEX:
            index = Fields(content)
            _, _, offset, summary.lengths[offset] = index.unpack(CHUNK_INDEX)
            entries = np.frombuffer(index.bytes_(), '<u2,<u8')
            summary.chunks[offset] = dict(entries.tolist())
        elif op == Op.STATISTICS:
            counts = Fields(content[46:])
            pairs = np.frombuffer(counts.rest(), '<u2,<u8')
            summary.counts = dict(pairs.tolist())
    return summary
