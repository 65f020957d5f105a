# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which column of a table is which signal: our names, the benchmark's, the plant's tags."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.mapping import SIGNALS, TIMES, Scale, Source, unit_scale, units_of
from damadics_fd.bag.tables.headers import Header, tag_matches

SECOND = 1e9  # [ns]
NANOSECONDS = Scale(1 / SECOND)  # of `stamp`, to seconds
KPA, PERCENT, TPH = Scale(1e3), Scale(1e-2), Scale(1 / 3.6)
M3H = Scale(1 / 3.6)  # as if the medium were water
OWN = (*SIGNALS, 'fault', 'strength')
MAPPED = (*SIGNALS, *TIMES)
_PLACE = re.compile(r'#[1-9]\d{0,5}')
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


@dataclass(frozen=True)
class Use:
    """A column of the file and its scale to SI."""

    column: int
    scale: Scale = Scale()


def doubtful(
    what: str, columns: Sequence[int], names: Sequence[Header], with_map: bool = True
) -> BagError:
    """
    Return the error of several columns that may be meant, with the remedy.

    :param what: name of the signal.
    :param columns: the columns, from 0.
    :param names: headers of the table.
    :param with_map: the user may say which with `--map`.
    """
    listed = ', '.join(f'{names[i].text!r} (column {i + 1})' for i in columns)
    remedy = 'rename or remove all but one'
    if with_map and what in MAPPED:
        remedy = f"say which: --map '{what}=#{columns[0] + 1}'"
    return BagError(f'{what} may be any of {listed}; {remedy}')


def _find(names: Sequence[Header], target: str, source: Source) -> int:
    """Return the column that the user names, by its header or, as `#3`, by its place."""
    wanted = ' '.join(source.name.split())
    full = f'{wanted}[{source.unit}]'.replace(' ', '')
    tests: tuple[Callable[[Header], bool], ...] = (
        lambda h: h.text.replace(' ', '') == full,
        lambda h: h.text == wanted,
        lambda h: h.name == wanted,
        lambda h: h.name.lower() == wanted.lower(),
    )
    for test in tests:
        found = [i for i, header in enumerate(names) if test(header)]
        if len(found) > 1:
            raise BagError(
                f'--map {target}={source.name}: {doubtful(target, found, names).reason}'
            )
        if found:
            return found[0]
    place = int(wanted[1:]) - 1 if _PLACE.fullmatch(wanted) else -1
    if 0 <= place < len(names):
        return place
    raise BagError(
        f'--map {target}={source.name}: there is no such column; there are '
        + ', '.join(header.text for header in names)
        + _turned_round(wanted)
    )


def _turned_round(wanted: str) -> str:
    """
    Say how a difference is written, where somebody wrote one.

    >>> _turned_round('1-SP'), _turned_round('SP')
    ('; write SP[UNIT] invert, or SP*-FACTOR+1', '')
    """
    found = re.fullmatch(r'(\d[\d.]*)\s*-\s*(\S.*)', wanted)
    if not found:
        return ''
    return f'; write {found[2]}[UNIT] invert, or {found[2]}*-FACTOR+{found[1]}'


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


def _time_of(names: Sequence[Header], free: Sequence[int]) -> tuple[tuple[int, ...], Scale | None]:
    """Return the columns of the time among those that the user gave no other meaning."""

    def first(wanted: Iterable[str]) -> int | None:
        for name in wanted:
            found = [i for i in free if names[i].name.lower() == name]
            if len(found) > 1:
                raise doubtful('t', found, names)
            if found:
                return found[0]
        return None

    date, daytime = first(DATE_NAMES), first(DAYTIME_NAMES)
    stamp = first(['stamp'])
    place = first(TIME_NAMES)
    used = [i for i in (stamp, place) if i is not None][:1]
    if date is not None:
        used = [date] if daytime is None else [date, daytime]
    whole = [i for i in free if names[i].name.lower() in ('stamp', *TIME_NAMES)]
    if rivals := [i for i in whole if i not in used]:
        raise doubtful('t', [*used, *rivals], names)
    if date is not None:
        return tuple(used), None
    if stamp is not None:
        return (stamp,), NANOSECONDS
    return ((), None) if place is None else ((place,), _time_scale(names[place]))


def _time_scale(header: Header) -> Scale | None:
    """Return the scale of a time to seconds as its header says, None where it does not."""
    unit = header.unit.lower()
    return unit_scale('t', unit) if unit in units_of('t') else None


Candidates = dict[str, list[tuple[int, Scale]]]  # columns of each signal


def _known(names: Sequence[Header], free: Iterable[int]) -> Candidates:
    """List the columns that bear our names or those of the benchmark."""
    found: Candidates = {}
    for i in free:
        header = names[i]
        if header.name in _SCALED:
            signal, usual = _SCALED[header.name]
            scale = header.scale(signal) if header.unit else usual
        elif (signal := header.name.lower()) in OWN:
            scale = header.scale(signal)
        else:
            continue
        found.setdefault(signal, []).append((i, scale))
    return found


def tagged(
    names: Sequence[Header], free: Iterable[int], tags: Mapping[str, tuple[str, Scale]]
) -> Candidates:
    """
    List the columns that bear tags of the plant.

    :param names: headers of the table.
    :param free: columns to look at.
    :param tags: signal and scale of each tag.
    :return: the columns of each signal; one with an addition only where none is without.
    """
    found: Candidates = {}
    places = [*free]
    for tag, (signal, scale) in tags.items():
        fitting = [i for i in places if tag_matches(tag, names[i].name)]
        bare = [i for i in fitting if names[i].name.lower() == tag.lower()]
        found.setdefault(signal, []).extend((i, scale) for i in bare or fitting)
    return {signal: columns for signal, columns in found.items() if columns}


def the_only(
    candidates: Candidates, names: Sequence[Header], with_map: bool = True
) -> dict[str, Use]:
    """
    Return the column of each signal.

    :param candidates: the columns that may be each.
    :param names: headers of the table.
    :param with_map: the user may say which with `--map`.
    :raises BagError: where a signal has several.
    """
    for signal, columns in candidates.items():
        if len(columns) > 1:
            raise doubtful(signal, [i for i, _ in columns], names, with_map)
    return {signal: Use(*columns[0]) for signal, columns in candidates.items()}


def _chosen(
    names: Sequence[Header], chosen: Mapping[str, Source]
) -> tuple[dict[str, Use], tuple[int, ...], Scale | None]:
    """Return the signals and the time that the user names."""
    uses: dict[str, Use] = {}
    time: tuple[int, ...] = ()
    scale: Scale | None = None
    taken: dict[int, str] = {}
    for target, source in chosen.items():
        column = _find(names, target, source)
        if column in taken:
            raise BagError(
                f'--map: {taken[column]} and {target} are both {names[column].text!r}: each has a'
                ' column of its own'
            )
        taken[column] = target
        given = source.scale if source.told else None
        if target in TIMES:
            time, scale = (column,), given or _time_scale(names[column])
            if target == 'stamp':
                scale = (given or Scale()).then(NANOSECONDS)
        else:  # the user's factor counts from the raw numbers
            uses[target] = Use(column, given or names[column].scale(target))
    return uses, time, scale


def assign(
    names: Sequence[Header], actuator: int | None, chosen: Mapping[str, Source]
) -> dict[str, Assignment]:
    """
    Return for each actuator where its columns are.

    :param names: headers of the table.
    :param actuator: 1, 2 or 3: only this one, where the file has the plant's tags.
    :param chosen: columns named by the user.
    :return: by what distinguishes them, '' for the only one.
    :raises BagError: where there is no column that the user named, or several may be a signal
        that the user did not name.
    """
    uses, time, scale = _chosen(names, chosen)
    taken = {*time, *(use.column for use in uses.values())}
    free = [i for i in range(len(names)) if i not in taken]
    if not time:
        time, scale = _time_of(names, free)
    known = {
        signal: columns for signal, columns in _known(names, free).items() if signal not in uses
    }
    if {'cv', 'x1'} <= known.keys() | uses.keys():
        return {'': Assignment(the_only(known, names) | uses, time, scale)}
    found = {}
    for number, tags in TAGS.items():
        columns = {signal: [*places] for signal, places in known.items()}
        for signal, places in tagged(names, free, tags).items():
            if signal not in uses:
                columns.setdefault(signal, []).extend(places)
        if actuator in (None, number) and {'cv', 'x1'} <= columns.keys() | uses.keys():
            found[f'A{number}'] = Assignment(the_only(columns, names) | uses, time, scale)
    return found
