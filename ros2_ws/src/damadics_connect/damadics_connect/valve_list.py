# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read the valves of a source out of a configuration, units with the words of `--map`."""

import re
from typing import NamedTuple

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.mapping import SHARES, Scale, parse_source, unit_scale
from damadics_fd.core.sample import SIGNALS

from damadics_connect.publishing import ValveName
from damadics_connect.settings import Section

NAME = re.compile(r'[a-z][a-z0-9_]*(/[a-z][a-z0-9_]*)*')
SHORTEST, LONGEST = 0.001, 3600.0  # s


class Signal(NamedTuple):
    """Where a signal comes from and how it is scaled."""

    slot: int  # number in SIGNALS
    source: str  # node, field or column
    scale: Scale


class ValveSource(NamedTuple):
    """A valve and its signals."""

    name: str
    actuator: str
    period: float  # s
    signals: tuple[Signal, ...]
    place: str = ''  # a topic or file of its own

    @property
    def known_as(self) -> ValveName:
        """Name and tag."""
        return ValveName(self.name, self.actuator)


def read_scale(section: Section, signal: str) -> Scale:
    """
    Read how a signal is scaled.

    :param section: with some of `unit`, `factor`, `offset`, `invert`.
    :param signal: field of `Measurement`.
    :return: the scale.
    """
    scale = Scale()
    if unit := section.text('unit'):
        try:
            scale = unit_scale(signal, unit)
        except BagError as problem:
            section.problems.append(f'{section.where}.unit: {problem.reason}')
    own = section.number('factor', 1.0, -1e12, 1e12)
    scale = scale.then(Scale(own, section.number('offset', 0.0, -1e12, 1e12)))
    if section.flag('invert'):
        if signal not in SHARES:
            section.refuse('invert', f'is for {" and ".join(SHARES)}: 1 minus the value')
        scale = scale.then(Scale(-1.0, 1.0))
    if not own:
        section.refuse('factor', 'is 0: every value would be the same')
    return scale


def read_source(section: Section, signal: str, text: str) -> tuple[str, Scale]:
    """
    Read the short form of a signal: `SOURCE[UNIT]*FACTOR+OFFSET invert`.

    :param section: takes mistakes.
    :param signal: field of `Measurement`.
    :param text: what stands behind it.
    :return: the source and its scale.
    """
    try:
        source = parse_source(signal, text)
    except BagError as problem:
        section.problems.append(f'{section.where}.{signal}: {problem.reason}')
        return text, Scale()
    return source.name, source.scale


def read_valves(config: Section, what: str, *, place: str = '') -> list[ValveSource]:
    """
    Read the entry `valves` of a configuration.

    :param config: the whole file.
    :param what: the word for the source of a signal, such as `node`.
    :param place: the entry of each valve that says where its samples are, such as `topic`.
    :return: the valves in the order of the file; mistakes are noted in `config`.
    """
    period = config.number('period', 1.0, SHORTEST, LONGEST)
    found: list[ValveSource] = []
    for name, entry in config.sections('valves').items():
        if not NAME.fullmatch(name):
            config.problems.append(
                f'valves.{name[:40]}: a name consists of small letters, digits and _, '
                'such as lv101'
            )
        found.append(
            ValveSource(
                name,
                entry.text('actuator', name),
                entry.number('period', period, SHORTEST, LONGEST),
                tuple(_signals(entry, what)),
                entry.text(place) if place else '',
            )
        )
        entry.done()
    return found


def _signals(entry: Section, what: str) -> list[Signal]:
    """Read the signals of a valve; `x1: SOURCE[UNIT]` is short for a mapping."""
    given = entry.mapping('signals')
    if not given:
        entry.problems.append(f'{entry.where}.signals: name at least cv and x1')
    found = []
    for name, content in given.items():
        if name not in SIGNALS:
            entry.problems.append(
                f'{entry.where}.signals: there is no signal {name[:20]}; '
                f'there are {", ".join(SIGNALS)}'
            )
            continue
        where = f'{entry.where}.signals'
        if isinstance(content, str):
            section = Section({}, where, entry.problems)
            source, scale = read_source(section, name, content)
        else:
            section = Section(content, f'{where}.{name}', entry.problems, entry.folder)
            source = section.needed(what, 'ns=2;s=...' if what == 'node' else name)
            scale = read_scale(section, name)
            section.done()
        found.append(Signal(SIGNALS.index(name), source, scale))
    return found
