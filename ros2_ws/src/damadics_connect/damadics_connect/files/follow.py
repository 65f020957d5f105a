# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Follow files that grow: whole new lines of a CSV, new files of a folder, CSV and Parquet."""

import csv
import io
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

LARGEST_STEP = 4_000_000  # bytes read at a time
LONGEST_LINE = 100_000  # bytes
BOM = b'\xef\xbb\xbf'
DELIMITERS = ';\t,'
Row = dict[str, str]


class FollowError(Exception):
    """A file cannot be followed; the message says why."""


class GrowingCsv:
    """
    A CSV file that somebody appends to, or replaces.

    The first line names the columns. A line counts once it has its end.

    :param path: of the file; it need not exist yet.
    :param from_end: leave out what is in it at first.
    """

    def __init__(self, path: Path, from_end: bool) -> None:
        self.path = path
        self._skip = from_end
        self._file: BinaryIO | None = None
        self._identity = (0, 0)
        self._rest = b''
        self._names: list[str] = []
        self._single: set[str] = set()
        self._delimiter = ','

    def rows(self) -> Iterator[Row]:
        """
        Return the rows that are new.

        :return: column by name; a cell that is missing is ''. Columns of one name are left out:
            nobody knows which is meant.
        :raises FollowError: where it cannot be read, or is no table.
        """
        while True:
            new = self._new_bytes()
            if not new:
                return
            lines = (self._rest + new).split(b'\n')
            self._rest = lines.pop()
            if len(self._rest) > LONGEST_LINE:
                self._rest = b''
                raise FollowError(f'{self.path.name}: a line of more than {LONGEST_LINE} bytes')
            for line in lines:
                if row := self._row(line):
                    yield row

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def _new_bytes(self) -> bytes:
        try:
            if self._file is None or self._replaced():
                self._open()
            return self._file.read(LARGEST_STEP) if self._file is not None else b''
        except FileNotFoundError:
            return b''
        except OSError as problem:
            raise FollowError(f'{self.path.name}: {problem.strerror}') from problem

    def _replaced(self) -> bool:
        """Tell whether the path is another file now, or the file has become shorter."""
        assert self._file is not None
        now = self.path.stat()
        return (now.st_dev, now.st_ino) != self._identity or now.st_size < self._file.tell()

    def _open(self) -> None:
        first = self._file is None
        if not first:
            self.close()
        self._file = self.path.open('rb')
        status = os.fstat(self._file.fileno())
        self._identity = status.st_dev, status.st_ino
        self._rest, self._names = b'', []
        if first and self._skip:
            header = self._file.readline(LONGEST_LINE)
            if header.endswith(b'\n'):
                self._row(header.rstrip(b'\n'))
                self._file.seek(max(status.st_size, len(header)))
                self._drop_half_line(status.st_size)
            else:
                self._file.seek(0)

    def _drop_half_line(self, size: int) -> None:
        """Begin with the half line at the end, which will be whole."""
        assert self._file is not None
        back = min(size, LONGEST_LINE)
        self._file.seek(size - back)
        tail = self._file.read(back)
        self._rest = tail[tail.rfind(b'\n') + 1 :]

    def _row(self, line: bytes) -> Row | None:
        text = line.removeprefix(BOM).rstrip(b'\r').decode('utf-8', 'replace')
        if not text.strip():
            return None
        if not self._names:
            self._delimiter = max(DELIMITERS, key=text.count)
            self._names = [name.strip() for name in self._cells(text)]
            self._single = _single(self._names)
            if len(self._names) < 2:
                self._names = []
                raise FollowError(f'{self.path.name}: its first line names no columns')
            return None
        cells = [cell.strip() for cell in self._cells(text)]
        if cells == self._names:
            return None  # a program that was restarted has written the header again
        cells += [''] * (len(self._names) - len(cells))
        return {
            name: cell
            for name, cell in zip(self._names, cells, strict=False)
            if name in self._single
        }

    def _cells(self, text: str) -> list[str]:
        try:
            return next(csv.reader(io.StringIO(text), delimiter=self._delimiter), [])
        except csv.Error:
            return []


class Folder:
    """
    A folder that files arrive in: `*.csv` grow, `*.parquet` are whole.

    :param path: of the folder.
    :param from_end: leave out what is in it at first.
    """

    def __init__(self, path: Path, from_end: bool) -> None:
        self.path = path
        self._skip = from_end
        self._tables: dict[Path, GrowingCsv] = {}
        self._done: set[Path] = set()

    def rows(self) -> Iterator[Row]:
        """Return the rows that are new, in the order of the names of their files."""
        if not self.path.is_dir():
            raise FollowError(f'{self.path.name}: this folder does not exist')
        for path in sorted(self.path.iterdir()):
            if path.suffix.lower() == '.csv':
                if path not in self._tables:
                    self._tables[path] = GrowingCsv(path, self._skip)
                yield from self._tables[path].rows()
            elif path.suffix.lower() in ('.parquet', '.pq') and path not in self._done:
                if self._skip:
                    self._done.add(path)
                else:
                    yield from self._parquet(path)
        self._skip = False

    def _parquet(self, path: Path) -> Iterator[Row]:
        try:
            from pyarrow import ArrowException, parquet
        except ModuleNotFoundError as problem:
            raise FollowError('Parquet needs pyarrow: pip install pyarrow') from problem
        try:
            with parquet.ParquetFile(path) as file:
                table = file.read()
        except (ArrowException, OSError):
            return  # not whole yet: its end is written last
        self._done.add(path)
        columns = {name: table[name].to_pylist() for name in sorted(_single(table.column_names))}
        for n in range(table.num_rows):
            yield {name: _text(column[n]) for name, column in columns.items()}


def _single(names: Sequence[str]) -> set[str]:
    """Return the names that one column has."""
    return {name for name, count in Counter(names).items() if count == 1}


def _text(value: object) -> str:
    if value is None:
        return ''
    return value.isoformat() if hasattr(value, 'isoformat') else repr(value).strip("'")
