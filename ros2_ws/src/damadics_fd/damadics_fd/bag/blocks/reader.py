# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Blocks of measurements of many valves, as columns of rows.

>>> from damadics_fd.bag import read_columns
>>> columns = read_columns('fleet.mcap', '/measurement_block', valve='/lv101')  # doctest: +SKIP
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.arrays import Column, Columns
from damadics_fd.bag.blocks.layouts import Layouts, Told, layout_topic, read_layouts
from damadics_fd.bag.columns import iter_columns, listing
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.limits import Limits
from damadics_fd.core.sample import SIGNALS

TIMES = ('stamp', 'log_time')
ROW_FIELDS = ('valve', 'stamp', *SIGNALS)
FIELDS = ['layout', *ROW_FIELDS]


class BlockReader:
    """
    Read the blocks of a topic.

    :param path: MCAP file, bag directory, SQLite bag.
    :param topic: of the blocks.
    :param on_problem: told what is damaged or odd, which is then left out; None makes it an
        error.
    :param limits: what the files may ask for.
    :raises BagError: where the bag cannot be read, or names no valves.
    """

    def __init__(
        self,
        path: str | Path,
        topic: str = '/measurement_block',
        on_problem: Told | None = None,
        limits: Limits = Limits(),
    ) -> None:
        self.path, self.topic = path, topic
        self._tell, self._limits = on_problem, limits
        self._layouts: Layouts = read_layouts(path, topic, on_problem, limits)
        if not self._layouts:
            raise BagError(
                f'the blocks of {topic} name their valves by number, and there is no list of'
                f' valves: record {layout_topic(topic)} with them',
                path,
            )
        self.tags = {
            name: tag
            for valves in self._layouts.values()
            for name, tag in zip(valves.names, valves.tags, strict=True)
        }
        self.names = tuple(self.tags)  # of all layouts
        number = {name: n for n, name in enumerate(self.names)}
        self._numbers = {
            version: np.array([number[name] for name in valves.names])
            for version, valves in self._layouts.items()
        }
        self._left: Counter[str] = Counter()

    def rows(self) -> Iterator[Columns]:
        """
        Yield the rows of all blocks, chunk by chunk of the file.

        :return: `valve` (index into `names`), `stamp` (int64, ns), `log_time` and the seven
            signals (NaN: not measured), rows in the order of the file.
        :raises BagError: where the bag cannot be read.
        """
        self._left.clear()
        for columns in iter_columns(
            self.path, self.topic, FIELDS, on_problem=self._tell, limits=self._limits
        ):
            rows = self._checked(columns)
            if len(rows['stamp']):
                yield rows
        if self._left and self._tell:
            for text, count in self._left.items():
                self._tell(f'{self.path}: {self.topic}: {text.format(count)}')

    def _leave(self, text: str, count: int) -> None:
        """Note what is left out, `{}` for the number."""
        if not count:
            return
        if not self._tell:
            raise BagError(f'{self.topic}: {text.format(count)}', self.path)
        self._left[text] += count

    def _checked(self, columns: Columns) -> Columns:
        """Return the rows of blocks that can be understood."""
        sizes = {name: _sizes(columns[name]) for name in ROW_FIELDS}
        length = sizes['valve']
        good = sizes['stamp'] == length
        for name in SIGNALS:
            good &= (sizes[name] == length) | (sizes[name] == 0)
        if not good.all():
            self._leave('{} blocks are left: their arrays differ in length', int((~good).sum()))
        rows = {name: _flat(columns[name], good) for name in ('valve', 'stamp')}
        rows['stamp'] = rows['stamp'].astype(np.int64)
        length = length[good]
        for name in SIGNALS:
            rows[name] = _signal(columns[name], sizes[name][good], length, good)
        rows['log_time'] = np.repeat(columns['log_time'][good], length)
        known, rows['valve'] = self._valves(
            np.asarray(columns['layout'])[good].astype(np.int64), length, rows['valve']
        )
        before = known & (rows['stamp'] < 0)
        self._leave('{} rows are left: their stamps lie before time began', int(before.sum()))
        known &= ~before
        return rows if known.all() else {name: column[known] for name, column in rows.items()}

    def _valves(
        self, layout: NDArray[np.int64], length: NDArray[np.int64], index: Column
    ) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
        """Return which rows name a valve, and the numbers of their valves."""
        index = index.astype(np.int64)
        numbers = np.full(len(index), -1)
        version = np.repeat(layout, length)
        for present in np.unique(layout).tolist():
            of_block, of_row = layout == present, version == present
            if present not in self._numbers:
                self._leave(
                    f'{{}} blocks are left: they refer to the layout {present}, which is not in'
                    ' the recording',
                    int((length[of_block] > 0).sum()),
                )
                continue
            known = self._numbers[present]
            inside = of_row & (index >= 0) & (index < len(known))
            numbers[inside] = known[index[inside]]
            self._leave(
                f'{{}} rows are left: they name a valve that the layout {present} of'
                f' {len(known)} valves has not',
                int((of_row & ~inside).sum()),
            )
        return numbers >= 0, numbers


def valve_columns(
    path: str | Path,
    topic: str,
    valve: str,
    fields: Sequence[str] | None,
    on_problem: Told | None,
    limits: Limits = Limits(),
) -> Iterator[Columns]:
    """
    Yield the columns of one valve, as of a topic of its own.

    :param path: as for `BlockReader`, and so are `topic`, `on_problem` and `limits`.
    :param valve: its namespace.
    :param fields: signals to read; None for all seven.
    :return: `stamp`, `log_time` and the signals; at least once, perhaps without rows.
    :raises BagError: where no layout names the valve, or the bag cannot be read.
    """
    wanted = SIGNALS if fields is None else fields
    unknown = [name for name in wanted if name not in (*SIGNALS, *TIMES)]
    if unknown:
        raise BagError(
            f'{topic} has no field {", ".join(unknown)}; it has {", ".join(SIGNALS)}', path
        )
    reader, name = BlockReader(path, topic, on_problem, limits), '/' + valve.strip('/')
    if name not in reader.names:
        raise BagError(f'{topic} has no valve {name}; it has {listing(reader.names)}', path)
    number, delivered = reader.names.index(name), False
    for rows in reader.rows():
        own = rows['valve'] == number
        if own.any():
            delivered = True
            yield {kept: rows[kept][own] for kept in dict.fromkeys((*wanted, *TIMES))}
    if not delivered:
        yield {signal: np.empty(0) for signal in wanted} | {
            time: np.empty(0, np.int64) for time in TIMES
        }


def _sizes(column: Column) -> NDArray[np.int64]:
    """Return the length of the array in each message."""
    if column.ndim > 1:
        return np.full(len(column), column.shape[1])
    return np.array([len(array) for array in column], np.int64)


def _flat(column: Column, rows: NDArray[np.bool_]) -> Column:
    """Return the elements of some messages one after the other."""
    chosen = column[rows]
    if column.ndim > 1:
        return chosen.ravel()
    return np.concatenate(list(chosen)) if len(chosen) else np.empty(0)


def _signal(
    column: Column,
    size: NDArray[np.int64],
    length: NDArray[np.int64],
    good: NDArray[np.bool_],
) -> Column:
    """Return a signal of all rows, NaN where the block has not measured it."""
    values = _flat(column, good).astype(np.float64)
    if len(values) == length.sum():
        return values
    whole = np.full(int(length.sum()), np.nan)
    whole[np.repeat(size > 0, length)] = values
    return whole
