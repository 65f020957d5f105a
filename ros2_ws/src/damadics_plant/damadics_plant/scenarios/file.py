# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Scenarios from YAML files, checked entry by entry."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeGuard

import yaml
from damadics_fd.core.record import Plain, Saved

from damadics_plant.faults.catalogue import CATALOGUE, Fault
from damadics_plant.scenarios.level import LevelLoop
from damadics_plant.scenarios.recorded import read_recorded
from damadics_plant.scenarios.scenario import Scenario
from damadics_plant.scenarios.sources import Constant, RandomSteps, Sine, Source, Steps

_SIGNALS = ('cv', 'p1', 'p2', 't1')
_KEYS = ('description', 'duration', *_SIGNALS, 'faults')
_FAULT_KEYS = ('fault', 'strength', 'from', 'to', 'development', 'direction')


class ScenarioError(ValueError):
    """A scenario file is wrong; the message names file, key and what is allowed."""


def read_scenarios(path: Path) -> dict[str, Scenario]:
    """
    Read a file of scenarios.

    :param path: a YAML file, a mapping of names to scenarios; names with a leading dot are
        templates for YAML's merge key and no scenarios themselves.
    :return: scenarios by name.
    :raises ScenarioError: if the file is missing or wrong; lists every error.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding='utf-8'))
    except OSError as error:
        raise ScenarioError(f'{path}: cannot be read: {error.strerror}') from error
    except yaml.YAMLError as error:
        raise ScenarioError(f'{path}: is no YAML: {" ".join(str(error).split())}') from error
    if not isinstance(content, dict):
        raise ScenarioError(f'{path}: wants a mapping of scenario names to scenarios')
    errors: list[str] = []
    scenarios = {}
    for name, entry in content.items():
        if not str(name).startswith('.'):
            reader = _Reader(f'{path}: {name}', errors)
            scenario = reader.scenario(str(name), entry, path.parent)
            if scenario:
                scenarios[str(name)] = scenario
    if errors:
        raise ScenarioError('\n'.join(errors))
    return scenarios


class _Reader:
    """Reads one scenario, collecting all errors with the place where they are."""

    def __init__(self, where: str, errors: list[str]) -> None:
        self.where = where
        self.errors = errors

    def wrong(self, key: str, message: str) -> None:
        self.errors.append(f'{self.where}: {key}: {message}')

    def keys(self, entry: Plain, key: str, allowed: tuple[str, ...]) -> TypeGuard[Saved]:
        if not isinstance(entry, dict):
            self.wrong(key, f'wants a mapping with {", ".join(allowed)}')
            return False
        unknown = [str(k) for k in entry if k not in allowed]
        for k in unknown:
            self.wrong(f'{key}.{k}' if key else k, f'is unknown; allowed: {", ".join(allowed)}')
        return not unknown

    def number(
        self, key: str, value: Plain, low: float = -math.inf, high: float = math.inf
    ) -> float:
        try:
            if isinstance(value, bool) or not isinstance(value, int | float | str):
                raise ValueError
            number = float(value)  # PyYAML reads 3.5e6 as a string
        except (ValueError, OverflowError):
            self.wrong(key, f'{value!r} is no number')
            return math.nan
        if not low <= number <= high:
            self.wrong(key, f'{number:g} is not within {low:g}..{high:g}')
        return number

    def scenario(self, name: str, entry: Plain, folder: Path) -> Scenario | None:
        before = len(self.errors)
        if not self.keys(entry, '', _KEYS):
            return None
        if 'duration' not in entry:
            self.wrong('duration', 'is missing; wants the length of the run in s')
        duration = self.number('duration', entry.get('duration', 0), 0, 1e9)
        sources = {key: self.source(key, entry[key], folder) for key in _SIGNALS if key in entry}
        faults = entry.get('faults') or []
        if not isinstance(faults, list):
            self.wrong('faults', f'wants a list of mappings with {", ".join(_FAULT_KEYS)}')
            faults = []
        found = [self.fault(f'faults[{i}]', fault) for i, fault in enumerate(faults)]
        if len(self.errors) > before:
            return None
        return Scenario(
            name,
            duration,
            str(entry.get('description', '')),
            faults=tuple(fault for fault in found if fault),
            **{key: source for key, source in sources.items() if source},
        )

    def fault(self, key: str, entry: Plain) -> Fault | None:
        if not self.keys(entry, key, _FAULT_KEYS):
            return None
        if 'fault' not in entry or entry['fault'] not in CATALOGUE:
            self.wrong(f'{key}.fault', f'{entry.get("fault")!r} is not one of f1..f19')
            return None
        before = len(self.errors)
        end = entry.get('to', math.inf)
        values = {
            'strength': self.number(f'{key}.strength', entry.get('strength', 1)),
            'start': self.number(f'{key}.from', entry.get('from', 0)),
            'development': self.number(f'{key}.development', entry.get('development', 0)),
            'end': math.inf if end in ('inf', None) else self.number(f'{key}.to', end),
        }
        direction = self.number(f'{key}.direction', entry.get('direction', 1))
        if len(self.errors) > before:
            return None
        try:
            return Fault(entry['fault'], direction=int(direction), **values)
        except (ValueError, OverflowError) as error:
            self.wrong(key, str(error))
            return None

    def source(self, key: str, entry: Plain, folder: Path) -> Source | None:
        if not isinstance(entry, dict):
            return Constant(self.number(key, entry))
        if len(entry) != 1 or next(iter(entry)) not in _SOURCES:
            self.wrong(key, f'wants a number or one of {", ".join(_SOURCES)}')
            return None
        if key != 'cv' and 'level_loop' in entry:
            self.wrong(key, 'level_loop drives cv only')
            return None
        kind, arguments = next(iter(entry.items()))
        before = len(self.errors)
        try:
            source = _SOURCES[kind](self, f'{key}.{kind}', arguments, folder)
        except ValueError as error:
            self.wrong(key, str(error))
            return None
        return source if len(self.errors) == before else None


def _steps(reader: _Reader, key: str, pairs: Plain, _: Path) -> Source | None:
    rows = pairs if isinstance(pairs, list) else [None]
    whole = [row for row in rows if isinstance(row, list) and len(row) == 2]
    if len(whole) < len(rows):
        reader.wrong(key, 'wants a list of [time in s, value]')
        return None
    times = tuple(reader.number(f'{key}[{i}][0]', t) for i, (t, _) in enumerate(whole))
    values = tuple(reader.number(f'{key}[{i}][1]', v) for i, (_, v) in enumerate(whole))
    return Steps(times, values)


def _sine(reader: _Reader, key: str, entry: Plain, _: Path) -> Source | None:
    names = ('mean', 'amplitude', 'frequency', 'phase')
    if not reader.keys(entry, key, names):
        return None
    return Sine(*(reader.number(f'{key}.{name}', entry.get(name, 0)) for name in names))


def _recorded(reader: _Reader, key: str, entry: Plain, folder: Path) -> Source | None:
    if not reader.keys(entry, key, ('file', 'column', 'scale', 'hold')):
        return None
    for name in ('file', 'column'):
        if not isinstance(entry.get(name), str):
            reader.wrong(f'{key}.{name}', f'{entry.get(name)!r} is no text')
            return None
    scale = reader.number(f'{key}.scale', entry.get('scale', 1))
    file, column = str(entry['file']), str(entry['column'])
    return read_recorded(folder / file, column, scale, bool(entry.get('hold', False)))


def _level_loop(reader: _Reader, key: str, entry: Plain, folder: Path) -> Source | None:
    names = ('set_point', 'gain', 'reset_time', 'bias', 'area', 'span', 'period')
    entry = entry or {}
    if not reader.keys(entry, key, (*names, 'draw')):
        return None
    values: dict[str, Any] = {
        name: reader.number(f'{key}.{name}', entry[name]) for name in names if name in entry
    }
    if 'draw' in entry:
        values['draw'] = reader.source(f'{key}.draw', entry['draw'], folder)
    return LevelLoop(**values)


def _random_steps(reader: _Reader, key: str, entry: Plain, _: Path) -> Source | None:
    names = ('low', 'high', 'shortest', 'longest', 'seed')
    entry = entry or {}
    if not reader.keys(entry, key, names):
        return None
    values: dict[str, Any] = {
        name: reader.number(f'{key}.{name}', entry[name]) for name in names if name in entry
    }
    if 'seed' in values:
        values['seed'] = int(values['seed'])
    return RandomSteps(**values)


_SOURCES: dict[str, Callable[[_Reader, str, Plain, Path], Source | None]] = {
    'steps': _steps,
    'sine': _sine,
    'random_steps': _random_steps,
    'recorded': _recorded,
    'level_loop': _level_loop,
}
