# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Scenarios and faults that a user brings along: my.yaml:mine, my.py:fault."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Protocol

import numpy as np
from damadics_plant import Actuator, Scenario, load_scenario

from damadics_evaluate.columns import Columns
from damadics_evaluate.loading import digest_of, load_object

FREE_START = 900.0


class ChangesValve(Protocol):
    """Return the valve with a fault: other constants, at a strength of 0..1."""

    def __call__(self, actuator: Actuator, strength: float) -> Actuator:
        """Return the changed constants."""
        ...


class ChangesSignals(Protocol):
    """Return what a faulty instrument shows, at strengths of 0..1 sample by sample."""

    def __call__(self, columns: Columns, strength: np.ndarray) -> Columns:
        """Return the changed columns."""
        ...


@dataclass(frozen=True)
class OwnFault:
    """
    A fault written outside this package.

    :param name: my.py:name.
    :param valve: changes the constants of the actuator; None where it does not.
    :param signals: changes the recorded signals; None where it does not.
    :param strength: final strength.
    :param start: s.
    :param development: time from nothing to the final strength, s.
    """

    name: str
    valve: ChangesValve | None
    signals: ChangesSignals | None
    strength: float = 1.0
    start: float = FREE_START
    development: float = 0.0

    def at(self, t: np.ndarray) -> np.ndarray:
        """
        Return the strength over time.

        :param t: instants, s.
        """
        if self.development <= 0.0:
            return np.where(t >= self.start, self.strength, 0.0)
        return self.strength * np.clip((t - self.start) / self.development, 0.0, 1.0)


@cache
def load_fault(name: str) -> OwnFault:
    """
    Load a fault.

    :param name: FILE.py:CLASS; the class has `valve(actuator, strength)`,
        `signals(columns, strength)` or both, and may state `strength`, `start`, `development`.
    :return: the fault.
    :raises ValueError: where there is none, or it is not of that form.
    """
    made = load_object(name)
    fault = made() if isinstance(made, type) else made
    valve: Callable[..., Actuator] | None = getattr(fault, 'valve', None)
    signals: Callable[..., Columns] | None = getattr(fault, 'signals', None)
    if not callable(valve) and not callable(signals):
        raise ValueError(
            f'{name}: has neither valve(actuator, strength) nor signals(columns, strength)'
        )
    values = {
        key: float(getattr(fault, key, default))
        for key, default in (('strength', 1.0), ('start', FREE_START), ('development', 0.0))
    }
    if values['start'] < 100.0 or values['development'] < 0.0:
        raise ValueError(f'{name}: start must be 100 s or more, development 0 or more')
    return OwnFault(name, valve, signals, **values)


@cache
def load_own_scenario(name: str) -> Scenario:
    """
    Load a scenario file of the plant.

    :param name: FILE.yaml:NAME, or FILE.yaml with one scenario.
    :raises ValueError: where it is wrong; says where.
    """
    return load_scenario(name)


def digest(name: str) -> str:
    """Return a hash of the file behind a scenario or fault of one's own."""
    extension = '.yaml' if '.yaml' in name else '.py'
    return digest_of(Path(name.partition(extension)[0] + extension))
