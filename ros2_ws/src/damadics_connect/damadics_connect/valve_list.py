# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read the valves of a source out of a configuration."""

import re
from typing import NamedTuple

from damadics_fd.core.sample import SIGNALS

from damadics_connect.publishing import ValveName
from damadics_connect.settings import Section
from damadics_connect.units import Scale, read_scale

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
    topic: str = ''  # of a broker

    @property
    def known_as(self) -> ValveName:
        """Name and tag."""
        return ValveName(self.name, self.actuator)


def read_valves(config: Section, what: str, *, with_topic: bool = False) -> list[ValveSource]:
    """
    Read the entry `valves` of a configuration.

    :param config: the whole file.
    :param what: the word for the source of a signal, such as `node`.
    :param with_topic: each valve has an entry `topic`.
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
        signals = []
        for signal, given in _signals(entry, what).items():
            source = given.needed(what, 'ns=2;s=...' if what == 'node' else signal)
            signals.append(Signal(SIGNALS.index(signal), source, read_scale(given, signal)))
            given.done()
        found.append(
            ValveSource(
                name,
                entry.text('actuator', name),
                entry.number('period', period, SHORTEST, LONGEST),
                tuple(signals),
                entry.text('topic') if with_topic else '',
            )
        )
        entry.done()
    return found


def _signals(entry: Section, what: str) -> dict[str, Section]:
    """Read the signals of a valve; `x1: NODE` is short for `x1: {node: NODE}`."""
    given = entry.mapping('signals')
    if not given:
        entry.problems.append(f'{entry.where}.signals: name at least cv and x1')
    found = {}
    for name, content in given.items():
        if name not in SIGNALS:
            entry.problems.append(
                f'{entry.where}.signals: there is no signal {name[:20]}; '
                f'there are {", ".join(SIGNALS)}'
            )
            continue
        content = content if isinstance(content, dict) else {what: content}
        where = f'{entry.where}.signals.{name}'
        found[name] = Section(content, where, entry.problems, entry.folder)
    return found
