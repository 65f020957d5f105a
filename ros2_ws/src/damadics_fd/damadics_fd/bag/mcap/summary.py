# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The summary at the end of a finished MCAP file."""

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.mcap.crc import crc32
from damadics_fd.bag.mcap.records import (
    CHUNK_INDEX,
    FOOTER,
    FOOTER_SIZE,
    HEAD,
    MAGIC,
    STATISTICS,
    Channel,
    Fields,
    Op,
    Schema,
    parse_channel,
    parse_schema,
)

TAIL = 1 << 22  # [B] searched where bytes were lost or added before the summary
_DATA_END = HEAD.pack(Op.DATA_END, 4)
_PLACE = struct.Struct('<QQ')
_INDEX = struct.Struct(CHUNK_INDEX.format + 'I')  # and the size of the pairs behind it
_PAIR = struct.Struct('<HQ')
Read = Callable[[int, int], bytes]  # place, size


class Indexed(NamedTuple):
    """What the index says about a chunk: times [ns], length of its record [B]."""

    start: int
    end: int
    length: int
    messages: dict[int, int]  # places of the message indexes by channel


@dataclass
class Summary:
    """
    What the end of a file says about it.

    :param counts: messages by channel.
    :param messages: all of them, -1 where it is not said.
    :param chunks: by the place of each chunk what the index says about it.
    :param attachments: places and lengths of the attachments.
    :param metadata: places and lengths of the metadata.
    :param records: numbers of attachments, metadata and chunks, none where it is not said.
    :param present: it was there and its CRC was right.
    :param absent: the file is finished and says that it has none.
    :param moved: bytes are missing or were added before it, so that no place in it is right.
    """

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    messages: int = -1
    chunks: dict[int, Indexed] = field(default_factory=dict)
    attachments: dict[int, int] = field(default_factory=dict)
    metadata: dict[int, int] = field(default_factory=dict)
    records: tuple[int, int, int] | None = None
    present: bool = False
    absent: bool = False
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
    if op != Op.FOOTER or length != FOOTER.size:
        return Summary()
    if not stated:
        before = read(max(0, end - len(_DATA_END) - 4), len(_DATA_END))
        good = not crc or crc32(tail[: FOOTER_SIZE - 4]) == crc
        return Summary(absent=good and before == _DATA_END)
    for start in _starts(read, stated, end, limits):
        data = read(start, end - start + FOOTER_SIZE - 4)
        if crc32(data) == crc or (crc == 0 and start == stated):
            try:
                summary = _parse(memoryview(data)[: end - start], limits)
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


def _pairs(data: bytes | memoryview) -> dict[int, int]:
    if len(data) % _PAIR.size:
        raise BagError('a map in the summary is damaged')
    return {channel: value for channel, value in _PAIR.iter_unpack(data)}


def _parse(data: memoryview, limits: Limits) -> Summary:
    summary = Summary()
    at = text = 0
    while at < len(data):
        begin = at + HEAD.size
        op, length = HEAD.unpack_from(data, at) if begin <= len(data) else (0, len(data))
        if begin + length > len(data):
            raise BagError('the summary ends in the middle of a record')
        at = begin + length
        content = data[begin:at]
        text += length if op in (Op.SCHEMA, Op.CHANNEL) else 0
        if text > limits.text:
            raise BagError('the summary is beyond the limit')
        if op == Op.CHUNK_INDEX:
            _note_chunk(summary, content)
        else:
            _note(summary, op, content)
    return summary


def _note_chunk(summary: Summary, content: memoryview) -> None:
    """Note one of the many."""
    if len(content) < _INDEX.size:
        raise BagError('the index of a chunk is damaged')
    start, end, offset, length, size = _INDEX.unpack_from(content)
    if size > len(content) - _INDEX.size:
        raise BagError('the index of a chunk is damaged')
    pairs = _pairs(content[_INDEX.size : _INDEX.size + size])
    summary.chunks[offset] = Indexed(start, end, length, pairs)


def _note(summary: Summary, op: int, content: memoryview) -> None:
    fields = Fields(content)
    if op == Op.SCHEMA:
        schema = parse_schema(content)
        summary.schemas[schema.id] = schema
    elif op == Op.CHANNEL:
        channel = parse_channel(content)
        summary.channels[channel.id] = channel
    elif op == Op.STATISTICS:
        summary.messages, _, _, *records, _, _ = fields.unpack(STATISTICS)
        summary.records = (records[0], records[1], records[2])
        summary.counts = _pairs(fields.bytes_())
    elif op in (Op.ATTACHMENT_INDEX, Op.METADATA_INDEX):
        offset, length = fields.unpack(_PLACE)
        places = summary.attachments if op == Op.ATTACHMENT_INDEX else summary.metadata
        places[offset] = length
