# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The cases of a campaign: standard scenarios, free strengths, what a user brings along."""

import re
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache

from damadics_evaluate.indices import T_ON, T_OVER, Zones
from damadics_evaluate.scenarios.own import OwnFault, load_fault, load_own_scenario

NOMINAL = 'nominal'
DEVELOPMENT = {'S': 0.0, 'M': 0.0, 'B': 0.0, 'I': 86400.0}
SHORT_DEVELOPMENT = {4: 3600.0, 13: 900.0, 17: 3600.0}
STANDARD = {
    1: 'SMB',
    2: 'BI',
    3: 'I',
    4: 'I',
    5: 'I',
    6: 'I',
    7: 'SMB',
    8: 'SMB',
    9: 'I',
    10: 'SMB',
    11: 'BI',
    12: 'SMB',
    13: 'SMBI',
    14: 'SMB',
    15: 'B',
    16: 'SMB',
    17: 'BI',
    18: 'SMBI',
    19: 'SMB',
}
SCENARIOS = tuple(f'f{fault}_{mode}' for fault, modes in STANDARD.items() for mode in modes)


@dataclass(frozen=True)
class Case:
    """
    One scenario of a campaign.

    :param name: such as f4_I, f12@-0.37, my.yaml:mine, my.py:fault.
    :param fault: number of the fault, 0 for none and for a fault of one's own.
    :param zones: its time zones.
    :param feed: the fault-free scenario with the same inputs: 'nominal', or my.yaml:mine.
    :param own: the fault of one's own, where it is one.
    """

    name: str
    fault: int
    zones: Zones
    feed: str = NOMINAL
    own: OwnFault | None = None

    @property
    def abrupt(self) -> bool:
        """Tell whether the fault comes at once."""
        return self.zones.t_hor <= self.zones.t_from + T_OVER

    @property
    def duration(self) -> int:
        """Return the length of the run, s."""
        return int(self.zones.t_hor)


@cache
def case(name: str) -> Case:
    """
    Return a case by name.

    :param name: f1_S .. f19_B; an abrupt fault of any strength such as f12@-0.37; a scenario
        my.yaml:mine; a fault my.py:name under the inputs of the benchmark.
    :return: the case.
    :raises ValueError: for a name that is none of these, or a file that is wrong.

    >>> case('f4_I').zones.t_hor
    5100.0
    >>> case('f12@-0.37').fault
    12
    """
    if '.yaml' in name:
        return _scenario(name)
    if '.py:' in name:
        own = load_fault(name)
        zones = Zones(t_from=own.start, t_hor=own.start + own.development + T_OVER)
        return Case(name, 0, zones, own=own)
    free = re.fullmatch(r'f(\d+)@(-?[\d.]+)', name)
    if free and int(free[1]) in STANDARD and abs(float(free[2])) <= 1.0:
        return Case(name, int(free[1]), Zones())
    match = re.fullmatch(r'f(\d+)_([SMBI])', name)
    if name not in SCENARIOS or match is None:
        near = get_close_matches(name, SCENARIOS, 1)
        raise ValueError(
            f'no scenario {name}: do you mean {near[0]}?'
            if near
            else f'no scenario {name}: one of {", ".join(SCENARIOS)}, f11@0.37, my.yaml:mine or '
            'my.py:fault'
        )
    fault, mode = int(match[1]), match[2]
    t_fd = DEVELOPMENT[mode]
    if mode == 'I':
        t_fd = SHORT_DEVELOPMENT.get(fault, t_fd)
    return Case(name, fault, Zones.of_development(t_fd))


def _scenario(name: str) -> Case:
    """Return the case of a scenario file: zones from its first fault and its duration."""
    scenario = load_own_scenario(name)
    if not scenario.faults:
        raise ValueError(f'{name}: has no fault; nothing could be found in it')
    first = scenario.faults[0]
    if not 0.0 < first.start < scenario.duration:
        raise ValueError(
            f'{name}: its fault starts at {first.start:g} s, it lasts {scenario.duration:g} s: '
            'let it start within, after a fault-free part'
        )
    zones = Zones(
        t_on=min(T_ON, first.start / 3.0),
        t_from=first.start,
        t_hor=scenario.duration,
        t_to=first.end,
    )
    return Case(name, first.number, zones, feed=name)
