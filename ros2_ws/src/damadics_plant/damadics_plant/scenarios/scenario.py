# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A scenario: what drives the plant, which faults it meets, how long it runs."""

from dataclasses import dataclass, field

from damadics_plant.faults.catalogue import Fault
from damadics_plant.scenarios.sources import Constant, Source


@dataclass(frozen=True)
class Scenario:
    """
    One experiment.

    >>> from damadics_plant import Fault, Scenario, simulate
    >>> simulate(Scenario('mine', 10.0, faults=(Fault('f1', 0.5),))).x1.shape
    (4001,)
    """

    name: str
    duration: float
    """[s]; both ends are sampled."""
    description: str = ''
    cv: Source = field(default_factory=lambda: Constant(0.5))
    """Control value, 0 open .. 1 closed."""
    p1: Source = field(default_factory=lambda: Constant(3.5e6))
    """Inlet pressure [Pa]."""
    p2: Source = field(default_factory=lambda: Constant(2.6e6))
    """Outlet pressure [Pa]."""
    t1: Source = field(default_factory=lambda: Constant(20.0))
    """Temperature of the medium [degC]."""
    faults: tuple[Fault, ...] = ()
