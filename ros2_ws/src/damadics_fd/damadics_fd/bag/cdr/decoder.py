# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Decode the messages of one channel to columns."""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.arrays import Column, Columns, Places
from damadics_fd.bag.batch import Batch
from damadics_fd.bag.cdr import kernels
from damadics_fd.bag.cdr.definition import Definition, Member, parse_definition
from damadics_fd.bag.cdr.gathering import field, same_layout, time
from damadics_fd.bag.cdr.groups import Alike, first_message
from damadics_fd.bag.cdr.idl import parse_idl
from damadics_fd.bag.cdr.kernels import LOG_TIME, Words
from damadics_fd.bag.cdr.layout import HEADER_SIZE, Layout, Place, layout_of
from damadics_fd.bag.compressed import is_compressed
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.messages import MessageFile

MOST_LAYOUTS = 64  # in one chunk, that are looked for by column
FEW_LAYOUTS = 8  # of a channel, which cost nothing
MOST_PLACES = 1 << 17  # of the layouts that are remembered
HEADER = Member('header', 'std_msgs/msg/Header', None)
STAMPED = {  # what the types begin with
    'std_msgs/msg/Header': [Member('stamp', 'builtin_interfaces/msg/Time', None)],
    'builtin_interfaces/msg/Time': [
        Member('sec', 'int32', None),
        Member('nanosec', 'uint32', None),
    ],
}
PARSERS = {'ros2msg': parse_definition, 'ros2idl': parse_idl}  # by the encoding of a schema
STAMP_END = HEADER_SIZE + 8  # [B] in a message
_ELEMENT = re.compile(r'\.\d+(\.|$)')  # a member of a sequence of messages: no column


class Decoder:
    """
    Decode the messages of one channel to columns.

    :param mcap: file of the channel.
    :param number: number of the channel.
    :param fields: fields to read, None for all that are numbers.
    :raises BagError: where the messages are not CDR of a known definition.
    """

    def __init__(self, mcap: MessageFile, number: int, fields: Sequence[str] | None):
        channel = mcap.channels[number]
        schema = mcap.schemas.get(channel.schema_id)
        self._mcap, self._number = mcap, number
        self.path, self.topic, self.fields = mcap.path, channel.topic, fields
        if channel.message_encoding != 'cdr':
            raise BagError(
                f'{channel.topic} is encoded as {channel.message_encoding!r}, not as cdr',
                mcap.path,
            )
        if schema is None or schema.encoding not in PARSERS:
            raise BagError(f'{channel.topic} has no {" or ".join(PARSERS)} definition', mcap.path)
        try:
            parse = PARSERS[schema.encoding]
            text = schema.data.decode('utf-8', 'replace').replace('\ufeff', '')
            self.definition: Definition = parse(schema.name, text)
        except BagError as error:
            raise BagError(f'{channel.topic}: {error}', mcap.path) from error
        self.kind = next(iter(self.definition))  # a foreign name may stand in another form
        self._layouts: list[Layout] = []
        self._alike: Alike | None = None

    @property
    def is_costly(self) -> bool:
        """Tell whether its messages have differed so much that each has to be looked at."""
        return len(self._layouts) > FEW_LAYOUTS or self._mcap.walked > self._mcap.limits.walked

    @property
    def is_stamped(self) -> bool:
        """Tell whether the messages begin with `header.stamp`, as ROS defines it."""
        members = self.definition[self.kind][:1]
        return members == [HEADER] and all(
            self.definition[name][: len(wanted)] == wanted for name, wanted in STAMPED.items()
        )

    def stamps(self, batch: Batch, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """
        Return `header.stamp` of messages that begin with it, whatever follows it [ns].

        :param batch: chunk that holds them.
        :param rows: which of its messages.
        :raises BagError: where one is too short for it or no CDR.
        """
        starts, words = batch.starts[rows], batch.words
        if (batch.sizes[rows] < STAMP_END).any():
            raise BagError(f'{self.topic}: a message is shorter than its definition says')
        big = words.w2[starts] == 0
        if not (big | (words.w2[starts] == kernels.PLAIN_CDR)).all():
            raise BagError(f'{self.topic}: a message is not plain CDR')
        return np.where(
            big,
            time(words, starts + HEADER_SIZE, '>'),
            time(words, starts + HEADER_SIZE, '<'),
        )

    def empty(self) -> Columns:
        """Return columns of no messages."""
        names = self.fields or [m.name for m in self.definition[self.kind] if m.name != 'header']
        return {name: np.empty(0) for name in names} | {
            name: np.empty(0, np.int64) for name in ('stamp', 'log_time')
        }

    def decode(self, batch: Batch, starts: Places, sizes: Places) -> Columns:
        """
        Decode messages of this channel.

        :param batch: chunk that holds them.
        :param starts: places of the messages in it.
        :param sizes: their sizes.
        :return: the columns.
        :raises BagError: where a message does not follow its definition or lacks a field.
        """
        left = np.ones(len(starts), bool)
        groups: list[tuple[Places, Columns]] = []
        while left.any():
            first = int(left.argmax())
            layout = self._layout(batch.data[starts[first] : starts[first] + sizes[first]])
            if len(groups) < MOST_LAYOUTS:
                rows = left & (sizes == sizes[first])
                rows[rows] = same_layout(batch.words, starts[rows], layout)
            else:
                rows = np.zeros(len(left), bool)
            rows[first] = True
            columns = self._columns(batch.words, starts[rows], layout)
            groups.append((np.flatnonzero(rows), columns))
            left &= ~rows
        columns = merge(groups)
        columns['log_time'] = batch.words.w8[starts + LOG_TIME].view(np.int64)
        return columns

    def decode_alike(self, data: NDArray[np.uint8]) -> Columns | None:
        """
        Decode a chunk of which all messages of this channel are alike, in one pass.

        :param data: records of the chunk.
        :return: the columns, None where it takes the general way.
        """
        alike = self._alike_in(data)
        if not alike:
            return None
        block = alike.block(len(data) // (alike.size + kernels.BODY_AT))
        count = alike.decode(kernels.words(data), len(data), self._number, block)
        if count < 0:
            self._alike = None
            return None
        whole = 2 * count > block.shape[1]
        return alike.columns(block[:, :count] if whole else block[:, :count].copy())

    def decode_all(self, total: int) -> Columns | None:
        """
        Decode the whole file where all messages are alike.

        :param total: number of messages.
        :return: the columns, None where it takes the general way.
        :raises BagError: where the file is damaged.
        """
        block: NDArray[np.uint64] | None = None
        done = 0
        for _, data in self._mcap.chunks():
            alike = self._alike_in(data)
            if not alike:
                return None
            if block is None:
                block = alike.block(total)
            count = alike.decode(kernels.words(data), len(data), self._number, block, done)
            if count < 0:
                return None
            done += count
        if block is None or not self._alike or done != total:
            return None
        return self._alike.columns(block)

    def _alike_in(self, data: NDArray[np.uint8]) -> Alike | None:
        """Return how to decode messages that are like the first one of a chunk."""
        if not self._alike and (found := first_message(data, self._number)):
            start, size = found
            if is_compressed(data[start : start + 4].tobytes()):
                return None
            layout = self._layout(data[start : start + size])
            self._alike = Alike.of(layout, size, self._places(layout))
        return self._alike

    def _layout(self, message: NDArray[np.uint8]) -> Layout:
        for layout in self._layouts:
            if layout.size <= len(message) <= layout.size + 3 and layout.matches(message[None]):
                return layout
        if self._mcap.walked > self._mcap.most_walked:
            raise BagError(f'{self.topic}: too many messages differ from each other', self.path)
        try:
            layout = layout_of(self.definition, self.kind, message.tobytes())
        except BagError as error:
            raise BagError(f'{self.topic}: {error.reason}', self.path) from error
        self._mcap.walked += len(layout.places)
        self._layouts = [*self._layouts[-MOST_LAYOUTS:], layout]
        while len(self._layouts) > 1 and sum(len(k.places) for k in self._layouts) > MOST_PLACES:
            self._layouts.pop(0)
        return layout

    def _columns(self, words: Words, starts: Places, layout: Layout) -> Columns:
        return {
            name: time(words, starts + place, layout.order)
            if isinstance(place, int)
            else field(words, starts, place, layout.order)
            for name, place in self._places(layout).items()
        }

    def _places(self, layout: Layout) -> dict[str, Place | int]:
        """Choose what to read: places by column name, the bare offset for times."""
        found: dict[str, Place | int] = {}
        by_name = {place.name: place for place in layout.places}
        for place in layout.places:
            if _ELEMENT.search(place.name):
                continue
            base, _, last = place.name.rpartition('.')
            if last == 'sec' and by_name.get(f'{base}.nanosec', place).dtype == 'u4':
                found['stamp' if base == 'header.stamp' else base] = place.offset
            elif place.name == 'stamp' and 'stamp' in found and 'stamp' not in (self.fields or ()):
                continue  # blocks have a field of that name beside header.stamp
            elif not (last == 'nanosec' and f'{base}.sec' in by_name):
                found['frame_id' if place.name == 'header.frame_id' else place.name] = place
        if self.fields is None:
            return {
                name: place
                for name, place in found.items()
                if isinstance(place, int) or not place.text
            }
        missing = [name for name in self.fields if name not in (*found, 'log_time')]
        if missing:
            raise BagError(
                f'{self.topic} ({self.kind}) has no field {", ".join(missing)}; it has '
                + ', '.join(found),
                self.path,
            )
        chosen = [*self.fields, *(['stamp'] if 'stamp' in found else [])]
        return {name: found[name] for name in chosen if name != 'log_time'}


def merge(groups: Sequence[tuple[Places, Columns]]) -> Columns:
    """Put the messages of several layouts or channels, each with their places, back in order."""
    if len(groups) == 1:
        return groups[0][1]
    order = np.argsort(np.concatenate([rows for rows, _ in groups]))
    names = [name for name in groups[0][1] if all(name in part for _, part in groups)]
    return {name: join([part[name] for _, part in groups])[order] for name in names}


def join(arrays: list[Column]) -> Column:
    """Put the pieces of a column together; rows of changing length become objects."""
    if len({array.shape[1:] for array in arrays}) > 1:
        arrays = [_rows(array) for array in arrays]
    return np.concatenate(arrays)


def _rows(array: Column) -> Column:
    rows = np.empty(len(array), object)
    rows[:] = list(array)
    return rows
