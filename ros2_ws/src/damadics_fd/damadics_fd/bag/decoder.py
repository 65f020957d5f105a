# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Decode the messages of one channel to columns."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag import kernels
from damadics_fd.bag.cdr import Layout, Place, layout_of
from damadics_fd.bag.definition import Definition, parse_definition
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.reader import Batch, McapFile

Columns = dict[str, NDArray[Any]]
WIDE = ('f8', 'i8', 'u8')
LOG_TIME = -16  # [B] its place, counted from the data of a message
MOST_LAYOUTS = 64  # in one chunk, that are looked for by column
_ELEMENT = re.compile(r'\.\d+(\.|$)')  # a member of a sequence of messages: no column


class Decoder:
    """
    Decode the messages of one channel to columns.

    :param mcap: file of the channel.
    :param number: number of the channel.
    :param fields: fields to read, None for all that are numbers.
    :raises BagError: where the messages are not CDR of a known definition.
    """

    def __init__(self, mcap: McapFile, number: int, fields: Sequence[str] | None):
        channel = mcap.channels[number]
        schema = mcap.schemas.get(channel.schema_id)
        self._mcap, self._number = mcap, number
        self.path, self.topic, self.fields = mcap.path, channel.topic, fields
        if channel.message_encoding != 'cdr':
            raise BagError(f'{channel.topic} is encoded as {channel.message_encoding!r}, not as'
                           ' cdr', mcap.path)
        if schema is None or schema.encoding != 'ros2msg':
            raise BagError(f'{channel.topic} has no ros2msg definition', mcap.path)
        self.kind = schema.name
        try:
            text = schema.data.decode()
            self.definition: Definition = parse_definition(schema.name, text)
        except (BagError, UnicodeDecodeError) as error:
            raise BagError(f'{channel.topic}: {error}', mcap.path) from error
        self._layouts: list[Layout] = []

    def empty(self) -> Columns:
        """Return columns of no messages."""
        names = self.fields or [m.name for m in self.definition[self.kind] if m.name != 'header']
        return {name: np.empty(0) for name in names} | {
            name: np.empty(0, np.int64) for name in ('stamp', 'log_time')
        }

    def decode(self, batch: Batch, starts: NDArray, sizes: NDArray) -> Columns:
        """
        Decode messages of this channel.

        :param batch: chunk that holds them.
        :param starts: places of the messages in it.
        :param sizes: their sizes.
        :return: the columns.
        :raises BagError: where a message does not follow its definition or lacks a field.
        """
        left = np.ones(len(starts), bool)
        groups: list[tuple[NDArray, Columns]] = []
        while left.any():
            first = int(left.argmax())
            layout = self._layout(batch, int(starts[first]), int(sizes[first]))
            if len(groups) < MOST_LAYOUTS:
                rows = left & (sizes == sizes[first])
                if layout.lengths or not rows.all():
                    rows[rows] = same_layout(batch.data, starts[rows], layout)
            else:
                rows = np.zeros(len(left), bool)
            rows[first] = True
            groups.append((rows, self._columns(batch.data, starts[rows], layout)))
            left &= ~rows
        columns = groups[0][1] if len(groups) == 1 else _merge(groups)
        columns['log_time'] = log_times(batch.data, starts)
        return columns

    def decode_all(self, total: int) -> Columns | None:
        """
        Decode the whole file where all messages have one layout and only 64-bit fields are read.

        :param total: number of messages.
        :return: the columns, None where it is not so.
        :raises BagError: where the file is damaged.
        """
        block = np.empty((0, 0), np.uint64)
        layout: Layout | None = None
        done = 0
        for batch in self._mcap.batches():
            count, size = kernels.select(batch.channels, batch.starts, batch.sizes, self._number)
            starts = batch.starts[:count]
            if not count:
                continue
            if layout is None:
                layout = self._layout(batch, int(starts[0]), int(size))
                places = self._places(layout)
                stamps = [name for name, place in places.items() if isinstance(place, int)]
                wide = [p for p in places.values() if isinstance(p, Place)]
                if layout.order != '<' or any(
                    p.dtype not in WIDE or p.repeat is not None for p in wide
                ):
                    return None
                names = [n for n in places if n not in stamps] + ['log_time', *stamps]
                block = np.empty((len(names), total), np.uint64)
                offsets = np.array([*(p.offset for p in wide), LOG_TIME], np.int64)
            if not layout.size <= size <= layout.size + 3 or done + count > total or (
                not same_layout(batch.data, starts, layout).all()
            ):
                return None
            kernels.gather8(batch.data, starts, offsets, block, done)
            for row, name in enumerate(stamps, len(offsets)):
                place = places[name]
                assert isinstance(place, int)
                kernels.gather_stamp(batch.data, starts, place, block[row].view(np.int64), done)
            done += count
        if done != total:
            return None
        kinds = [place.dtype for place in wide]
        return {
            name: block[row].view(kinds[row] if row < len(kinds) else np.int64)
            for row, name in enumerate(names)
        }

    def _layout(self, batch: Batch, start: int, size: int) -> Layout:
        message = batch.data[start:start + size]
        for layout in self._layouts:
            here = np.zeros(1, np.int64)
            if layout.size <= size <= layout.size + 3 and same_layout(message, here, layout)[0]:
                return layout
        try:
            layout = layout_of(self.definition, self.kind, message.tobytes())
        except BagError as error:
            raise BagError(f'{self.topic}: {error.reason}', self.path) from error
        self._layouts = [*self._layouts[-MOST_LAYOUTS:], layout]
        return layout

    def _columns(self, data: NDArray, starts: NDArray, layout: Layout) -> Columns:
        places = self._places(layout)
        columns: Columns = {}
        wide = [
            place for place in places.values() if isinstance(place, Place)
            and place.dtype in WIDE and place.repeat is None
        ]
        if wide:
            out = np.empty((len(wide), len(starts)), np.uint64)
            kernels.gather8(data, starts, np.array([p.offset for p in wide], np.int64), out, 0)
            values = dict(zip((p.name for p in wide), _ordered(out, layout.order), strict=True))
        for name, place in places.items():
            if isinstance(place, int):
                columns[name] = _stamp(data, starts, place, layout.order)
            elif place in wide:
                columns[name] = values[place.name].view(layout.order + place.dtype)
            else:
                columns[name] = _general(data, starts, place, layout.order)
        return columns

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
            elif not (last == 'nanosec' and f'{base}.sec' in by_name):
                found['frame_id' if place.name == 'header.frame_id' else place.name] = place
        if self.fields is None:
            return {
                name: place for name, place in found.items()
                if isinstance(place, int) or not place.text
            }
        missing = [name for name in self.fields if name not in (*found, 'log_time')]
        if missing:
            raise BagError(
                f'{self.topic} ({self.kind}) has no field {", ".join(missing)}; it has '
                + ', '.join(found), self.path,
            )
        chosen = [*self.fields, *(['stamp'] if 'stamp' in found else [])]
        return {name: found[name] for name in chosen if name != 'log_time'}


def same_layout(data: NDArray, starts: NDArray, layout: Layout) -> NDArray[np.bool_]:
    """Tell which messages have their fields at the places of a layout."""
    same = np.empty(len(starts), bool)
    offsets = np.array([offset for offset, _ in layout.lengths], np.int64)
    values = np.array([value for _, value in layout.lengths], layout.order + 'u4').view('<u4')
    order = 1 if layout.order == '<' else 0
    kernels.same_layout(data, starts, order, offsets, values, same)
    return same


def log_times(data: NDArray, starts: NDArray) -> NDArray[np.int64]:
    """Return the log times of messages [ns]."""
    out = np.empty((1, len(starts)), np.uint64)
    kernels.gather8(data, starts, np.array([LOG_TIME], np.int64), out, 0)
    return out[0].view(np.int64)


def _ordered(words: NDArray, order: str) -> NDArray:
    return words if order == '<' else words.byteswap()


def _stamp(data: NDArray, starts: NDArray, offset: int, order: str) -> NDArray[np.int64]:
    out = np.empty(len(starts), np.int64)
    if order == '<':
        kernels.gather_stamp(data, starts, offset, out, 0)
        return out
    seconds = _general(data, starts, Place('', 'i4', offset), order)
    return seconds * np.int64(10**9) + _general(data, starts, Place('', 'u4', offset + 4), order)


def _general(data: NDArray, starts: NDArray, place: Place, order: str) -> NDArray:
    """Gather any field: narrow numbers, arrays, strings."""
    if place.text:
        width = place.repeat or 0
        rows = data[starts[:, None] + (place.offset + np.arange(width))]
        return np.char.decode(rows.view(f'S{width}')[:, 0] if width else np.zeros(len(rows), 'S1'),
                              'utf-8', 'replace')
    size = int(place.dtype[1])
    count = 1 if place.repeat is None else place.repeat
    if size == 1:
        out = data[starts[:, None] + (place.offset + np.arange(count))]
    else:
        out = np.empty((count, len(starts)), f'u{size}')
        for i in range(count):
            at = place.offset + i * size
            if size == 8:
                kernels.gather8(data, starts, np.array([at], np.int64), out[i:i + 1], 0)
            else:
                (kernels.gather4 if size == 4 else kernels.gather2)(data, starts, at, out[i])
        out = np.ascontiguousarray(_ordered(out, order).T)
    values = out.view(place.dtype)
    return values[:, 0] if place.repeat is None else values


def _merge(groups: list[tuple[NDArray, Columns]]) -> Columns:
    """Put the messages of several layouts back in order."""
    order = np.argsort(np.concatenate([np.flatnonzero(rows) for rows, _ in groups]))
    names = [name for name in groups[0][1] if all(name in part for _, part in groups)]
    return {name: join([part[name] for _, part in groups])[order] for name in names}


def join(arrays: list[NDArray]) -> NDArray:
    """Put the pieces of a column together; rows of changing length become objects."""
    if len({array.shape[1:] for array in arrays}) > 1:
        arrays = [_rows(array) for array in arrays]
    return np.concatenate(arrays)


def _rows(array: NDArray) -> NDArray:
    rows = np.empty(len(array), object)
    rows[:] = list(array)
    return rows
