# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read MCAP files by chunk, whole or damaged."""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.cdr import kernels
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.mcap.loading import Loader
from damadics_fd.bag.mcap.records import (
    HEAD,
    MAGIC,
    Channel,
    Fields,
    Op,
    Schema,
    parse_channel,
    parse_metadata,
    parse_schema,
    record,
)
from damadics_fd.bag.mcap.summary import read_summary
from damadics_fd.bag.mcap.unpack import open_plain
from damadics_fd.bag.mcap.wellformed import well_formed

LOOSE = 1 << 20  # [B] handled at a time where there are no chunks
BEGIN = 512  # [B] of the content of a record, read with its head
_HEAD_PATTERN = re.compile(rb'[\x01-\x0f](?=.{4}\x00{4})', re.DOTALL)


class _Found(NamedTuple):
    """A record; `chunk` holds the records of a chunk, decompressed and checked."""

    op: int
    length: int
    content: bytes = b''
    chunk: NDArray[np.uint8] = np.empty(0, np.uint8)


class Problem(NamedTuple):
    """A damaged place."""

    offset: int
    text: str


@dataclass
class Batch:
    """
    The messages of one chunk, to be used until the next one is read.

    :param data: records, uint8.
    :param words: the same as words.
    :param channels: channel number of each message.
    :param starts: place of the data of each message.
    :param sizes: size of the data of each message [B].
    :param offset: place of the chunk in the file.
    """

    data: NDArray[np.uint8]
    words: kernels.Words
    channels: NDArray[np.uint16]
    starts: NDArray[np.int64]
    sizes: NDArray[np.int64]
    offset: int

    def log_times(self, rows: NDArray | slice = slice(None)) -> NDArray[np.int64]:
        """Return the log times of some messages [ns]."""
        return self.words.w8[self.starts[rows] + kernels.LOG_TIME].view(np.int64)

    def message(self, row: int) -> bytes:
        """Return one serialised message."""
        start = self.starts[row]
        return self.data[start : start + self.sizes[row]].tobytes()


class McapFile:
    """
    Read one MCAP file.

    :param path: file, possibly compressed as a whole (`.zstd`).
    :param tolerant: read on behind damage and collect it in `problems`; otherwise it is an error.
    :param limits: what the file may ask for.
    :raises BagError: where the file cannot be opened or is no MCAP file.
    """

    def __init__(self, path: str | Path, tolerant: bool = False, limits: Limits = Limits()):
        self.path = Path(path)
        self.limits = limits
        self.problems: list[Problem] = []
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.metadata: list[tuple[str, dict[str, str]]] = []
        self.profile = ''
        self.end = 0  # [B] where the walk has seen the end of the data section
        self.crc = 0  # of the data section, 0 where the file has none
        self._tolerant = tolerant
        self._given_up = False
        self._text = 0
        self._stream: BinaryIO = open_plain(self.path, limits)
        self._size = os.fstat(self._stream.fileno()).st_size
        self.summary = read_summary(self._read, self._size, limits)
        self.schemas.update(self.summary.schemas)
        self.channels.update(self.summary.channels)
        self._chunked = bool(self.summary.lengths)
        self._loader = self._make_loader()

    def __enter__(self) -> Self:
        """Return the file."""
        return self

    def __exit__(self, *exception: object) -> None:
        """Close the file."""
        self._loader.close()
        self._stream.close()

    def _make_loader(self) -> Loader:
        listed = (
            {}
            if self.summary.moved
            else {
                at + HEAD.size: length - HEAD.size for at, length in self.summary.lengths.items()
            }
        )
        return Loader(self._stream.fileno(), self.limits, listed)

    def _read(self, at: int, size: int) -> bytes:
        return os.pread(self._stream.fileno(), size, at)

    def read_bytes(self, at: int, size: int) -> bytes:
        """Return raw bytes of the file, fewer at its end."""
        return self._read(at, size)

    def problem(self, offset: int, text: str) -> None:
        """Note damage, or raise it where it is not tolerated; a search may meet it twice."""
        if self.problems and self.problems[-1] == (offset, text):
            return
        if not self._tolerant:
            raise BagError(f'{text} (at byte {offset}); see verify and recover', self.path)
        if len(self.problems) < self.limits.problems:
            self.problems.append(Problem(offset, text))
        elif not self._given_up:
            self._given_up = True
            self.problems.append(Problem(offset, 'too many damaged places: the rest is left'))

    def chunks(self) -> Iterator[tuple[int, NDArray[np.uint8]]]:
        """
        Yield the records of chunks in file order, each with the place of the chunk.

        Messages outside of chunks are put together. The bytes are to be used until the next ones.

        :raises BagError: at damage, unless it is tolerated.
        """
        loose: list[bytes] = []
        size = 0
        for at, found in self._records():
            if found.op == Op.MESSAGE:
                loose.append(record(found.op, found.content))
                size += len(loose[-1])
                if size < LOOSE:
                    continue
            if loose:
                yield at, np.frombuffer(bytearray().join(loose), np.uint8)
                loose, size = [], 0
            if found.op == Op.CHUNK:
                yield at, found.chunk
        if loose:
            yield self._size, np.frombuffer(bytearray().join(loose), np.uint8)

    def batches(self) -> Iterator[Batch]:
        """
        Yield the messages chunk by chunk in file order.

        :raises BagError: at damage, unless it is tolerated.
        """
        for at, data in self.chunks():
            batch = self.index(data, at)
            if len(batch.starts):
                yield batch

    def _records(self) -> Iterator[tuple[int, '_Found']]:
        """Yield chunks and messages of the data section; take note of everything else."""
        at = 0
        if self._read(0, len(MAGIC)) == MAGIC:
            at = len(MAGIC)
        else:
            self.problem(0, 'does not start as an MCAP file')
        doubtful = None  # the record before, where nothing vouches for its length
        self._loader.close()
        self._loader = self._make_loader()
        while at < self._size and not self._given_up:
            try:
                found = self._record(at)
            except BagError as error:
                self.problem(at, error.reason)
                following = self._search((at if doubtful is None else doubtful) + 1)
                if following is None:
                    return
                at, doubtful = following, None
                continue
            if found.op in (Op.DATA_END, Op.FOOTER):
                self.end, self.crc = at, int.from_bytes(found.content[:4], 'little')
                return
            if found.op < 0x80 or doubtful is None:
                doubtful = at
            if found.op in (Op.CHUNK, Op.MESSAGE):
                yield at, found
                doubtful = None
            at += HEAD.size + found.length
        if not self._given_up:
            self.problem(at, 'ends without a footer: the recording was not closed')

    def _record(self, at: int) -> '_Found':
        """Read the record at a place; raise where there is none."""
        begin = self._read(at, HEAD.size + BEGIN)
        if len(begin) < HEAD.size:
            raise BagError('ends in the middle of a record')
        op, length = HEAD.unpack_from(begin)
        content = begin[HEAD.size :][:length]
        if op == Op.CHUNK and not self._chunked:
            self._chunked = well_formed(Op.CHUNK, content, length)
        if at + HEAD.size + length > self._size:
            raise BagError('ends in the middle of a record, or the record is damaged')
        if length > self.limits.record:
            raise BagError(f'a record of {length} bytes is beyond the limit')
        if op >= 0x80:
            return _Found(op, length)  # private records are none of our business
        if not 0 < op < 0x10:
            raise BagError(f'there is no record type {op:#x}')
        op = Op(op)
        if op == Op.CHUNK:
            chunk = self._loader.load(at + HEAD.size, length)
            return _Found(op, length, chunk=chunk)
        if op in _PARSED and length > BEGIN:
            content = self._read(at + HEAD.size, length)
        if not well_formed(op, content, length):
            raise BagError(f'the {op.name} record is damaged')
        self._note(op, content)
        return _Found(op, length, content)

    def _note(self, op: Op, content: bytes) -> None:
        if op in (Op.SCHEMA, Op.CHANNEL):
            self._text += len(content)
            if self._text > self.limits.text:
                raise BagError('the schemas and channels are beyond the limit')
        if op == Op.HEADER:
            self.profile = Fields(content).string()
        elif op == Op.SCHEMA:
            schema = parse_schema(content)
            self.schemas.setdefault(schema.id, schema)  # the summary has a CRC, this has not
        elif op == Op.CHANNEL:
            channel = parse_channel(content)
            self.channels.setdefault(channel.id, channel)
        elif op == Op.METADATA:
            self.metadata.append(parse_metadata(content))

    def index(self, data: NDArray[np.uint8], at: int) -> Batch:
        """
        Find the messages of a chunk; take note of schemas and channels.

        :param data: its records.
        :param at: place of the chunk.
        :raises BagError: at damage, unless it is tolerated.
        """
        most = len(data) // kernels.BODY_AT + 1
        channels, starts = np.empty(most, np.uint16), np.empty(most, np.int64)
        sizes, others = np.empty(most, np.int64), np.empty(1 << 17, np.int64)
        words = kernels.words(data)
        n, k, end = kernels.index(words, len(data), channels, starts, sizes, others)
        for place in others[:k].tolist():
            op, length = HEAD.unpack_from(data, place)
            content = data[place + HEAD.size : place + HEAD.size + length].tobytes()
            try:
                self._note(Op(op), content)
            except BagError as error:
                self.problem(at, error.reason)
        if end != len(data):
            self.problem(at, 'a chunk ends in the middle of a record')
        return Batch(data, words, channels[:n], starts[:n], sizes[:n], at)

    def _search(self, at: int) -> int | None:
        """Find the next place where records follow each other again."""
        window = 1 << 12
        while at < self._size:
            data = self._read(at, window + HEAD.size)
            for match in _HEAD_PATTERN.finditer(data):
                if self._chain(at + match.start()):
                    return at + match.start()
            at += window
            window = min(4 * window, LOOSE)
        return None

    def _chain(self, at: int, links: int = 3) -> bool:
        """
        Tell whether whole records follow each other from here.

        Where there are chunks, what looks like a message is a piece of a damaged one: compression
        may leave it as it was.
        """
        if self._chunked and self._read(at, 1)[0] == Op.MESSAGE:
            return False
        for _ in range(links):
            begin = self._read(at, HEAD.size + BEGIN)
            if len(begin) < HEAD.size:
                return False
            op, length = HEAD.unpack_from(begin)
            end = at + HEAD.size + length
            if not 0 < op < 0x10 or length > self.limits.record or end > self._size:
                return False
            if not well_formed(Op(op), begin[HEAD.size :][:length], length):
                return False
            if op == Op.FOOTER or end == self._size:
                return True
            at = end
        return True


_PARSED = (Op.HEADER, Op.SCHEMA, Op.CHANNEL, Op.MESSAGE, Op.METADATA)
