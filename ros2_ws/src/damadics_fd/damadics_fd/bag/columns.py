# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Read a topic of a bag as columns, by whole chunks instead of message by message.

>>> from damadics_fd.bag import read_columns
>>> columns = read_columns('bags/friction', '/measurement', ['cv', 'x1'])  # doctest: +SKIP
>>> sorted(columns)                                                        # doctest: +SKIP
['cv', 'log_time', 'stamp', 'x1']
"""

import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag import kernels
from damadics_fd.bag.cdr import Layout, Place, layout_of
from damadics_fd.bag.definition import Definition, parse_definition
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.reader import Batch, McapFile
from damadics_fd.bag.sources import bag_files

Columns = dict[str, NDArray[Any]]
MOST_LAYOUTS = 64  # in one chunk, that are looked for by column
_ELEMENT = re.compile(r'\.\d+(\.|$)')  # a member of a sequence of messages: no column


def read_columns(
    path: str | Path, topic: str = '/measurement', fields: Sequence[str] | None = None, *,
    on_problem: Callable[[str], None] | None = None, limits: Limits = Limits(),  # noqa: B008
) -> Columns:
    """
    Read one topic of a bag.

    :param path: MCAP file or bag directory.
    :param topic: name of the topic.
    :param fields: fields to read; None for all that are numbers. Members of members have dotted
        names, `frame_id` is that of the header.
    :param on_problem: told each damaged place, which is then left out; None makes it an error.
    :param limits: what the file may ask for.
    :return: `log_time` and, where the message has a header, `stamp` (int64, ns); the fields by
        name in the type of the message, times as int64 [ns], arrays as rows of a matrix. All in
        the order of the file.
    :raises BagError: where the bag cannot be read, lacks the topic or a field.
    """
    parts = list(iter_columns(path, topic, fields, on_problem=on_problem, limits=limits))
    names = parts[0].keys()
    if len(parts) == 1:
        return parts[0]
    return {name: _join([part[name] for part in parts if name in part]) for name in names}


def _join(arrays: list[NDArray]) -> NDArray:
    if len({array.shape[1:] for array in arrays}) > 1:
        arrays = [_rows(array) for array in arrays]
    return np.concatenate(arrays)


def _rows(array: NDArray) -> NDArray:
    rows = np.empty(len(array), object)
    rows[:] = list(array)
    return rows


def iter_columns(
    path: str | Path, topic: str = '/measurement', fields: Sequence[str] | None = None, *,
    on_problem: Callable[[str], None] | None = None, limits: Limits = Limits(),  # noqa: B008
) -> Iterator[Columns]:
    """
    Read one topic of a bag chunk by chunk, in memory that does not grow with the bag.

    Parameters as for `read_columns`.

    :return: the columns of each chunk, at least once.
    :raises BagError: as `read_columns`.
    """
    topic = '/' + topic.lstrip('/')
    seen: set[str] = set()
    empty: Columns | None = None
    delivered = False
    for file in bag_files(path):
        with McapFile(file, on_problem is not None, limits) as mcap:
            decoders: dict[int, Decoder] = {}
            for batch in mcap.batches():
                for channel in mcap.channels.values():
                    if channel.topic == topic and channel.id not in decoders:
                        decoders[channel.id] = Decoder(mcap, channel.id, fields)
                for number, decoder in decoders.items():
                    rows = batch.starts[batch.channels == number]
                    if len(rows):
                        delivered = True
                        yield decoder.decode(batch, rows, batch.sizes[batch.channels == number])
            seen |= {channel.topic for channel in mcap.channels.values()}
            if on_problem:
                for problem in mcap.problems:
                    on_problem(f'{file}: {problem.text} (at byte {problem.offset})')
            for channel in mcap.channels.values():
                if channel.topic == topic:
                    empty = Decoder(mcap, channel.id, fields).empty()
    if not delivered:
        if empty is None:
            raise BagError(
                f'has no topic {topic}; it has {", ".join(sorted(seen)) or "none"}', path
            )
        yield empty


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
            and place.dtype in ('f8', 'i8', 'u8') and place.repeat is None
        ]
        if wide:
            out = np.empty((len(wide), len(starts)), np.uint64)
            kernels.gather8(data, starts, np.array([p.offset for p in wide], np.int64), out)
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
    kernels.gather8(data, starts, np.array([-16], np.int64), out)
    return out[0].view(np.int64)


def _ordered(words: NDArray, order: str) -> NDArray:
    return words if order == '<' else words.byteswap()


def _stamp(data: NDArray, starts: NDArray, offset: int, order: str) -> NDArray[np.int64]:
    out = np.empty(len(starts), np.int64)
    if order == '<':
        kernels.gather_stamp(data, starts, offset, out)
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
                kernels.gather8(data, starts, np.array([at], np.int64), out[i:i + 1])
            else:
                (kernels.gather4 if size == 4 else kernels.gather2)(data, starts, at, out[i])
        out = np.ascontiguousarray(_ordered(out, order).T)
    values = out.view(place.dtype)
    return values[:, 0] if place.repeat is None else values


def _merge(groups: list[tuple[NDArray, Columns]]) -> Columns:
    """Put the messages of several layouts back in order."""
    order = np.argsort(np.concatenate([np.flatnonzero(rows) for rows, _ in groups]))
    names = [name for name in groups[0][1] if all(name in part for _, part in groups)]
    return {name: _join([part[name] for _, part in groups])[order] for name in names}
