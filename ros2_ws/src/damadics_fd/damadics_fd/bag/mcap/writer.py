# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Write the MCAP container: chunks with CRC and message index, summary, footer."""

import struct
import time
from collections.abc import Iterable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.arrays import Column, Places
from damadics_fd.bag.grouping import grouped
from damadics_fd.bag.mcap.crc import crc32
from damadics_fd.bag.mcap.ending import Ending
from damadics_fd.bag.mcap.packing import Packer
from damadics_fd.bag.mcap.records import (
    CHUNK,
    HEAD,
    MAGIC,
    MESSAGE,
    Attachment,
    Channel,
    Op,
    Schema,
    channel_record,
    message_dtype,
    record,
    schema_record,
    string,
    string_map,
)

LIBRARY = 'damadics_fd'
CHUNK_SIZE = 1 << 20  # [B] uncompressed
LEVEL = -4  # of zstd: a tenth larger than 1, and less than half the time to read


class Sink(Protocol):
    """Where the bytes go."""

    def write(self, data: bytes, /) -> int | None:
        """Append all of `data`."""

    def flush(self) -> None:
        """Hand what is buffered to the operating system."""


class McapWriter:
    """
    Write an MCAP file whose finished chunks survive a crash.

    Schemas and channels are written in the open, before the chunk that first uses them and again
    in the summary, so that losing one chunk never loses the meaning of another.

    :param stream: binary file to write to.
    :param profile: profile of the file, `ros2` for bags.
    :param chunk_size: uncompressed size from which a chunk is closed [B].
    :param level: zstd compression level.
    :param message_index: write an index of the messages behind each chunk; readers that want one
        topic or one instant of a large file gain from it.
    """

    def __init__(
        self,
        stream: Sink,
        profile: str = 'ros2',
        chunk_size: int = CHUNK_SIZE,
        level: int = LEVEL,
        message_index: bool = True,
    ):
        self._stream = stream
        self._chunk_size = chunk_size
        self._message_index = message_index
        self._pack = Packer(level)
        self._ending = Ending()
        self._crc = 0  # of the data section
        self._reset_chunk()
        self.position = 0  # [B] written to the stream so far
        self._write(MAGIC + record(Op.HEADER, string(profile), string(LIBRARY)))

    def _write(self, data: bytes) -> None:
        self._stream.write(data)
        self._crc = crc32(data, self._crc)
        self.position += len(data)

    def _reset_chunk(self) -> None:
        self._parts: list[bytes] = []
        self._waiting = 0
        self._size = 0
        self._index: dict[int, list[bytes]] = {}
        self._log_times: list[int] = []
        self.chunk_opened = 0.0  # [s] monotonic time of the first message in the open chunk

    @property
    def pending(self) -> int:
        """Uncompressed bytes in the open chunk."""
        return self._size

    @property
    def waiting(self) -> int:
        """Messages in the open chunk."""
        return self._waiting

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Write a schema and return its number."""
        schema = Schema(self._ending.schemas + 1, name, encoding, data)
        self.put_schema(schema)
        return schema.id

    def put_schema(self, schema: Schema) -> None:
        """Write a schema that has its number."""
        self._write(schema_record(schema))
        self._ending.note_schema(schema)

    def add_channel(
        self, schema_id: int, topic: str, message_encoding: str, metadata: dict[str, str]
    ) -> int:
        """Write a channel and return its number."""
        channel = Channel(self._ending.channels + 1, schema_id, topic, message_encoding, metadata)
        self.put_channel(channel)
        return channel.id

    def put_channel(self, channel: Channel) -> None:
        """Write a channel that has its number."""
        self._write(channel_record(channel))
        self._ending.note_channel(channel)

    def add_message(
        self, channel_id: int, data: bytes, log_time: int, publish_time: int, sequence: int = 0
    ) -> None:
        """
        Put one message into the open chunk.

        :param channel_id: number of its channel.
        :param data: serialised message.
        :param log_time: when it was received [ns].
        :param publish_time: when it was published [ns].
        :param sequence: number given by the publisher, 0 if unknown.
        """
        if not self._size:
            self.chunk_opened = time.monotonic()
        length = 22 + len(data)
        head = MESSAGE.pack(Op.MESSAGE, length, channel_id, sequence, log_time, publish_time)
        self._parts.append(head + data)
        self._waiting += 1
        self._index.setdefault(channel_id, []).append(struct.pack('<QQ', log_time, self._size))
        self._log_times.append(log_time)
        self._size += HEAD.size + length
        self._ending.counts[channel_id] += 1
        if self._size >= self._chunk_size:
            self.end_chunk()

    def add_rows(
        self, channels: Sequence[int], times: NDArray[np.int64], payloads: Sequence[Column]
    ) -> None:
        """
        Write columns of messages: at each time one message for each channel, in this order.

        :param channels: numbers of the channels, k of them.
        :param times: log and publish time of each row, ascending [ns].
        :param payloads: for each channel a structured array of n serialised messages of one size.
        """
        kinds = [message_dtype(payload.dtype.itemsize) for payload in payloads]
        row = np.dtype([(f'm{i}', kind) for i, kind in enumerate(kinds)])
        step = max(1, self._chunk_size // row.itemsize)
        for first in range(0, len(times), step):
            part = slice(first, first + step)
            stamps = np.asarray(times[part], '<u8')
            rows = np.empty(len(stamps), row)
            self.end_chunk()
            for i, (channel, kind, payload) in enumerate(
                zip(channels, kinds, payloads, strict=True)
            ):
                message = rows[f'm{i}']
                message['op'] = Op.MESSAGE
                message['length'] = kind.itemsize - HEAD.size
                message['channel'] = channel
                message['sequence'] = 0
                message['log_time'] = message['publish_time'] = stamps
                message['data'] = payload[part].view(f'V{payload.dtype.itemsize}')
                offset = row.fields[f'm{i}'][1]  # type: ignore[index]
                offsets = np.arange(len(rows), dtype='<u8') * row.itemsize + offset
                self._index[channel] = [np.stack([stamps, offsets], axis=1).tobytes()]
                self._ending.counts[channel] += len(rows)
            self._parts = [rows.tobytes()]
            self._size = rows.nbytes
            self._log_times = [int(stamps[0]), int(stamps[-1])]
            self.end_chunk()

    def add_records(
        self,
        data: bytes,
        channels: NDArray[np.uint16],
        log_times: NDArray[np.uint64],
        offsets: Places,
    ) -> None:
        """
        Write Message records that are encoded already as one chunk.

        :param data: the records one after the other.
        :param channels: channel of each.
        :param log_times: log time of each [ns].
        :param offsets: place of each in `data` [B].
        """
        self.end_chunk()
        for channel, rows in grouped(channels):
            entries = [log_times[rows].astype('<u8'), offsets[rows].astype('<u8')]
            self._index[channel] = [np.stack(entries, axis=1).tobytes()]
            self._ending.counts[channel] += len(rows)
        self._parts, self._size = [data], len(data)
        self._log_times = [int(log_times.min()), int(log_times.max())]
        self.end_chunk()

    def end_chunk(self) -> None:
        """Compress and write the open chunk with its message index."""
        if not self._size:
            return
        times = min(self._log_times), max(self._log_times)
        content = b''.join(self._parts)
        packed = self._pack(content)
        at = self.position
        chunk = record(
            Op.CHUNK,
            CHUNK.pack(*times, len(content), crc32(content)),
            string('zstd'),
            struct.pack('<Q', len(packed)),
            packed,
        )
        places: dict[int, int] = {}
        indexes: list[bytes] = []
        index_at = at + len(chunk)
        for channel, entries in self._index.items() if self._message_index else ():
            places[channel] = index_at
            pairs = string(b''.join(entries))
            indexes.append(record(Op.MESSAGE_INDEX, struct.pack('<H', channel), pairs))
            index_at += len(indexes[-1])
        self._write(chunk + b''.join(indexes))
        sizes, index_size = (len(packed), len(content)), index_at - at - len(chunk)
        self._ending.note_chunk(times, (at, len(chunk)), sizes, places, index_size)
        self._reset_chunk()

    def flush(self) -> None:
        """Close the open chunk and hand everything to the operating system."""
        self.end_chunk()
        self._stream.flush()

    def add_metadata(self, name: str, entries: dict[str, str]) -> None:
        """Write a Metadata record."""
        data = record(Op.METADATA, string(name), string_map(entries))
        self.put_metadata(name, data)

    def put_metadata(self, name: str, data: bytes) -> None:
        """Write a Metadata record that is encoded already."""
        self.end_chunk()
        at = self.position
        self._write(data)
        self._ending.note_metadata(name, at, len(data))

    def put_attachment(self, about: Attachment, length: int, blocks: Iterable[bytes]) -> None:
        """
        Write an Attachment record that is encoded already.

        :param about: what it says.
        :param length: its length with head [B].
        :param blocks: its bytes, piece by piece.
        """
        self.end_chunk()
        self._ending.note_attachment(about, self.position, length)
        for block in blocks:
            self._write(block)

    def finish(self) -> None:
        """Write the summary and the footer, all or nothing; the stream stays open."""
        self.end_chunk()
        self._write(self._ending.records(self.position, self._crc))
        self._stream.flush()
