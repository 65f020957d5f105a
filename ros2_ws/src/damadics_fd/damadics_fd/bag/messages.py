# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A file of messages, whatever its format: schemas, channels, and messages chunk by chunk."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.batch import MESSAGE_HEAD, Batch
from damadics_fd.bag.cdr import kernels
from damadics_fd.bag.compressed import Unpacker, is_compressed
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.mcap.records import HEAD, Channel, Op, Schema, parse_channel, parse_schema

Kind = TypeVar('Kind', Schema, Channel)


class Problem(NamedTuple):
    """A damaged place."""

    offset: int
    text: str


class MessageFile(ABC):
    """
    One file of messages, read by chunk.

    :param path: the file.
    :param tolerant: read on behind damage and collect it in `problems`; otherwise it is an error.
    :param limits: what the file may ask for.
    """

    unit = 'byte'  # in which places are told

    def __init__(self, path: str | Path, tolerant: bool, limits: Limits):
        self.path = Path(path)
        self.limits = limits
        self.problems: list[Problem] = []
        self.remarks: list[str] = []
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.profile = ''
        self._tolerant = tolerant
        self._given_up = False
        self._text = 0
        self._once: set[str] = set()
        size = self.path.stat().st_size if self.path.is_file() else 0
        self._unpack = Unpacker(limits, size)
        self.walked = 0  # fields looked at one by one, because messages differ
        self.most_walked = limits.walked + limits.walked_ratio * size

    def __enter__(self) -> Self:
        """Return the file."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the file."""
        self.close()

    @abstractmethod
    def close(self) -> None:
        """Close the file."""

    @property
    def attachments(self) -> int:
        """Attachments read so far."""
        return 0

    @property
    @abstractmethod
    def stated(self) -> Mapping[int, int]:
        """Messages by channel, as the file says without being read; empty where it does not."""

    @abstractmethod
    def chunks(self) -> Iterator[tuple[int, NDArray[np.uint8]]]:
        """
        Yield the records of chunks in file order, each with the place of the chunk.

        The bytes are to be used until the next ones. What the file as a whole lacks is told at
        the end.

        :raises BagError: at damage, unless it is tolerated.
        """

    def check_batch(self, batch: Batch) -> None:
        """Check what the file says about a chunk besides the chunk itself."""
        return

    @abstractmethod
    def check(self) -> None:
        """
        Check, once it has been read to its end, what reading alone does not.

        :raises BagError: at damage, unless it is tolerated.
        """

    def batches(self) -> Iterator[Batch]:
        """
        Yield the messages chunk by chunk in file order.

        :raises BagError: at damage, unless it is tolerated.
        """
        for at, data in self.chunks():
            batch = self.index(data, at)
            if len(batch.starts):
                yield batch

    def problem(self, offset: int, text: str) -> None:
        """Note damage, or raise it where it is not tolerated; a search may meet it twice."""
        if self.problems and self.problems[-1] == (offset, text):
            return
        if not self._tolerant:
            raise BagError(f'{text} (at {self.unit} {offset}); see verify and recover', self.path)
        if len(self.problems) < self.limits.problems:
            self.problems.append(Problem(offset, text))
        elif not self._given_up:
            self._given_up = True
            self.problems.append(Problem(offset, 'too many damaged places: the rest is left'))

    def told(self) -> list[str]:
        """Return the problems as text."""
        return [f'{self.path}: {text} (at {self.unit} {offset})' for offset, text in self.problems]

    def index(self, data: NDArray[np.uint8], at: int) -> Batch:
        """
        Find the messages of a chunk; take note of schemas and channels.

        :param data: its records.
        :param at: place of the chunk.
        :raises BagError: at damage, unless it is tolerated.
        """
        most = min(len(data) // kernels.BODY_AT + 1, self.limits.messages)
        channels, starts = np.empty(most, np.uint16), np.empty(most, np.int64)
        sizes, others = np.empty(most, np.int64), np.empty(1 << 17, np.int64)
        words = kernels.words(data)
        n, k, end = kernels.index(words, len(data), channels, starts, sizes, others)
        for place in others[:k].tolist():
            op, length = HEAD.unpack_from(data.data, place)
            content = data[place + HEAD.size : place + HEAD.size + length].tobytes()
            try:
                self.note_record(Op(op), content)
            except BagError as error:
                self.problem(at, error.reason)
        if n == most and end != len(data):
            self.problem(at, f'a chunk holds more than {most} messages: the rest of it is left')
        elif end != len(data):
            self.problem(at, 'a chunk ends in the middle of a record')
        places = starts[:n] - MESSAGE_HEAD
        batch = Batch(data, words, channels[:n], starts[:n], sizes[:n], at, places)
        return self._plain(batch) if n and is_compressed(batch.beginning(0)) else batch

    def _plain(self, batch: Batch) -> Batch:
        """Decompress messages that are compressed one by one; those that cannot be are told."""
        kept: list[int] = []
        parts: list[bytes] = []
        told: list[str] = []
        total = 0
        for row, place in enumerate(batch.places.tolist()):
            try:
                message = self._unpack(batch.message(row))
                if total + len(message) > self.limits.chunk:
                    raise BagError('a chunk of compressed messages is beyond the limit')
            except BagError as error:
                told.append(error.reason)
                continue
            total += len(message)
            kept.append(row)
            head = HEAD.pack(Op.MESSAGE, MESSAGE_HEAD - HEAD.size + len(message))
            rest = batch.data[place + HEAD.size : place + MESSAGE_HEAD].tobytes()
            parts += [head + rest, message]
        if told:
            self.problem(batch.offset, f'{len(told)} messages are lost: {told[0]}')
        data = np.frombuffer(bytearray().join(parts) or bytearray(1), np.uint8)
        sizes = np.array([len(part) for part in parts[1::2]], np.int64)
        ends = np.cumsum(sizes + MESSAGE_HEAD)
        rows = np.array(kept, np.int64)
        return Batch(
            data,
            kernels.words(data),
            batch.channels[rows],
            ends - sizes,
            sizes,
            batch.offset,
            batch.places[rows],
        )

    def note_record(self, op: Op, content: bytes) -> None:
        """
        Take note of a Schema or Channel record; the first of each number counts.

        :raises BagError: where it is damaged or contradicts the first.
        """
        if len(content) > self.limits.text:
            raise BagError(f'a {op.name} record of {len(content)} bytes is beyond the limit')
        if op == Op.SCHEMA:
            schema = parse_schema(content)
            # the schema number zero means none, and is to be ignored
            if schema.id and self._is_new(schema.id, schema, self.schemas, len(content)):
                self.schemas[schema.id] = schema
        elif op == Op.CHANNEL:
            channel = parse_channel(content)
            if len(self.channels) >= self.limits.channels and channel.id not in self.channels:
                self.once(f'there are more than {self.limits.channels} channels: the rest is left')
            elif self._is_new(channel.id, channel, self.channels, len(content)):
                self.channels[channel.id] = channel

    def _is_new(self, number: int, found: Kind, known: Mapping[int, Kind], size: int) -> bool:
        """Tell whether a record is to be kept."""
        if number not in known:
            return self.room(size)
        if known[number] != found:
            name = type(found).__name__.lower()
            raise BagError(f'the {name} {number} is there twice and differs')
        return False

    def room(self, size: int) -> bool:
        """Count bytes of text, all of which is kept in memory; tell whether they are too many."""
        self._text += size
        if self._text > self.limits.text:
            self.once('the schemas, channels and metadata are beyond the limit: the rest is left')
        return self._text <= self.limits.text

    def once(self, text: str) -> None:
        """Note damage that many places of the file share."""
        if text not in self._once:
            self._once.add(text)
            self.problem(0, text)

    def topic_counts(self, counts: Mapping[int, int], one_text: bool = False) -> None:
        """
        Compare messages that were read with what the file states.

        :param counts: messages read, by channel; channels that are not in it are not compared.
        :param one_text: add it to the damage that was told last, where there is such.
        :raises BagError: where they differ, unless damage is tolerated.
        """
        for number, count in counts.items():
            stated = self.stated.get(number, 0 if self.stated else count)
            if stated == count:
                continue
            known = self.channels.get(number)
            topic = known.topic if known else f'channel {number}'
            what = 'are left' if count < stated else 'are there: some are doubled'
            text = f'{topic}: {count} of {stated} messages {what}'
            if one_text and self.problems:
                last = self.problems.pop()
                text = f'{last.text}; {text}'
                self.problems.append(Problem(last.offset, text))
            else:
                self.problem(0, text)
