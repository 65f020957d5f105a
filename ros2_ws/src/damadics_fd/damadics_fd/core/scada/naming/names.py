# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Names of the faults, and what this mode says of those that it finds."""

import math
from dataclasses import dataclass

TOLD_BY_FLOW = frozenset({2, 3, 5, 6, 13, 18, 19})
EQUAL = 4.0  # nats within which two faults are not told apart
MOST_NAMED = 3
NAMES = {
    1: 'valve clogging',
    2: 'plug or seat sedimentation',
    3: 'plug or seat erosion',
    4: 'valve or bushing friction',
    5: 'external leakage',
    6: 'internal leakage',
    7: 'evaporation or critical flow',
    9: 'servomotor housing leak',
    10: 'diaphragm perforation',
    11: 'servomotor spring',
    12: 'electro-pneumatic transducer',
    13: 'stem position sensor',
    15: 'positioner feedback',
    16: 'supply pressure drop',
    17: 'pressure change across the valve',
    18: 'bypass opened',
    19: 'flow sensor',
}
GROUPS = {
    'medium': (7,),
    'pressures': (17,),
    'flow path or flow sensor': (5, 6, 18, 19),
    'plug, seat or position sensor': (2, 3, 13),
    'actuator or positioner': (1, 4, 9, 10, 11, 12, 15, 16),
}


@dataclass(frozen=True)
class Hypothesis:
    """
    One fault as an explanation.

    :param fault: number of the benchmark.
    :param strength: fitted strength; NaN where none can be given.
    :param cost: negative log-likelihood, nats; only differences mean something.
    """

    fault: int
    strength: float
    cost: float


@dataclass(frozen=True)
class Isolation:
    """
    Faults that explain the record since the onset, best first.

    :param t: time of the last sample used, s.
    :param samples: samples used.
    :param ranking: hypotheses in ascending order of cost.
    :param signs: what the signals show of it, with units.
    :param flow_ended: the flow meter was at the end of its range: causes that only the flow tells
        apart are guessed.
    """

    t: float
    samples: int
    ranking: tuple[Hypothesis, ...]
    signs: str = ''
    flow_ended: bool = False

    @property
    def best(self) -> Hypothesis:
        """Return the explanation that fits best."""
        return self.ranking[0]

    @property
    def group(self) -> str:
        """Return the group of the best explanation."""
        return group_of(self.best.fault)

    @property
    def candidates(self) -> tuple[int, ...]:
        """Return the faults that the record does not tell apart from the best one."""
        return tuple(h.fault for h in self.ranking if h.cost <= self.best.cost + EQUAL)

    def worse_than(self, before: 'Isolation') -> bool:
        """
        Tell whether an earlier ranking of the same fault knew what this one guesses.

        :param before: the earlier one.
        """
        told = self.best.fault in TOLD_BY_FLOW and before.best.fault in TOLD_BY_FLOW
        return told and before.visible and self.flow_ended and not before.flow_ended

    @property
    def visible(self) -> bool:
        """Tell whether the record says anything about the cause: no more than three are left."""
        return len(self.candidates) <= MOST_NAMED

    @property
    def confidence(self) -> dict[int, float]:
        """Return the probability of each candidate, all hypotheses equally likely before."""
        weights = {h.fault: math.exp(min(self.best.cost - h.cost, 0.0)) for h in self.ranking}
        total = sum(weights.values())
        return {fault: weights[fault] / total for fault in self.candidates}

    def text(self) -> str:
        """Return one line for the person who gets the alarm."""
        shown = f'; {self.signs}' if self.signs else ''
        if not self.visible:
            return f'cause not yet visible{shown}'
        named = ' or '.join(f'f{fault} {NAMES[fault]}' for fault in self.candidates)
        groups = dict.fromkeys(group_of(fault) for fault in self.candidates)
        size = '' if math.isnan(self.best.strength) else f', strength {self.best.strength:+.2f}'
        return f'{" / ".join(groups)}: {named}{size}{shown}'


def group_of(fault: int) -> str:
    """
    Return the group of a fault, 'not observable' where the signals do not show it.

    >>> group_of(4)
    'actuator or positioner'
    """
    return next((name for name, faults in GROUPS.items() if fault in faults), 'not observable')
