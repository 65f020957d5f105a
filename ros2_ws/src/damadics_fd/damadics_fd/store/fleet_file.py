# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The list of valves of a plant, as launch files, `run` and the fleet node take it."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from damadics_fd.core.record import Plain, Saved
from damadics_fd.store.yaml_text import read_yaml

NAME = re.compile(r'[a-z][a-z0-9_]*(/[a-z][a-z0-9_]*)*')
TOPICS = (
    'measurement',
    'fault_state',
    'estimate',
    'residual',
    'threshold',
    'fault_flag',
    'fault_event',
)
ENTRIES = {
    'parameters': str,
    'settings': dict,
    'topics': dict,
    'simulate': dict,
    'area': str,
}
OF_NODE = {'reference': 'estimator', 'alarm_folder': 'detector'}  # the rest is of both


class FleetError(ValueError):
    """The list of valves is wrong; the message has a line for every mistake."""


@dataclass(frozen=True)
class Valve:
    """One entry of the list."""

    name: str
    parameters: Path | None = None
    settings: Mapping[str, Plain] = field(default_factory=dict)
    topics: Mapping[str, str] = field(default_factory=dict)
    simulate: Mapping[str, Plain] = field(default_factory=dict)
    area: str = ''  # part of the plant

    @property
    def file(self) -> str:
        """Name of its files."""
        return self.name.replace('/', '__')

    def settings_of(self, node: str) -> Saved:
        """
        Return the settings of one node of the valve.

        :param node: `estimator` or `detector`.
        :return: parameters by name.
        """
        return {
            name: value for name, value in self.settings.items() if OF_NODE.get(name, node) == node
        }


def read_fleet(path: Path | str) -> list[Valve]:
    """
    Read a list of valves.

    :param path: YAML file as `config/fleet.yaml`.
    :return: the valves in the order of the file.
    :raises FleetError: listing every mistake.
    """
    path = Path(path)
    try:
        content = read_yaml(path.read_text('utf-8-sig'))
    except IsADirectoryError as problem:
        raise FleetError(f'{path} is a folder: give its list, {path / "fleet.yaml"}') from problem
    except OSError as problem:
        raise FleetError(f'{path}: {problem.strerror}') from problem
    except UnicodeDecodeError as problem:
        raise FleetError(f'{path}: not a text file in UTF-8') from problem
    except yaml.YAMLError as problem:
        raise FleetError(f'{path}: {problem}') from problem
    entries = content.get('valves') if isinstance(content, dict) else None
    if not isinstance(entries, dict) or not entries:
        raise FleetError(
            f'{path}: there is no entry "valves" with a name and settings for each valve'
        )
    problems: list[str] = []
    valves = [_valve(path, str(name), entry or {}, problems) for name, entry in entries.items()]
    problems += _shared(valves)
    if problems:
        raise FleetError('\n  '.join([f'{path}:', *problems]))
    return valves


def _valve(path: Path, name: str, entry: Plain, problems: list[str]) -> Valve:
    if not NAME.fullmatch(name):
        problems.append(f'{name}: a name consists of small letters, digits and _, such as lv101')
    if not isinstance(entry, dict):
        problems.append(f'{name}: give a mapping with {", ".join(ENTRIES)}')
        return Valve(name)
    given: Saved = {}
    for key, value in entry.items():
        kind = ENTRIES.get(key)
        if kind is None:
            problems.append(f'{name}: there is no entry {key}; there are {", ".join(ENTRIES)}')
        elif not isinstance(value, kind):
            problems.append(f'{name}: {key} is not a {"text" if kind is str else "mapping"}')
        else:
            given[key] = value
    topics = _mapping(given.get('topics'))
    for topic in topics:
        if topic not in TOPICS:
            problems.append(f'{name}: there is no topic {topic}; there are {", ".join(TOPICS)}')
    parameters = None
    if 'parameters' in given:
        parameters = (path.parent / str(given['parameters'])).expanduser()
        if not parameters.is_file():
            problems.append(f'{name}: {parameters} does not exist')
    return Valve(
        name,
        parameters,
        _mapping(given.get('settings')),
        {topic: str(place) for topic, place in topics.items()},
        _mapping(given.get('simulate')),
        str(given.get('area', '')),
    )


def _mapping(entry: Plain) -> Saved:
    return entry if isinstance(entry, dict) else {}


def _shared(valves: list[Valve]) -> list[str]:
    """Find files that two valves would overwrite in turn."""
    owner: dict[str, str] = {}
    named: dict[str, str] = {}
    problems = []
    for valve in valves:
        other = named.setdefault(valve.file, valve.name)
        if other != valve.name:
            problems.append(f'{valve.name}: its files have the names of those of {other}')
        reference = str(valve.settings.get('reference') or '')
        if reference and reference in owner:
            problems.append(f'{valve.name}: {owner[reference]} has the reference {reference} too')
        elif reference:
            owner[reference] = valve.name
    return problems
