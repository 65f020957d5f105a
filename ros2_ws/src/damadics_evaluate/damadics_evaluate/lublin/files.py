# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read daily files of the plant: 33 columns without a header, or a CSV with the plant's tags."""

import re
from collections.abc import Callable
from datetime import date
from pathlib import Path

import numpy as np
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.mapping import Scale
from damadics_fd.bag.tables.assignment import TAGS, Assignment, doubtful, tagged, the_only
from damadics_fd.bag.tables.headers import LUBLIN, Header
from damadics_fd.bag.tables.sniff import BLANKS, Layout
from damadics_fd.bag.tables.table import TextTable

from damadics_evaluate.columns import NANOSECONDS, Columns

ACTUATORS = tuple(TAGS)
TIMES = ('t', 't_s', 'time', 'time_s', 'second', 'seconds')
SUFFIXES = ('.txt', '.csv', '.tsv', '.dat')
DAY_S = 86400.0
Record = dict[tuple[date, int], Columns]


def read_folder(folder: Path, on_problem: Callable[[str], None]) -> Record:
    """
    Read every table of the plant in a folder; parts of one day are put together.

    :param folder: with files whose names hold the date: DDMMYYYY.txt, or 2001-11-17 anywhere.
    :param on_problem: told of every file that is left out, and why.
    :return: columns by day and actuator; `stamp` counts from midnight.
    :raises FileNotFoundError: where the folder does not exist or holds no such table.
    """
    if not folder.exists():
        raise FileNotFoundError(f'there is no {folder}: give the folder of the daily files')
    files = [folder] if folder.is_file() else sorted(folder.rglob('*'))
    parts: dict[tuple[date, int], list[Columns]] = {}
    for file in files:
        if file.suffix.lower() not in SUFFIXES or not file.is_file():
            continue
        day = date_of(file.name)
        if day is None:
            on_problem(f'{file.name}: no date in its name (DDMMYYYY or 2001-11-17), left out')
            continue
        try:
            found = read_file(file, on_problem)
        except BagError as error:
            on_problem(f'{error}, left out')
            continue
        if not found:
            on_problem(f'{file.name}: no table of the plant, left out')
        for actuator, columns in found.items():
            parts.setdefault((day, actuator), []).append(columns)
    if not parts:
        raise FileNotFoundError(
            f'{folder} holds no table of the plant: daily files DDMMYYYY.txt of {len(LUBLIN)} '
            'columns, or CSV files with a date in the name and the tags of the plant as header'
        )
    return {key: _joined(several) for key, several in parts.items()}


def date_of(name: str) -> date | None:
    """
    Return the date in a file name.

    >>> date_of('17112001.txt'), date_of('lublin_2001-11-17_1hz.csv'), date_of('notes.txt')
    (datetime.date(2001, 11, 17), datetime.date(2001, 11, 17), None)
    """
    iso = re.search(r'(\d{4})[-_.]?(\d{2})[-_.]?(\d{2})(?!\d)', name)
    german = re.search(r'(?<!\d)(\d{2})[-_.]?(\d{2})[-_.]?(\d{4})(?!\d)', name)
    for match, order in ((german, (3, 2, 1)), (iso, (1, 2, 3))):
        if match:
            year, month, day = (int(match[i]) for i in order)
            try:
                found = date(year, month, day)
            except ValueError:
                continue
            if 1990 <= found.year <= 2100:
                return found
    return None


def read_file(file: Path, on_problem: Callable[[str], None]) -> dict[int, Columns]:
    """
    Read one table.

    :param file: 33 columns without a header, or a header with the tags in any case.
    :param on_problem: told of lines that are left out.
    :return: columns by actuator, empty where it is no table of the plant.
    :raises BagError: where it cannot be read, or several columns may be one signal.
    """
    try:
        with file.open(encoding='utf-8', errors='replace') as stream:
            first = stream.readline().rstrip('\r\n')
    except OSError as error:
        raise BagError(f'cannot be read: {error}', file) from error
    delimiter = next((mark for mark in '\t;,' if mark in first), None)
    names = [name.strip().strip('"').lower() for name in first.split(delimiter)]
    header = 1
    if re.fullmatch(r'[-+\d.e]+', names[0]):
        names = names[:-1] if not names[-1] else names  # a delimiter at the end of each line
        if len(names) != len(LUBLIN):
            return {}
        names, header = [name.lower() for name in LUBLIN], 0
    titles = [Header(name, name) for name in names]
    times = [i for i, name in enumerate(names) if name in TIMES]
    found = {}
    for actuator in ACTUATORS:
        columns = tagged(titles, range(len(names)), TAGS[actuator])
        if times and {'cv', 'x1'} <= columns.keys():
            try:
                if len(times) > 1:
                    raise doubtful('t', times, titles, with_map=False)
                signals = the_only(columns, titles, with_map=False)
            except BagError as error:
                raise BagError(error.reason, file) from error
            layout = Layout('utf-8', delimiter or BLANKS, (), (), header, ())
            where = Assignment(signals, (times[0],), Scale())
            table = TextTable(file, f'A{actuator}', where, layout)
            chunks = list(table.chunks(on_problem))
            if chunks:
                found[actuator] = _joined(chunks)
    return found


def _joined(parts: list[Columns]) -> Columns:
    """Return parts in order of time, within the day, each instant once."""
    names = set.intersection(*(set(part) for part in parts))
    whole = {name: np.concatenate([part[name] for part in parts]) for name in sorted(names)}
    whole['stamp'] = np.mod(whole['stamp'], int(DAY_S * NANOSECONDS))
    _, first = np.unique(whole['stamp'], return_index=True)
    return {name: values[first] for name, values in whole.items()}
