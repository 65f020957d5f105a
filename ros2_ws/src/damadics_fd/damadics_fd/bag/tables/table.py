# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings as text: CSV of spreadsheets, pandas and historians, the daily files of Lublin."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.arrays import Column, Columns
from damadics_fd.bag.errors import BagError, NoMeasurementError
from damadics_fd.bag.mapping import Scale, Source
from damadics_fd.bag.tables.assignment import SECOND, Assignment, assign
from damadics_fd.bag.tables.headers import LUBLIN, headers
from damadics_fd.bag.tables.sniff import BLANKS, Layout, parse_cell, sniff, split
from damadics_fd.bag.tables.times import Dates, is_date, seconds_of

ROWS = 100_000  # read at a time
LAST_STAMP = 9.2e18  # [ns] that fits 63 bits
Told = Callable[[str], None]
REMEDY = (
    'name them: --map t=TIME --map cv=COLUMN --map x1=COLUMN[%]; times are seconds, or dates like'
    ' 2026-11-25 14:00:00.5'
)


@dataclass(frozen=True)
class Table:
    """
    One actuator in a table.

    :param path: file.
    :param name: what distinguishes it from the others in the file, '' if it is alone.
    :param assignment: where the signals are; the time is in one or two columns.
    """

    path: Path
    name: str
    assignment: Assignment

    @property
    def valve(self) -> str | None:
        """Whose rows these are, where the file has a column that says so."""
        return None

    def rows(self, valves: Sequence[str], on_problem: Told) -> Iterator[Columns]:
        """
        Yield the rows of several valves of the file.

        :param valves: names as `valve` has them.
        :param on_problem: as for `chunks`.
        :return: `valve` (index into `valves`), `stamp` and the signals.
        :raises BagError: as `chunks`.
        """
        raise NotImplementedError  # asked where `valve` names one; text has no such column

    def chunks(self, on_problem: Told) -> Iterator[Columns]:
        """
        Yield the columns in blocks of rows.

        :param on_problem: told what is left out.
        :raises BagError: where it is no table of numbers.
        """
        raise NotImplementedError  # each kind of file has its own

    def timed(
        self, stamp: NDArray[np.float64], columns: Mapping[str, Column], where: str, tell: Told
    ) -> Columns | None:
        """Leave out the rows without a time [ns]; None where none has one."""
        good = np.isfinite(stamp) & (np.abs(np.nan_to_num(stamp)) < LAST_STAMP)
        if not good.all():
            tell(f'{self.path}: {(~good).sum()} rows {where} have no time and are left out')
        if not good.any():
            return None
        kept = {name: values[good] for name, values in columns.items()}
        return kept | {'stamp': np.round(stamp[good]).astype(np.int64)}


@dataclass(frozen=True)
class TextTable(Table):
    """
    One actuator in a text file.

    :param layout: how the file is written.
    :param start: stamp of time zero [ns].
    """

    layout: Layout
    start: int = 0

    def chunks(self, on_problem: Told) -> Iterator[Columns]:
        """
        Yield the columns in blocks of rows.

        :param on_problem: told of lines that are no row of numbers, which are left out.
        :raises BagError: where most lines are not.
        """
        signals = self.assignment.signals
        use = sorted({*self.assignment.time, *(s.column for s in signals.values())})
        place = {column: i for i, column in enumerate(use)}
        dates, scale = self._clock()
        delimiter = None if self.layout.delimiter == BLANKS else self.layout.delimiter
        with self.path.open(encoding=self.layout.encoding, errors='replace') as file:
            row = self.layout.skipped
            for _ in islice(file, row):
                pass
            while lines := list(islice(file, ROWS)):
                stamps: NDArray[np.int64] | None = None
                try:
                    if dates:
                        raise ValueError
                    block = np.loadtxt(lines, delimiter=delimiter, usecols=use, ndmin=2)
                except ValueError:
                    block, stamps = self._by_line(lines, row, use, dates, on_problem)
                row += len(lines)
                columns = {name: s.scale(block[:, place[s.column]]) for name, s in signals.items()}
                if stamps is not None:
                    if len(stamps):
                        yield columns | {'stamp': stamps + self.start}
                    continue
                with np.errstate(over='ignore', invalid='ignore'):
                    time = scale(block[:, place[self.assignment.time[0]]]) * SECOND
                kept = self.timed(time, columns, f'up to line {row}', on_problem)
                if kept:
                    yield kept | {'stamp': kept['stamp'] + self.start}

    def _clock(self) -> tuple[Dates | None, Scale]:
        """Return how to read the time: dates, or numbers with a scale to seconds."""
        time = self.assignment.time
        cells = [' '.join(row[i] for i in time if i < len(row)) for row in self.layout.rows]
        if self.assignment.scale is None and any(map(is_date, cells)):
            return Dates(cells), Scale()
        if self.assignment.scale is not None:
            return None, self.assignment.scale
        for cell in cells:
            try:
                return None, Scale(seconds_of(parse_cell(cell)))
            except ValueError:
                continue
        return None, Scale()

    def _by_line(
        self, lines: list[str], before: int, use: list[int], dates: Dates | None, tell: Told
    ) -> tuple[NDArray[np.float64], NDArray[np.int64] | None]:
        """Parse lines one by one, as spreadsheets write them and crashes leave them."""
        rows, stamps, bad = [], [], []
        time = self.assignment.time
        for number, line in enumerate(lines, before + 1):
            cells = split(line, self.layout.delimiter)
            try:
                if dates:
                    stamp = dates(' '.join(cells[i] for i in time))
                    rows.append([0.0 if i in time else parse_cell(cells[i]) for i in use])
                    stamps.append(stamp)
                else:
                    rows.append([parse_cell(cells[column]) for column in use])
            except (ValueError, IndexError):
                if line.strip() and not line.startswith('#'):
                    bad.append(f'line {number}: {line.strip()[:60]!r}')
        if len(bad) > len(rows):
            raise BagError(f'{bad[0]} is no row of numbers; {REMEDY}', self.path)
        if bad:
            tell(
                f'{self.path}: {len(bad)} lines are no rows of numbers and are left out,'
                f' first {bad[0]}'
            )
        block = np.array(rows, float).reshape(len(rows), len(use))
        return block, np.array(stamps, np.int64) if dates else None


def read_table(
    path: str | Path,
    actuator: int | None = None,
    chosen: Mapping[str, Source] = {},
) -> list[Table]:
    """
    Find the actuators in a table.

    :param path: text with a header line, possibly below a preamble, a daily file of Lublin (33
        columns, no header), or Parquet.
    :param actuator: 1, 2 or 3: only this one, where the file has the plant's tags.
    :param chosen: columns named by the user.
    :return: one table per actuator.
    :raises NoMeasurementError: where the file is no such table or lacks what is needed.
    :raises BagError: where it cannot be read, or lacks a column that the user named.
    """
    path = Path(path)
    if path.suffix.lower() in ('.parquet', '.pq'):
        from damadics_fd.bag.tables.parquet import read_parquet

        return list(read_parquet(path, actuator, chosen))
    layout = sniff(path)
    names, start = layout.names, 0
    if not names and layout.rows:
        if len(layout.rows[0]) != len(LUBLIN):
            raise NoMeasurementError(
                f'has no header line and {len(layout.rows[0])} columns; name the columns in a'
                f' first line, or give a daily file of {len(LUBLIN)} columns',
                path,
            )
        names, start = LUBLIN, _midnight(path)
    titles = headers(names, layout.units)
    try:
        found = assign(titles, actuator, chosen)
    except BagError as error:
        raise BagError(error.reason, path) from error
    guess = (
        next((i for i, cell in enumerate(layout.rows[0]) if is_date(cell)), None)
        if (layout.rows)
        else None
    )
    tables = []
    for name, assignment in found.items():
        time = assignment.time or (() if guess is None else (guess,))
        if time:
            placed = Assignment(assignment.signals, time, assignment.scale)
            tables.append(TextTable(path, name, placed, layout, start))
    if not tables:
        raise lacking(path, [title.text for title in titles])
    return list(tables)


def lacking(path: Path, names: list[str]) -> NoMeasurementError:
    """Return the error of a table that lacks what is needed."""
    return NoMeasurementError(
        f'lacks a time, a control value or a position; it has the columns {", ".join(names)};'
        f' {REMEDY}',
        path,
    )


def _midnight(path: Path) -> int:
    """Return the stamp of midnight from a file name DDMMYYYY.txt, 0 for other names [ns]."""
    if not re.fullmatch(r'\d{8}', path.stem):
        return 0
    try:
        day = datetime.strptime(path.stem, '%d%m%Y').replace(tzinfo=UTC)
    except ValueError:
        return 0
    return int(day.timestamp()) * 10**9
