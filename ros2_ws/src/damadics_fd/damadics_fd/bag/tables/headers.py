# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which column of a table is which signal: our names, the benchmark's, the plant's tags."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.mapping import SIGNALS, TIMES, Scale, Source, unit_scale, units_of

SECOND = 1e9  # [ns]
NANOSECONDS = Scale(1 / SECOND)  # of `stamp`, to seconds
KPA, PERCENT, TPH = Scale(1e3), Scale(1e-2), Scale(1 / 3.6)
M3H = Scale(1 / 3.6)  # as if the medium were water
OWN = (*SIGNALS, 'fault', 'strength')
TIME_NAMES = (
    ('t', 't_s', 'time', 'time_s', 'timestamp', 'datetime', 'date_time', 'date time')
    + ('zeit', 'zeitstempel', 'utc', 'local time', 'timestamp_utc')
)  # fmt: skip
DATE_NAMES = ('date', 'datum')  # where the time of day is in a column of its own
DAYTIME_NAMES = ('time', 'zeit', 'uhrzeit', 'time of day')
_SCALED = {  # outputs of the benchmark's library, shares of their ranges
    'CV': ('cv', Scale()),
    'X': ('x1', Scale()),
    'X_norm': ('x1', Scale()),
    'P1_norm': ('p1', Scale(4e6)),
    'P2_norm': ('p2', Scale(4e6)),
    'T1_norm': ('t1', Scale(200.0)),
    'F_norm': ('flow', Scale(40 / 3.6)),
}
TAGS = {  # of the three actuators of the sugar factory
    1: {
        'P51_05': ('p1', KPA),
        'P51_06': ('p2', KPA),
        'T51_01': ('t1', Scale()),
        'F51_01': ('flow', M3H),
        'LC51_03CV': ('cv', PERCENT),
        'LC51_03X': ('x1', PERCENT),
    },
    2: {
        'P57_03': ('p1', KPA),
        'P57_04': ('p2', KPA),
        'T57_03': ('t1', Scale()),
        'FC57_03PV': ('flow', M3H),
        'FC57_03CV': ('cv', PERCENT),
        'FC57_03X': ('x1', PERCENT),
    },
    3: {
        'P74_00': ('p1', KPA),
        'P74_01': ('p2', KPA),
        'T74_00': ('t1', Scale()),
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
_UNIT = re.compile(r'(.+?)\s*[\[(]([^\[\]()]+(?:\([ag]\))?)[\])]\s*')
_TIME_UNIT = re.compile(r'(t|time|timestamp|zeit)_(s|ms|us|ns)', re.IGNORECASE)
_SLASH = re.compile(r'(.+?)\s*/\s*([^\s/]+)')  # t/s, p / bar
_KNOWN = {unit.lower() for signal in (*SIGNALS, 't') for unit in units_of(signal)} - {'1'}


@dataclass(frozen=True)
class Use:
    """A column of the file and its scale to SI."""

    column: int
    scale: Scale = Scale()


@dataclass(frozen=True)
class Header:
    """A column's header: as it stands, and its name and unit apart."""

    text: str
    name: str
    unit: str = ''

    def scale(self, signal: str) -> Scale:
        """Return the scale of its unit, none where the signal does not come in it."""
        known = {unit.lower() for unit in units_of(signal)}
        return unit_scale(signal, self.unit) if self.unit.lower() in known else Scale()


def headers(cells: Sequence[str], units: Sequence[str] = ()) -> list[Header]:
    """
    Part names and units.

    :param cells: the header line.
    :param units: the line of units below it, where there is one.

    >>> [(title.name, title.unit) for title in headers(['cv [%]', 'P1'], ['', 'bar'])]
    [('cv', '%'), ('P1', 'bar')]
    """
    found = []
    for i, cell in enumerate(cells):
        text = ' '.join(cell.replace('\ufeff', '').split())
        match = _UNIT.fullmatch(text) or _TIME_UNIT.fullmatch(text)
        if not match and (parted := _SLASH.fullmatch(text)) and parted[2].lower() in _KNOWN:
            match = parted
        below = units[i].strip().strip('[]()') if i < len(units) else ''
        found.append(Header(text, *((match[1], match[2]) if match else (text, below))))
    return found


def tag_matches(tag: str, name: str) -> bool:
    """
    Tell whether a column bears a tag of the plant, in any case, with or without an addition.

    >>> tag_matches('P51_05', 'p51_05_P1_kPa'), tag_matches('P51_05', 'P51_051')
    (True, False)
    """
    return re.match(rf'{tag}(_|$)', name, re.IGNORECASE) is not None


def _find(names: Sequence[Header], target: str, source: Source) -> int:
    """Return the column that the user names."""
    wanted = ' '.join(source.name.split())
    full = f'{wanted}[{source.unit}]'.replace(' ', '')
    tests: tuple[Callable[[Header], bool], ...] = (
        lambda h: h.text == wanted,
        lambda h: h.text.replace(' ', '') == full,
        lambda h: h.name == wanted,
        lambda h: h.name.lower() == wanted.lower(),
    )
    for test in tests:
        found = [i for i, header in enumerate(names) if test(header)]
        if len(found) > 1:
            raise BagError(f'--map {target}={source.name}: several columns are called so')
        if found:
            return found[0]
    raise BagError(
        f'--map {target}={source.name}: there is no such column; there are '
        + ', '.join(header.text for header in names)
    )


@dataclass(frozen=True)
class Assignment:
    """
    Where the signals of one actuator are.

    :param signals: by signal, without the time.
    :param time: columns that make the time: one, or a date and a time of day; none where no
        header says so.
    :param scale: to seconds where the time is a number, None to find out.
    """

    signals: Mapping[str, Use]
    time: tuple[int, ...] = ()
    scale: Scale | None = None


def _time_of(names: Sequence[Header]) -> tuple[tuple[int, ...], Scale | None]:
    folded = [header.name.lower() for header in names]
    date = next((i for i, name in enumerate(folded) if name in DATE_NAMES), None)
    daytime = next((i for i, name in enumerate(folded) if name in DAYTIME_NAMES), None)
    if date is not None:
        return ((date, daytime) if daytime is not None else (date,)), None
    if 'stamp' in folded:
        return (folded.index('stamp'),), NANOSECONDS
    for name in TIME_NAMES:
        if name in folded:
            place = folded.index(name)
            unit = names[place].unit.lower()
            return (place,), unit_scale('t', unit) if unit in units_of('t') else None
    return (), None


def assign(
    names: Sequence[Header], actuator: int | None, chosen: Mapping[str, Source]
) -> dict[str, Assignment]:
    """
    Return for each actuator where its columns are.

    :param names: headers of the table.
    :param actuator: 1, 2 or 3: only this one, where the file has the plant's tags.
    :param chosen: columns named by the user.
    :return: by what distinguishes them, '' for the only one.
    :raises BagError: where there is no column that the user named.
    """
    own: dict[str, Use] = {}
    for i, header in enumerate(names):
        known = header.name.lower()
        if header.name in OWN:
            own[header.name] = Use(i, header.scale(header.name))
        elif header.name in _SCALED:
            signal, usual = _SCALED[header.name]
            own[signal] = Use(i, header.scale(signal) if header.unit else usual)
        elif known in OWN and known not in own:  # X1
            own[known] = Use(i, header.scale(known))
    time, scale = _time_of(names)
    for target, source in chosen.items():
        column = _find(names, target, source)
        given = source.scale if source.told else None
        if target in TIMES:
            time, scale = (column,), given
            if target == 'stamp':
                scale = (given or Scale()).then(NANOSECONDS)
        else:  # the user's factor counts from the raw numbers
            own[target] = Use(column, given or names[column].scale(target))
    if {'cv', 'x1'} <= own.keys():
        return {'': Assignment(own, time, scale)}
    tagged = {}
    for number, tags in TAGS.items():
        columns = dict(own)
        for i, header in enumerate(names):
            tag = next((tag for tag in tags if tag_matches(tag, header.name)), None)
            if tag:
                columns[tags[tag][0]] = Use(i, tags[tag][1])
        if actuator in (None, number) and {'cv', 'x1'} <= columns.keys():
            tagged[f'A{number}'] = Assignment(columns, time, scale)
    return tagged
