# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the headers of a table's columns say: name, unit, and whether a name is there again."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.mapping import SIGNALS, Scale, unit_scale, units_of

LUBLIN = tuple(
    (  # noqa: SIM905
        't P51_05 P51_06 T51_01 F51_01 LC51_03CV LC51_03X LC51_03PV TC51_05 T51_08 D51_01 D51_02'
        ' F51_02 PC51_01 T51_06 P51_03 T51_07 P57_03 P57_04 T57_03 FC57_03PV FC57_03CV FC57_03X'
        ' P74_00 P74_01 T74_00 F74_00 LC74_20CV LC74_20X LC74_20PV F74_30 P74_30 T74_30'
    ).split()
)
_UNIT = re.compile(r'(.+?)\s*[\[(]([^\[\]()]+(?:\([ag]\))?)[\])]\s*')
_TIME_UNIT = re.compile(r'(t|time|timestamp|zeit)_(s|ms|us|ns)', re.IGNORECASE)
_SLASH = re.compile(r'(.+?)\s*/\s*([^\s/]+)')  # t/s, p / bar
_AGAIN = re.compile(r'(.+?)(?:\.\d+|_duplicated_\d+)')  # as pandas and polars tell two of one name
_KNOWN = {unit.lower() for signal in (*SIGNALS, 't') for unit in units_of(signal)} - {'1'}
_NO_UNIT = {'', '-', '--', '1', '0-1', '0..1', 'si', 'norm', 'fraction', 'p.u.', 'pu'}


@dataclass(frozen=True)
class Header:
    """A column's header: as it stands, and its name and unit apart."""

    text: str
    name: str
    unit: str = ''

    def scale(self, signal: str) -> Scale:
        """
        Return the scale of its unit.

        :raises BagError: where the signal does not come in this unit: its numbers mean nothing.

        >>> Header('x1 [%]', 'x1', '%').scale('x1')
        Scale(factor=0.01, offset=0.0)
        """
        unit = self.unit.lower()
        if unit in {name.lower() for name in units_of(signal)}:
            return unit_scale(signal, self.unit)
        if unit in _NO_UNIT:
            return Scale()
        raise BagError(
            f'column {self.text!r}: {signal} in {self.unit!r} is not known; write'
            f" --map '{signal}=#PLACE*FACTOR+OFFSET' (the first column is #1),"
            f' or one of {", ".join(units_of(signal))}'
        )


def headers(cells: Sequence[str], units: Sequence[str] = ()) -> list[Header]:
    """
    Part names and units.

    :param cells: the header line.
    :param units: the line of units below it, where there is one.

    >>> [(title.name, title.unit) for title in headers(['cv [%]', 'P1'], ['', 'bar'])]
    [('cv', '%'), ('P1', 'bar')]
    >>> [title.name for title in headers(['x1', 'x1.1', 'v1.1'])]
    ['x1', 'x1', 'v1.1']
    """
    found = []
    texts = [' '.join(cell.replace('\ufeff', '').split()) for cell in cells]
    for i, written in enumerate(texts):
        again = _AGAIN.fullmatch(written)
        text = again[1] if again and again[1] in texts else written
        match = _UNIT.fullmatch(text) or _TIME_UNIT.fullmatch(text)
        if not match and (parted := _SLASH.fullmatch(text)) and parted[2].lower() in _KNOWN:
            match = parted
        below = units[i].strip().strip('[]()') if i < len(units) else ''
        found.append(Header(written, *((match[1], match[2]) if match else (text, below))))
    return found


def tag_matches(tag: str, name: str) -> bool:
    """
    Tell whether a column bears a tag of the plant, in any case, with or without an addition.

    >>> tag_matches('P51_05', 'p51_05_P1_kPa'), tag_matches('P51_05', 'P51_051')
    (True, False)
    """
    return re.match(rf'{tag}(_|$)', name, re.IGNORECASE) is not None
