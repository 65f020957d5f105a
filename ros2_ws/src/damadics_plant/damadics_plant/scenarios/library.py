# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Scenarios by name."""

import re
from dataclasses import replace
from difflib import get_close_matches
from functools import cache
from pathlib import Path

from damadics_plant.faults.catalogue import CATALOGUE, Fault
from damadics_plant.scenarios.file import ScenarioError, read_scenarios
from damadics_plant.scenarios.scenario import Scenario

_FOLDER = Path(__file__).parent


def scenario_names() -> list[str]:
    """
    List the scenarios that come with the plant.

    :return: their names, in the order of the files.

    >>> len([name for name in scenario_names() if name.startswith('f')])
    44
    """
    return list(_built_in())


def load_scenario(name: str) -> Scenario:
    """
    Find a scenario.

    :param name: of a built-in scenario; `FILE.yaml` with a single scenario, or
        `FILE.yaml:NAME`; or `fN@S`, `nominal` with fault fN of signed strength S from 900 s.
    :return: the scenario.
    :raises ScenarioError: if there is none or its file is wrong.
    """
    if name in _built_in():
        return _built_in()[name]
    free = re.fullmatch(r'(f\d+)@(-?[\d.]+)', name)
    if free:
        fault = Fault(free[1], float(free[2]), start=900.0)
        return replace(
            _built_in()['nominal'],
            name=name,
            faults=(fault,),
            description=f'{CATALOGUE[free[1]].name}, abrupt {free[2]}',
        )
    path, extension, entry = name.partition('.yaml')
    if not extension:
        near = get_close_matches(name, scenario_names(), 1)
        hint = f'do you mean {near[0]}? ' if near else ''
        hint += 'See --list, or give FILE.yaml:NAME'
        raise ScenarioError(f'scenario: there is no {name!r}; {hint}')
    scenarios = read_scenarios(Path(path + '.yaml'))
    entry = entry.lstrip(':')
    if not entry and len(scenarios) == 1:
        return next(iter(scenarios.values()))
    if entry not in scenarios:
        raise ScenarioError(
            f'{path}.yaml: scenario {entry!r} is not one of {", ".join(scenarios)}'
        )
    return scenarios[entry]


@cache
def _built_in() -> dict[str, Scenario]:
    return {
        name: scenario
        for path in sorted(_FOLDER.glob('*.yaml'), key=lambda p: p.name != 'paper.yaml')
        for name, scenario in read_scenarios(path).items()
    }
