# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""How a text table is written: encoding, delimiter, what stands before the data."""

import csv
import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.tables.times import is_date

SAMPLE = 1 << 18  # [B] at the beginning of the file
LINES = 400  # looked at
PREAMBLE = 100  # lines at most
BLANKS = ' '  # any number of blanks and tabs, as MATLAB writes columns
DELIMITERS = '\t;|,' + BLANKS  # in this order: a comma may be a decimal one
NOT_MEASURED = {
    *('', '-', '--', '---', '*', '**', '***', '?', 'na', 'n/a', 'n.a.', 'nan', 'null', '<null>'),
    *('(null)', '\\n', 'none', 'nil', '<na>', 'missing', 'invalid', 'failed', 'error'),
    *('#n/a', '#div/0!', '#value!', '#ref!', '#num!', '#name?', '#null!'),  # spreadsheets
    *('-nan', 'nan(ind)', '-nan(ind)', '1.#qnan', '-1.#qnan', '1.#ind', '-1.#ind'),  # C
    *('1.#inf', '-1.#inf'),
    # states of historians
    *('bad', 'no data', 'nodata', 'bad input', 'bad data', 'bad quality', 'i/o timeout'),
    *('shutdown', 'comm fail', 'pt created', 'intf shut', 'scan off', 'scan timeout', 'configure'),
    *('over range', 'under range', 'calc failed', 'not connect', 'invalid data', 'no result'),
    *('no sample', 'arc off-line', 'tag not found'),
}
_CODE = re.compile(r'\[-\d+\].*')  # and errors of theirs: [-11059] No Good Data For Calculation
_DOUBLE = re.compile(r'(?<=[\d.])d(?=[-+]?\d)', re.IGNORECASE)  # exponent of Fortran
_SIGNS = dict.fromkeys(map(ord, "\u202f\u00a0'\u2019"))  # thousands, beside comma and point
_SIGNS[0x2212] = '-'


@dataclass(frozen=True)
class Layout:
    """
    How a text table is written.

    :param encoding: of the file.
    :param delimiter: between the fields; `BLANKS` for any number of them.
    :param names: header line, empty where there is none.
    :param units: line of units below it, or signs of percent in the cells; empty where there are
        none.
    :param skipped: lines before the data.
    :param rows: the first rows of data.
    """

    encoding: str
    delimiter: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    skipped: int
    rows: tuple[tuple[str, ...], ...]


def parse_cell(text: str) -> float:
    """
    Read a number as a spreadsheet may write it.

    >>> parse_cell(' 12,5'), parse_cell(''), parse_cell('"3e-2"'), parse_cell('1.234,5')
    (12.5, nan, 0.03, 1234.5)
    >>> parse_cell("1'234.5"), parse_cell('39.5 %')
    (1234.5, 39.5)
    """
    text = text.strip().strip('"')
    if text.lower() in NOT_MEASURED or _CODE.fullmatch(text):
        return math.nan
    text = text.translate(_SIGNS)
    if '_' in text:  # Python's own way of parting digits: here it is a name
        raise ValueError(text)
    text = text.removesuffix('%')  # a unit of the column: `sniff`
    if ',' in text:
        if '.' in text:  # the last one is the decimal sign, the other parts thousands
            thousands = '.' if text.rindex(',') > text.rindex('.') else ','
            text = text.replace(thousands, '')
        text = text.replace(',', '.')
    try:
        return float(text)
    except ValueError:
        return float(_DOUBLE.sub('e', text))


def is_value(cell: str) -> bool:
    """Tell whether a cell belongs to the data: a number, a date, or not measured."""
    try:
        parse_cell(cell)
    except ValueError:
        return is_date(cell)
    return True


def split(line: str, delimiter: str) -> list[str]:
    """
    Return the cells of a line.

    >>> split('a;"b;c";', ';'), split('   1.0e+00   2.5', BLANKS)
    (['a', 'b;c', ''], ['1.0e+00', '2.5'])
    """
    if delimiter == BLANKS:
        line = BLANKS.join(line.split())
    if '"' not in line:
        return line.rstrip('\r\n').split(delimiter)
    try:
        return next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error:
        return line.split(delimiter)


def sniff(path: Path) -> Layout:
    """
    Find out how a table is written.

    :raises BagError: where it is no text.
    """
    try:
        with path.open('rb') as stream:
            data = stream.read(SAMPLE)
    except OSError as error:
        raise BagError(f'cannot be read as text: {error.strerror}', path) from error
    encoding = _encoding(data, path)
    lines = data.decode(encoding, 'replace').splitlines()
    if len(data) == SAMPLE and len(lines) > 1:
        lines.pop()  # cut
    lines = lines[:LINES]
    delimiter, width = _delimiter(lines)
    table = [split(line, delimiter) for line in lines]
    first = next((i for i, cells in enumerate(table) if _is_data(cells, width)), len(table))
    last = [cells[-1].strip() for cells in table[first:] if len(cells) == width]
    if last and not any(last):
        width -= 1  # a delimiter ends each line of the data, and perhaps not the header
    before = [i for i in range(min(first, PREAMBLE)) if _wide(table[i], width)]
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    if before:
        below = first > 1 and len(before) > 1 and before[-1] == first - 1
        if below and before[-2] == first - 2:  # a line of units below the header
            names, units = tuple(table[before[-2]]), tuple(table[before[-1]])
        else:
            names = tuple(table[before[-1]])
    rows = tuple(tuple(cells) for cells in table[first:] if _is_data(cells, width))
    if any('%' in cell for cells in rows for cell in cells):
        units = tuple(_unit(i, units, rows) for i in range(width))
    stripped = tuple(name.strip().lstrip('' if i else '#').strip() for i, name in enumerate(names))
    return Layout(encoding, delimiter, stripped, units, first, rows)


def _unit(column: int, units: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return the unit of a column: what stands below the header, or the sign in its cells."""
    told = units[column].strip() if column < len(units) else ''
    signed = any(cells[column].rstrip(' "').endswith('%') for cells in rows if column < len(cells))
    return told or ('%' if signed else '')


def _encoding(data: bytes, path: Path) -> str:
    if data.startswith((b'\xff\xfe', b'\xfe\xff')):
        return 'utf-16'
    if b'\0' in data:
        raise BagError('cannot be read as text: it is binary', path)
    try:
        data.decode('utf-8-sig')
    except UnicodeDecodeError as error:
        if error.start < len(data) - 3:
            return 'cp1252'  # spreadsheets of Windows
    return 'utf-8-sig'


def _delimiter(lines: Sequence[str]) -> tuple[str, int]:
    """Return the delimiter and the number of columns that most lines have."""
    best = (',', 1)
    for delimiter in DELIMITERS:
        widths = Counter(len(split(line, delimiter)) for line in lines if line.strip())
        width, count = max(widths.items(), key=lambda entry: (entry[1], entry[0]), default=(1, 0))
        if width >= 3 and 2 * count >= sum(widths.values()):
            return delimiter, width
        if width > best[1]:
            best = (delimiter, width)
    return best


def _wide(cells: Sequence[str], width: int) -> bool:
    """Tell whether a line may be the header: as many cells as the data, most of them text."""
    return len(cells) >= max(width, 2) and sum(is_value(cell) for cell in cells) < len(cells) / 2


def _is_data(cells: Sequence[str], width: int) -> bool:
    """Tell whether most cells of a line are values, and some of them are there."""
    if abs(len(cells) - width) > 1:
        return False
    values = [cell for cell in cells if is_value(cell)]
    return 2 * len(values) > len(cells) and any(c.strip().strip('"') for c in values)
