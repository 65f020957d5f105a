# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The records of an MCAP file (https://mcap.dev/spec) as bytes.

A file is: magic, Header, data section (Schema, Channel, Chunk, MessageIndex, Metadata, ...
DataEnd), summary section, Footer, magic. Each record is an opcode (u8), the length of its content
(u64) and the content, little endian throughout. A Chunk holds compressed Schema, Channel and
Message records.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from damadics_fd.bag.errors import BagError

MAGIC = b'\x89MCAP0\r\n'


class Op(IntEnum):
    """Opcodes of the records."""

    HEADER = 0x01
    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    MESSAGE_INDEX = 0x07
    CHUNK_INDEX = 0x08
    ATTACHMENT = 0x09
    ATTACHMENT_INDEX = 0x0A
    STATISTICS = 0x0B
    METADATA = 0x0C
    METADATA_INDEX = 0x0D
    SUMMARY_OFFSET = 0x0E
    DATA_END = 0x0F


HEAD = struct.Struct('<BQ')  # opcode, length of the content
MESSAGE = struct.Struct('<BQHIQQ')  # head, channel, sequence, log time, publish time; then data
CHUNK = struct.Struct('<QQQI')  # start, end, uncompressed size, uncompressed CRC
CHUNK_INDEX = struct.Struct('<QQQQ')  # start, end, offset of the chunk, length of the chunk
STATISTICS = struct.Struct('<QHIIIIQQ')
FOOTER = struct.Struct('<QQI')  # start of the summary, of its offsets, CRC of the summary
FOOTER_SIZE = HEAD.size + FOOTER.size


@dataclass(frozen=True, slots=True)
class Schema:
    """Definition of a message type: `encoding` is `ros2msg` where `data` is the commented text."""

    id: int
    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Channel:
    """A topic in a file."""

    id: int
    schema_id: int
    topic: str
    message_encoding: str
    metadata: dict[str, str] = field(default_factory=dict)


class Extent(NamedTuple):
    """A whole record in a file: its place, its length with head [B], and what it is called."""

    op: Op
    at: int
    length: int
    name: str


class Attachment(NamedTuple):
    """What an Attachment record says: times [ns], size of the fields before the CRC."""

    log_time: int
    create_time: int
    name: str
    media_type: str
    data_size: int
    size: int
    crc: int


class ChunkHead(NamedTuple):
    """What a Chunk record says before its compressed records."""

    start_time: int
    end_time: int
    size: int
    crc: int
    compression: str


def message_dtype(size: int) -> np.dtype:
    """
    Describe a Message record whose data has a fixed size.

    :param size: size of the data [B].
    :return: packed structured type with the fields of the record.
    """
    return np.dtype(
        [
            ('op', 'u1'),
            ('length', '<u8'),
            ('channel', '<u2'),
            ('sequence', '<u4'),
            ('log_time', '<u8'),
            ('publish_time', '<u8'),
            ('data', f'V{size}'),
        ]
    )


def record(op: int, *parts: bytes) -> bytes:
    """Put the head of a record before its content."""
    content = b''.join(parts)
    return HEAD.pack(op, len(content)) + content


def string(text: str | bytes) -> bytes:
    """Prefix a string with its length."""
    data = text.encode() if isinstance(text, str) else text
    return struct.pack('<I', len(data)) + data


def string_map(entries: dict[str, str]) -> bytes:
    """Encode a map of strings, prefixed with its length."""
    return string(b''.join(string(key) + string(value) for key, value in entries.items()))


def schema_record(schema: Schema) -> bytes:
    """Encode a Schema record."""
    head = struct.pack('<H', schema.id) + string(schema.name) + string(schema.encoding)
    return record(Op.SCHEMA, head, string(schema.data))


def channel_record(channel: Channel) -> bytes:
    """Encode a Channel record."""
    return record(
        Op.CHANNEL,
        struct.pack('<HH', channel.id, channel.schema_id),
        string(channel.topic),
        string(channel.message_encoding),
        string_map(channel.metadata),
    )


class Fields:
    """
    Read the fields of one record in order.

    :param content: the content of the record; any field that runs past its end is a `BagError`.
    """

    def __init__(self, content: bytes | memoryview):
        self._content = memoryview(content)
        self._at = 0

    def take(self, size: int) -> memoryview:
        """Return the next `size` bytes."""
        if size > len(self._content) - self._at:
            raise BagError('a record is shorter than its fields say')
        self._at += size
        return self._content[self._at - size : self._at]

    def unpack(self, layout: struct.Struct) -> tuple[int, ...]:
        """Return the next fields of fixed size."""
        return layout.unpack(self.take(layout.size))

    def bytes_(self) -> bytes:
        """Return the next length-prefixed bytes."""
        (size,) = struct.unpack('<I', self.take(4))
        return bytes(self.take(size))

    def string(self) -> str:
        """Return the next string."""
        try:
            return self.bytes_().decode()
        except UnicodeDecodeError as error:
            raise BagError('a record holds a string that is not UTF-8') from error

    def string_map(self) -> dict[str, str]:
        """Return the next map of strings."""
        inner = Fields(self.bytes_())
        entries = {}
        while inner.left:
            key = inner.string()
            entries[key] = inner.string()
        return entries

    @property
    def left(self) -> int:
        """Number of bytes not read yet."""
        return len(self._content) - self._at

    def rest(self) -> memoryview:
        """Return everything not read yet."""
        return self.take(self.left)


_CHUNK = struct.Struct(CHUNK.format + 'I')  # and the size of the name of the compression
_U16 = struct.Struct('<H')
_U16_2 = struct.Struct('<HH')
_U64 = struct.Struct('<Q')
_U64_2 = struct.Struct('<QQ')
_NAMES = 1 << 16  # [B] that name and media type of an attachment may take


def parse_schema(content: bytes | memoryview) -> Schema:
    """Decode a Schema record."""
    fields = Fields(content)
    (number,) = fields.unpack(_U16)
    return Schema(number, fields.string(), fields.string(), fields.bytes_())


def parse_channel(content: bytes | memoryview) -> Channel:
    """Decode a Channel record."""
    fields = Fields(content)
    number, schema_id = fields.unpack(_U16_2)
    return Channel(number, schema_id, fields.string(), fields.string(), fields.string_map())


def parse_chunk(content: bytes | memoryview) -> tuple[ChunkHead, memoryview]:
    """Decode a Chunk record into its head and its compressed records."""
    content = memoryview(content)
    try:  # by itself, since Python's share of the time to read a file is that of its chunks
        start, end, size, crc, name = _CHUNK.unpack_from(content)
        at = _CHUNK.size + name
        (length,) = _U64.unpack_from(content, at)
        compression = str(content[_CHUNK.size : at], 'utf-8')
    except struct.error as error:
        raise BagError('a record is shorter than its fields say') from error
    except UnicodeDecodeError as error:
        raise BagError('a record holds a string that is not UTF-8') from error
    at += _U64.size
    if length > len(content) - at:
        raise BagError('the CHUNK record is damaged')
    return ChunkHead(start, end, size, crc, compression), content[at : at + length]


def parse_metadata(content: bytes | memoryview) -> tuple[str, dict[str, str]]:
    """Decode a Metadata record into its name and entries."""
    fields = Fields(content)
    return fields.string(), fields.string_map()


def parse_attachment(read: Callable[[int, int], bytes], at: int) -> Attachment:
    """
    Read what an Attachment record says, but not its data.

    :param read: reads bytes of the file: place, size.
    :param at: place of the record.
    :raises BagError: where the record is damaged.
    """
    _, length = HEAD.unpack(read(at, HEAD.size))
    begin = at + HEAD.size
    fields = Fields(read(begin, min(length, _NAMES)))
    log_time, create_time = fields.unpack(_U64_2)
    name, media_type = fields.string(), fields.string()
    (data_size,) = fields.unpack(_U64)
    size = 16 + 4 + len(name.encode()) + 4 + len(media_type.encode()) + 8 + data_size
    if size + 4 > length:
        raise BagError('the ATTACHMENT record is damaged')
    crc = int.from_bytes(read(begin + size, 4), 'little')
    return Attachment(log_time, create_time, name, media_type, data_size, size, crc)
