# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings as text: our own CSV, tables with the plant's tags, the daily files of Lublin."""

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.errors import BagError, NoMeasurementError
from damadics_fd.bag.mapping import Source

ROWS = 100_000  # read at a time
SECOND = 1e9  # [ns]
KPA, PERCENT, TPH, M3H = 1e3, 1e-2, 1 / 3.6, 1 / 3.6  # to SI; m3/h as if the medium were water
_TIME = {'t': SECOND, 't_s': SECOND, 'time': SECOND, 'time_s': SECOND, 'stamp': 1.0}
_OWN = {
    name: (name, 1.0) for name in ('cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps', 'fault', 'strength')
}
_SCALED = {  # outputs of the benchmark's library, shares of their ranges
    'CV': ('cv', 1.0),
    'X': ('x1', 1.0),
    'X_norm': ('x1', 1.0),
    'P1_norm': ('p1', 4e6),
    'P2_norm': ('p2', 4e6),
    'T1_norm': ('t1', 200.0),
    'F_norm': ('flow', 40 * TPH),
}
TAGS = {  # of the three actuators of the sugar factory: signal and factor to SI
    1: {
        'P51_05': ('p1', KPA),
        'P51_06': ('p2', KPA),
        'T51_01': ('t1', 1.0),
        'F51_01': ('flow', M3H),
        'LC51_03CV': ('cv', PERCENT),
        'LC51_03X': ('x1', PERCENT),
    },
    2: {
        'P57_03': ('p1', KPA),
        'P57_04': ('p2', KPA),
        'T57_03': ('t1', 1.0),
        'FC57_03PV': ('flow', M3H),
        'FC57_03CV': ('cv', PERCENT),
        'FC57_03X': ('x1', PERCENT),
    },
    3: {
        'P74_00': ('p1', KPA),
        'P74_01': ('p2', KPA),
        'T74_00': ('t1', 1.0),
        'F74_00': ('flow', TPH),
        'LC74_20CV': ('cv', PERCENT),
        'LC74_20X': ('x1', PERCENT),
        'L74_20X': ('x1', PERCENT),
    },  # as some sheets write it
}
LUBLIN = tuple(
    (  # noqa: SIM905
        't P51_05 P51_06 T51_01 F51_01 LC51_03CV LC51_03X LC51_03PV TC51_05 T51_08 D51_01 D51_02'
        ' F51_02 PC51_01 T51_06 P51_03 T51_07 P57_03 P57_04 T57_03 FC57_03PV FC57_03CV FC57_03X'
        ' P74_00 P74_01 T74_00 F74_00 LC74_20CV LC74_20X LC74_20PV F74_30 P74_30 T74_30'
    ).split()
)
NOT_MEASURED = ('', '-', 'na', 'n/a', '#n/a', 'nan', 'null', 'none')  # in a cell
Use = tuple[int, float]  # column of the file, factor to SI


@dataclass(frozen=True)
class Table:
    """
    One actuator in a text file.

    :param path: file.
    :param name: what distinguishes it from the others in the file, '' if it is alone.
    :param columns: where the columns of the contract are.
    :param delimiter: between the fields.
    :param header: lines before the data.
    :param start: stamp of time zero [ns].
    """

    path: Path
    name: str
    columns: Mapping[str, Use]
    delimiter: str
    header: int
    start: int = 0

    def chunks(self, on_problem: Callable[[str], None]) -> Iterator[dict[str, NDArray]]:
        """
        Yield the columns in blocks of rows.

        :param on_problem: told of lines that are no row of numbers, which are left out.
        :raises BagError: where most lines are not.
        """
        use = sorted({column for column, _ in self.columns.values()})
        place = {column: i for i, column in enumerate(use)}
        with self.path.open(encoding='utf-8', errors='replace') as file:
            row = self.header
            for _ in islice(file, self.header):
                pass
            while lines := list(islice(file, ROWS)):
                try:
                    block = np.loadtxt(lines, delimiter=self.delimiter, usecols=use, ndmin=2)
                except ValueError:
                    block = self._by_line(lines, row, use, on_problem)
                row += len(lines)
                timed = np.isfinite(block[:, place[self.columns['stamp'][0]]])
                if not timed.all():
                    on_problem(
                        f'{self.path}: {(~timed).sum()} rows up to line {row} have no time'
                        ' and are left out'
                    )
                if timed.any():
                    yield self._named(block[timed], place)

    def _by_line(
        self, lines: list[str], before: int, use: list[int], on_problem: Callable[[str], None]
    ) -> NDArray[np.float64]:
        """Parse lines one by one, as spreadsheets write them and crashes leave them."""
        rows, bad = [], []
        for number, line in enumerate(lines, before + 1):
            cells = line.split(self.delimiter)
            try:
                rows.append([parse_cell(cells[column]) for column in use])
            except (ValueError, IndexError):
                if line.strip() and not line.startswith('#'):
                    bad.append(f'line {number}: {line.strip()[:60]!r}')
        if len(bad) > len(rows):
            raise BagError(f'{bad[0]} is no row of numbers; time has to be in seconds', self.path)
        if bad:
            on_problem(
                f'{self.path}: {len(bad)} lines are no rows of numbers and are left out,'
                f' first {bad[0]}'
            )
        return np.array(rows, float).reshape(len(rows), len(use))

    def _named(self, block: NDArray, place: Mapping[int, int]) -> dict[str, NDArray]:
        columns = {
            name: block[:, place[column]] * factor
            for name, (column, factor) in self.columns.items()
        }
        stamp = np.round(columns['stamp']).astype(np.int64) + self.start
        return columns | {'stamp': stamp}


def parse_cell(text: str) -> float:
    """
    Read a number as a spreadsheet may write it.

    >>> parse_cell(' 12,5'), parse_cell(''), parse_cell('"3e-2"')
    (12.5, nan, 0.03)
    """
    text = text.strip().strip('"')
    return math.nan if text.lower() in NOT_MEASURED else float(text.replace(',', '.'))


def read_table(
    path: str | Path,
    actuator: int | None = None,
    chosen: Mapping[str, Source] = {},
) -> list[Table]:
    """
    Find the actuators in a text file.

    :param path: CSV with a header line, or a daily file of Lublin (33 columns, no header).
    :param actuator: 1, 2 or 3: only this one, where the file has the plant's tags.
    :param chosen: columns named by the user: for each its header and factor to SI.
    :return: one table per actuator.
    :raises NoMeasurementError: where the file is no such table or lacks what is needed.
    :raises BagError: where it cannot be read, or lacks a column that the user named.
    """
    path = Path(path)
    try:
        with path.open(encoding='utf-8') as file:
            line = file.readline().rstrip('\r\n')
    except (OSError, UnicodeDecodeError) as error:
        raise BagError(f'cannot be read as text: {error}', path) from error
    delimiter = next((mark for mark in '\t;,' if mark in line), ',')
    names = [name.strip().strip('"') for name in line.split(delimiter)]
    header = 1
    start = 0
    if re.fullmatch(r'[-+\d.eE]+', names[0]):
        if len(names) != len(LUBLIN):
            raise NoMeasurementError(
                f'has no header line and {len(names)} columns; name the columns in a first line,'
                f' or give a daily file of {len(LUBLIN)} columns',
                path,
            )
        names, header, start = list(LUBLIN), 0, _midnight(path)
    tables = [
        Table(path, name, columns, delimiter, header, start)
        for name, columns in _actuators(names, actuator, chosen).items()
        if {'stamp', 'cv', 'x1'} <= columns.keys()
    ]
    if not tables:
        raise NoMeasurementError(
            f'lacks a time, a control value or a position; it has the columns {", ".join(names)};'
            ' name them: --map t=TIME --map cv=COLUMN --map x1=COLUMN*0.01',
            path,
        )
    return tables


def _actuators(
    names: list[str], actuator: int | None, chosen: Mapping[str, Source]
) -> dict[str, dict[str, Use]]:
    """Return for each actuator where its columns are."""
    own: dict[str, Use] = {}
    for i, name in enumerate(names):
        if name in _TIME:
            own['stamp'] = i, _TIME[name]
        elif name in _OWN or name in _SCALED:
            target, factor = _OWN.get(name) or _SCALED[name]
            own[target] = i, factor
    for target, source in chosen.items():
        name, factor = source.name, source.scale.factor
        if name not in names:
            raise BagError(
                f'--map {target}={name}: there is no such column; there are ' + ', '.join(names)
            )
        stamp = target in ('t', 'stamp')
        own['stamp' if stamp else target] = names.index(name), factor * (SECOND if stamp else 1.0)
    if {'cv', 'x1'} <= own.keys():
        return {'': own}
    tagged = {}
    for number, tags in TAGS.items():
        columns = dict(own)
        for i, name in enumerate(names):
            tag = next((tag for tag in tags if tag_matches(tag, name)), None)
            if tag:
                columns[tags[tag][0]] = i, tags[tag][1]
        if actuator in (None, number) and len(columns) > len(own):
            tagged[f'A{number}'] = columns
    return tagged


def tag_matches(tag: str, name: str) -> bool:
    """
    Tell whether a column bears a tag of the plant, in any case, with or without an addition.

    >>> tag_matches('P51_05', 'p51_05_P1_kPa'), tag_matches('P51_05', 'P51_051')
    (True, False)
    """
    return re.match(rf'{tag}(_|$)', name, re.IGNORECASE) is not None


def _midnight(path: Path) -> int:
    """Return the stamp of midnight from a file name DDMMYYYY.txt, 0 for other names [ns]."""
    if not re.fullmatch(r'\d{8}', path.stem):
        return 0
    try:
        day = datetime.strptime(path.stem, '%d%m%Y').replace(tzinfo=UTC)
    except ValueError:
        return 0
    return int(day.timestamp()) * 10**9
