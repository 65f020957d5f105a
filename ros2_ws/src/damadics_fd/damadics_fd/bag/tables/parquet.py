# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings as Parquet, with the column names of text tables."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.arrays import Columns
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.mapping import Scale, Source
from damadics_fd.bag.tables.headers import SECOND, Assignment, assign, headers
from damadics_fd.bag.tables.table import ROWS, Table, Told, lacking
from damadics_fd.bag.tables.times import Dates, seconds_of

try:
    import pyarrow
    from pyarrow import parquet
except ImportError:
    pyarrow = None  # told when a file is to be read


@dataclass(frozen=True)
class ParquetTable(Table):
    """
    One actuator in a Parquet file.

    :param names: all columns of the file.
    """

    names: tuple[str, ...] = ()

    def chunks(self, on_problem: Told) -> Iterator[Columns]:
        """
        Yield the columns in blocks of rows.

        :param on_problem: told of rows without a time, which are left out.
        :raises BagError: where the file is damaged or a column holds no numbers.
        """
        signals = self.assignment.signals
        clock = self.names[self.assignment.time[0]]
        wanted = {clock, *(self.names[use.column] for use in signals.values())}
        row = 0
        try:
            with parquet.ParquetFile(self.path) as file:
                for batch in file.iter_batches(ROWS, columns=sorted(wanted)):
                    row += len(batch)
                    columns = {
                        name: use.scale(_numbers(batch.column(self.names[use.column])))
                        for name, use in signals.items()
                    }
                    time = batch.column(clock)
                    exact = _exact(time)
                    if exact is not None:
                        yield columns | {'stamp': exact}
                        continue
                    stamp = self._stamps(time)
                    kept = self.timed(stamp, columns, f'up to row {row}', on_problem)
                    if kept:
                        yield kept
        except (pyarrow.ArrowException, OSError, ValueError) as error:
            raise BagError(f'cannot be read: {error}', self.path) from error

    def _stamps(self, time: 'pyarrow.Array') -> NDArray[np.float64]:
        """Return times [ns] that are numbers or text, NaN where there is none."""
        if pyarrow.types.is_string(time.type) or pyarrow.types.is_large_string(time.type):
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


def _exact(time: 'pyarrow.Array') -> NDArray[np.int64] | None:
    """Return dates [ns] without a detour through floating point, None where they are none."""
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
    for name, assignment in found.items():
        time = assignment.time[:1] or tuple(dates[:1])
        if time:
            placed = Assignment(assignment.signals, time, assignment.scale)
            tables.append(ParquetTable(path, name, placed, names))
    if not tables:
        raise lacking(path, list(names))
    return tables
