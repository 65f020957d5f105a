# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings as Parquet, with the column names of text tables."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.arrays import Columns
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.mapping import Scale, Source
from damadics_fd.bag.tables.assignment import NANOSECONDS, SECOND, Assignment, assign
from damadics_fd.bag.tables.headers import headers
from damadics_fd.bag.tables.sniff import parse_cell
from damadics_fd.bag.tables.table import ROWS, Table, Told, lacking
from damadics_fd.bag.tables.times import Dates, seconds_of

try:
    import pyarrow
    from pyarrow import compute, parquet
except ImportError:
    pyarrow = None  # told when a file is to be read


VALVE = 'valve'  # column that says whose row it is, where one file holds many valves
MOST_VALVES = 100_000  # of one file


@dataclass(frozen=True)
class ParquetTable(Table):
    """
    One actuator in a Parquet file.

    :param names: all columns of the file.
    :param of_valve: the one whose rows these are, where the file has a column `valve`.
    """

    names: tuple[str, ...] = ()
    of_valve: str | None = None

    @property
    def valve(self) -> str | None:
        """Whose rows these are, where the file has a column that says so."""
        return self.of_valve

    def chunks(self, on_problem: Told) -> Iterator[Columns]:
        """
        Yield the columns in blocks of rows.

        :param on_problem: told of rows without a time, which are left out.
        :raises BagError: where the file is damaged or a column holds no numbers.
        """
        for columns in self._pieces(None if self.valve is None else [self.valve], on_problem):
            columns.pop(VALVE, None)
            yield columns

    def rows(self, valves: Sequence[str], on_problem: Told) -> Iterator[Columns]:
        """
        Yield the rows of several valves, as `BlockReader.rows` does.

        :param valves: their names; rows of others are left out.
        :param on_problem: as for `chunks`.
        :return: `valve` (index into `valves`), `stamp` and the signals.
        :raises BagError: as `chunks`.
        """
        yield from self._pieces(valves, on_problem)

    def _pieces(self, valves: Sequence[str] | None, on_problem: Told) -> Iterator[Columns]:
        signals = self.assignment.signals
        used = {*self.assignment.time, *(use.column for use in signals.values())}
        wanted = {self.names[column] for column in used}
        wanted |= {VALVE} if valves is not None else set()
        row = 0
        try:
            with parquet.ParquetFile(self.path) as file:
                for batch in file.iter_batches(ROWS, columns=sorted(wanted)):
                    row += len(batch)
                    columns: Columns = {}
                    if valves is not None:
                        batch, columns[VALVE] = _of_valves(batch, valves)
                        if not len(batch):
                            continue
                    for name, use in signals.items():
                        columns[name] = use.scale(self._values(batch, use.column))
                    time = _time([self._column(batch, i) for i in self.assignment.time])
                    if pyarrow.types.is_timestamp(time.type) and time.null_count:
                        known = np.array(time.is_valid().to_numpy(zero_copy_only=False), bool)
                        on_problem(
                            f'{self.path}: {time.null_count} rows up to row {row} have no time'
                            ' and are left out'
                        )
                        columns = {name: values[known] for name, values in columns.items()}
                        time = time.drop_null()
                        if not len(time):
                            continue
                    exact = _exact(time, self.assignment.scale == NANOSECONDS)
                    if exact is not None:
                        yield columns | {'stamp': exact}
                        continue
                    stamp = self._stamps(time)
                    kept = self.timed(stamp, columns, f'up to row {row}', on_problem)
                    if kept:
                        yield kept
        except (pyarrow.ArrowException, OSError, ValueError) as error:
            raise BagError(f'cannot be read: {error}', self.path) from error

    def _column(self, batch: 'pyarrow.RecordBatch', column: int) -> 'pyarrow.Array':
        """Return a column by its place in the file: several may have one name."""
        name = self.names[column]
        there = [i for i, other in enumerate(batch.schema.names) if other == name]
        return batch.column(there[self.names[:column].count(name)])

    def _values(self, batch: 'pyarrow.RecordBatch', column: int) -> NDArray[np.float64]:
        """Return a column as numbers, text as a spreadsheet may write them."""
        there = self._column(batch, column)
        if pyarrow.types.is_dictionary(there.type):
            there = there.dictionary_decode()
        try:
            return _numbers(there)
        except pyarrow.ArrowException as error:
            try:
                if not _is_text(there.type):
                    raise ValueError(f'{there.type}') from error
                texts = there.to_pylist()
                return np.array([np.nan if text is None else parse_cell(text) for text in texts])
            except ValueError as other:
                name = self.names[column]
                raise BagError(
                    f'the column {name} holds no numbers: {other}', self.path
                ) from error

    def _stamps(self, time: 'pyarrow.Array') -> NDArray[np.float64]:
        """Return times [ns] that are numbers or text, NaN where there is none."""
        if _is_text(time.type):
            texts = [text or '' for text in time.to_pylist()]
            dates = Dates(texts)
            return np.array([dates(text) if text else np.nan for text in texts], float)
        if pyarrow.types.is_timestamp(time.type):
            whole = time.cast(pyarrow.timestamp('ns', time.type.tz)).cast(pyarrow.int64())
            return _numbers(whole)
        numbers = _numbers(time)
        scale = self.assignment.scale
        if scale is None:
            finite = numbers[np.isfinite(numbers)]
            scale = Scale(seconds_of(float(finite[0])) if len(finite) else 1.0)
        return scale(numbers) * SECOND


def _of_valves(
    batch: 'pyarrow.RecordBatch', valves: Sequence[str]
) -> tuple['pyarrow.RecordBatch', NDArray[np.int64]]:
    """Return the rows of some valves, and which of them each is of."""
    names = batch.column(VALVE)
    if pyarrow.types.is_dictionary(names.type):
        names = names.dictionary_decode()
    names = names.cast(pyarrow.string())
    found = compute.index_in(names, pyarrow.array(valves, pyarrow.string()))
    number = np.array(compute.fill_null(found, -1).to_numpy(zero_copy_only=False), np.int64)
    own = number >= 0
    return (batch if own.all() else batch.filter(pyarrow.array(own))), number[own]


def _is_text(kind: 'pyarrow.DataType') -> bool:
    types = pyarrow.types
    return bool(types.is_string(kind) or types.is_large_string(kind) or types.is_string_view(kind))


def _time(columns: Sequence['pyarrow.Array']) -> 'pyarrow.Array':
    """Return one column of times: text, numbers or timestamps; of a date and a time of day."""
    types, parts = pyarrow.types, []
    for column in columns:
        if types.is_dictionary(column.type):
            column = column.dictionary_decode()
        if _is_text(column.type):
            column = column.cast(pyarrow.string())
        elif types.is_date(column.type):
            column = column.cast(pyarrow.timestamp('ns'))
        elif types.is_time(column.type) or types.is_duration(column.type):
            of = pyarrow.time64 if types.is_time(column.type) else pyarrow.duration
            column = column.cast(of('ns')).cast(pyarrow.int64()).cast(pyarrow.timestamp('ns'))
        parts.append(column)
    if len(parts) == 1:
        return parts[0]
    if any(_is_text(part.type) for part in parts):
        day, clock = (
            compute.strftime(part, form) if types.is_timestamp(part.type) else part
            for part, form in zip(parts, ('%Y-%m-%d', '%H:%M:%S'), strict=True)
        )
        return compute.binary_join_element_wise(day, clock, ' ')
    total = compute.add(*(part.cast(pyarrow.int64()) for part in parts))
    return total.cast(pyarrow.timestamp('ns'))


def _exact(time: 'pyarrow.Array', is_stamp: bool) -> NDArray[np.int64] | None:
    """Return stamps [ns] without a detour through floating point, None where they are none."""
    if is_stamp and pyarrow.types.is_integer(time.type) and not time.null_count:
        return np.array(time.cast(pyarrow.int64()).to_numpy(zero_copy_only=False), np.int64)
    if not pyarrow.types.is_timestamp(time.type) or time.null_count:
        return None
    whole = time.cast(pyarrow.timestamp('ns', time.type.tz)).cast(pyarrow.int64())
    return np.array(whole.to_numpy(zero_copy_only=False), np.int64)


def _numbers(column: 'pyarrow.Array') -> NDArray[np.float64]:
    """Return a column as numbers, NaN where it has none."""
    values = column.cast(pyarrow.float64(), safe=False).to_numpy(zero_copy_only=False)
    return np.array(values, np.float64)


def read_parquet(path: Path, actuator: int | None, chosen: Mapping[str, Source]) -> list[Table]:
    """Find the actuators in a Parquet file, as `read_table` does."""
    if pyarrow is None:
        raise BagError('Parquet needs pyarrow: pip install pyarrow', path)
    try:
        schema = parquet.read_schema(path)
    except (pyarrow.ArrowException, OSError) as error:
        raise BagError(f'cannot be read as Parquet: {error}', path) from error
    names = tuple(schema.names)
    titles = headers(names)
    try:
        found = assign(titles, actuator, chosen)
    except BagError as error:
        raise BagError(error.reason, path) from error
    dates = [i for i, field in enumerate(schema) if pyarrow.types.is_timestamp(field.type)]
    tables: list[Table] = []
    valves: list[str | None] = [*_valves(path, schema)] if VALVE in names else [None]
    for name, assignment in found.items():
        time = assignment.time or tuple(dates[:1])
        if time:
            placed = Assignment(assignment.signals, time, assignment.scale)
            tables += [ParquetTable(path, v or name, placed, names, v) for v in valves]
    if not tables:
        raise lacking(path, list(names))
    return tables


def _valves(path: Path, schema: 'pyarrow.Schema') -> list[str]:
    """List the valves that the rows of a file name, in the order of their first rows."""
    kind = schema.field(VALVE).type
    kind = kind.value_type if pyarrow.types.is_dictionary(kind) else kind
    if not (pyarrow.types.is_string(kind) or pyarrow.types.is_large_string(kind)):
        raise BagError(f'the column {VALVE} holds no names: {kind}', path)
    found: dict[str, None] = {}
    unnamed = 0
    try:
        with parquet.ParquetFile(path) as file:
            for batch in file.iter_batches(ROWS, columns=[VALVE]):
                unnamed += batch.column(VALVE).null_count
                found |= dict.fromkeys(n for n in batch.column(VALVE).unique().to_pylist() if n)
                if len(found) > MOST_VALVES:
                    raise BagError(f'names more than {MOST_VALVES} valves', path)
    except (pyarrow.ArrowException, OSError, ValueError) as error:
        raise BagError(f'cannot be read: {error}', path) from error
    if unnamed or not found:
        raise BagError(f'{unnamed} rows name no valve: fill the column {VALVE}', path)
    return list(found)
