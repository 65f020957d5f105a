# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read MCAP files by chunk, whole or damaged."""

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.batch import Batch
from damadics_fd.bag.cdr import kernels
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.mcap.checks import check_extras, check_message_index
from damadics_fd.bag.mcap.crc import crc32
from damadics_fd.bag.mcap.loading import Loader
from damadics_fd.bag.mcap.records import (
    CHUNK,
    HEAD,
    MAGIC,
    Extent,
    Fields,
    Op,
    parse_attachment,
    parse_metadata,
)
from damadics_fd.bag.mcap.search import BEGIN, KNOWN, find_records, follows
from damadics_fd.bag.mcap.summary import read_summary
from damadics_fd.bag.mcap.unpack import open_plain
from damadics_fd.bag.mcap.wellformed import fields_end, well_formed
from damadics_fd.bag.messages import MessageFile

LOOSE = 1 << 20  # [B] handled at a time where there are no chunks
FIRST = 1 << 12  # [B] read for messages of which few may follow each other
BLOCK = 1 << 24  # [B] of the file checked at a time


class _Found(NamedTuple):
    """A record; `chunk` holds those of a chunk, decompressed and checked, or a run of messages."""

    op: int
    length: int
    content: bytes = b''
    chunk: NDArray[np.uint8] = np.empty(0, np.uint8)


class McapFile(MessageFile):
    """
    Read one MCAP file.

    :param path: file, possibly compressed as a whole (`.zstd`).
    :param tolerant: read on behind damage and collect it in `problems`; otherwise it is an error.
    :param limits: what the file may ask for.
    :raises BagError: where the file cannot be opened or is no MCAP file.
    """

    def __init__(self, path: str | Path, tolerant: bool = False, limits: Limits = Limits()):
        super().__init__(path, tolerant, limits)
        self.extras: list[Extent] = []  # attachments and metadata that can be read
        self.end = 0  # [B] where the walk has seen the end of the data section
        self.crc = 0  # of the data section, 0 where the file has none
        self._chunk_places: set[int] = set()
        self._unpacked = 0  # [B] of dense chunks so far
        self._window = LOOSE  # [B] in which the next run of messages is looked for
        self._stream: BinaryIO = open_plain(self.path, limits)
        self._size = os.fstat(self._stream.fileno()).st_size
        self._bounds = self._size, limits.record
        self.summary = read_summary(self.read_bytes, self._size, limits)
        self.schemas.update(self.summary.schemas)
        self.channels.update(list(self.summary.channels.items())[: limits.channels])
        self._chunked = bool(self.summary.chunks)
        self._loader = self._make_loader()

    def close(self) -> None:
        """Close the file."""
        self._loader.close()
        self._stream.close()

    def _make_loader(self) -> Loader:
        chunks = {} if self.summary.moved else self.summary.chunks
        listed = {at + HEAD.size: chunk.length - HEAD.size for at, chunk in chunks.items()}
        return Loader(self._stream.fileno(), self.limits, listed)

    @property
    def attachments(self) -> int:
        """Attachments read so far."""
        return sum(extra.op == Op.ATTACHMENT for extra in self.extras)

    @property
    def stated(self) -> Mapping[int, int]:
        """Messages by channel, as the statistics say; empty where there are none."""
        return self.summary.counts

    def read_bytes(self, at: int, size: int) -> bytes:
        """Return raw bytes of the file, fewer at its end."""
        return os.pread(self._stream.fileno(), size, at) if at < self._size else b''

    def chunks(self) -> Iterator[tuple[int, NDArray[np.uint8]]]:
        """
        Yield the records of chunks in file order, each with the place of the chunk.

        Messages outside of chunks come by the run. The bytes are to be used until the next ones.

        :raises BagError: at damage, unless it is tolerated.
        """
        for at, found in self._records():
            yield at, found.chunk
        self._check_end()

    def _records(self) -> Iterator[tuple[int, _Found]]:
        """Yield chunks and messages of the data section; take note of everything else."""
        at = 0
        self.extras, self._chunk_places, self._unpacked = [], set(), 0
        if self.read_bytes(0, len(MAGIC)) == MAGIC:
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
                following = find_records(
                    self.read_bytes,
                    (at if doubtful is None else doubtful) + 1,
                    *self._bounds,
                    self._chunked,
                )
                if following is None:
                    return
                at, doubtful = following, None
                continue
            if found.op in (Op.DATA_END, Op.FOOTER):
                self.end, self.crc = at, int.from_bytes(found.content[:4], 'little')
                return
            if found.op < KNOWN or doubtful is None:
                doubtful = at
            if found.op == Op.MESSAGE:
                found = self._run(at, found.length)
            if found.op in (Op.CHUNK, Op.MESSAGE):
                yield at, found
                doubtful = None
            at += HEAD.size + found.length
        if not self._given_up:
            self.problem(at, 'ends without a footer: the recording was not closed')

    def _record(self, at: int) -> _Found:
        """Read the record at a place; raise where there is none."""
        begin = self.read_bytes(at, HEAD.size + BEGIN)
        if len(begin) < HEAD.size:
            raise BagError('ends in the middle of a record')
        number, length = HEAD.unpack_from(begin)
        op, content = _OPS.get(number), begin[HEAD.size :]
        if op:
            end, complete = fields_end(op, content)
            sound = complete and end == length
            if not sound:
                length = self._length(op, at, length, end, complete)
                sound = well_formed(op, content, length)
            if op == Op.CHUNK and not self._chunked:
                self._chunked = sound
        content = content[:length]
        if at + HEAD.size + length > self._size:
            raise BagError('ends in the middle of a record, or the record is damaged')
        if number >= KNOWN:
            return _Found(number, length)  # none of our business
        if length > self.limits.record and op != Op.ATTACHMENT:
            raise BagError(f'a record of {length} bytes is beyond the limit')
        if not op:
            raise BagError(f'there is no record type {number:#x}')
        if op == Op.CHUNK:
            return _Found(op, length, chunk=self._chunk(at, length, content))
        if op in _PARSED and length > self.limits.text:
            raise BagError(f'a {op.name} record of {length} bytes is beyond the limit')
        if op in _PARSED and length > BEGIN:
            content = self.read_bytes(at + HEAD.size, length)
            sound = well_formed(op, content, length)
        if not sound:
            raise BagError(f'the {op.name} record is damaged')
        if op in (Op.SCHEMA, Op.CHANNEL):
            self.note_record(op, content)
        elif op == Op.HEADER:
            self.profile = Fields(content).string()
        elif op in (Op.METADATA, Op.ATTACHMENT):
            self._note_extra(op, at, length, content)
        return _Found(op, length, content)

    def _run(self, at: int, length: int) -> _Found:
        """Read messages outside of chunks that follow each other, the first of a given length."""
        while True:
            window = max(self._window, HEAD.size + length)
            data = np.frombuffer(bytearray(self.read_bytes(at, window)), np.uint8)
            end = kernels.messages_end(kernels.words(data), len(data))
            ended = end + HEAD.size <= len(data) and data[end] != Op.MESSAGE
            if ended or window >= LOOSE or len(data) < window:
                break
            self._window = min(16 * self._window, LOOSE)
        if ended:
            self._window = max(FIRST, 1 << (2 * end).bit_length())
        return _Found(Op.MESSAGE, end - HEAD.size, chunk=data[:end])

    def _length(self, op: Op, at: int, stated: int, end: int, complete: bool) -> int:
        """Return the length of a record: by the end of its fields, where others follow these."""
        behind = at + HEAD.size + end
        if end == stated or not complete or not follows(self.read_bytes, behind, *self._bounds):
            return stated
        self.problem(at, f'the length of the {op.name} record is damaged')
        return end

    def _chunk(self, at: int, length: int, content: bytes) -> NDArray[np.uint8]:
        """Load a chunk and compare its head with the index."""
        if length < CHUNK.size:
            raise BagError('the CHUNK record is damaged')
        start, end, size, _ = CHUNK.unpack_from(content)
        limits = self.limits
        dense = size > limits.dense * length
        if dense and self._unpacked + size > limits.total:
            raise BagError(
                f'the chunks unpack to more than {limits.total} bytes: this one is left'
            )
        self._chunk_places.add(at)  # what is wrong with it is told
        chunk = self._loader.load(at + HEAD.size, length)
        self._unpacked += size if dense else 0
        indexed = None if self.summary.moved else self.summary.chunks.get(at)
        if indexed and (indexed.start, indexed.end, indexed.length) != (
            start,
            end,
            HEAD.size + length,
        ):
            self.problem(at, 'the chunk is not the one of the index')
        return chunk

    def _note_extra(self, op: Op, at: int, length: int, content: bytes) -> None:
        if len(self.extras) >= self.limits.attachments:
            self.once(f'there are more than {self.limits.attachments} attachments and metadata')
            return
        if op == Op.ATTACHMENT:
            name = parse_attachment(self.read_bytes, at).name
        else:
            name, _ = parse_metadata(content)
        if self.room(len(name)):
            self.extras.append(Extent(op, at, HEAD.size + length, name))

    def is_intact(self, attachment: Extent) -> bool:
        """Tell whether the CRC of an attachment matches, where it has one."""
        about = parse_attachment(self.read_bytes, attachment.at)
        return not about.crc or self.crc_of(attachment.at + HEAD.size, about.size) == about.crc

    def _check_end(self) -> None:
        """Compare what was read with index and statistics."""
        summary, seen = self.summary, self._chunk_places
        if self.end and not summary.present and not summary.absent:
            self.problem(self.end, 'the summary is missing or damaged')
        if not self.end:
            return  # told already
        if summary.moved:
            self.problem(self.end, 'bytes are missing or were added before the summary')
        indexed = set(summary.chunks)
        lost, added = len(indexed - seen), len(seen - indexed)
        if summary.moved:
            lost, added = max(0, len(indexed) - len(seen)), max(0, len(seen) - len(indexed))
        if lost:
            self.problem(self.end, f'{lost} chunks of the index are lost')
        if added and indexed:
            self.problem(self.end, f'{added} chunks are missing in the index, or doubled')
        if summary.records and summary.records[2] != len(seen) and not lost:
            stated = summary.records[2]
            self.problem(self.end, f'{len(seen)} chunks are there, the statistics say {stated}')
        if not indexed and not summary.counts:
            self.check_crc()  # nothing else tells whether all is there

    def check_crc(self) -> None:
        """Check the CRC of the data section, where it has one."""
        if self.end and self.crc and self.crc_of(0, self.end) != self.crc:
            self.problem(self.end, 'the data section is damaged: its CRC does not match')

    def check_batch(self, batch: Batch) -> None:
        """Compare the messages of a chunk with their index."""
        indexed = None if self.summary.moved else self.summary.chunks.get(batch.offset)
        if indexed:
            check_message_index(self.read_bytes, self.problem, indexed, batch)

    def check(self) -> None:
        """
        Check CRC, attachments and metadata, once the file has been read.

        :raises BagError: at damage, unless it is tolerated.
        """
        self.check_crc()
        for extra in self.extras:
            if extra.op == Op.ATTACHMENT and not self.is_intact(extra):
                self.problem(extra.at, 'an attachment is damaged: its CRC does not match')
        check_extras(self.problem, self.summary, self.extras, self.end)
        if self.end and self.summary.absent:
            self.remarks.append('the file has no summary')

    def crc_of(self, at: int, size: int) -> int:
        """Return the CRC of bytes of the file, read in blocks."""
        crc, end = 0, at + size
        while at < end:
            data = self.read_bytes(at, min(BLOCK, end - at))
            if not data:
                break
            crc = crc32(data, crc)
            at += len(data)
        return crc


_OPS = {int(op): op for op in Op}
_PARSED = (Op.HEADER, Op.SCHEMA, Op.CHANNEL, Op.METADATA)
