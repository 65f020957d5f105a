# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Foreign valves: of catalogues, and drawn at random."""

from dataclasses import replace

import numpy as np

from .valve import POSITIONERS, Valve

CATALOGUE = {
    'G20': Valve(
        stroke=0.02,
        area=0.012,
        stiffness=60e3,
        mass=2.0,
        dead_volume=1.5e-3,
        plug_diameter=0.03,
        orifice=0.9e-9,
    ),
    'G38': Valve(),
    'G50': Valve(
        stroke=0.05,
        area=0.035,
        stiffness=90e3,
        mass=6.0,
        dead_volume=6e-3,
        dry=0.05,
        plug_diameter=0.06,
        orifice=3.2e-9,
    ),
    'G60': Valve(
        stroke=0.06,
        area=0.06,
        stiffness=110e3,
        mass=9.0,
        dead_volume=9e-3,
        plug_diameter=0.08,
        orifice=5e-9,
    ),
    'G100': Valve(
        stroke=0.1,
        area=0.09,
        stiffness=160e3,
        mass=16.0,
        dead_volume=18e-3,
        dry=0.02,
        plug_diameter=0.1,
        orifice=1.2e-8,
    ),
}


def random_valve(seed, **changes):
    """Return a valve of the catalogue with scattered build and a positioner."""
    rng = np.random.default_rng([seed, 17])
    name = list(CATALOGUE)[int(rng.integers(len(CATALOGUE)))]
    base = CATALOGUE[name]
    scattered = replace(
        base,
        stiffness=base.stiffness * (1 + rng.uniform(-0.04, 0.04)),
        preload=base.preload * (1 + rng.uniform(-0.15, 0.15)),
        dry=base.dry * rng.uniform(0.8, 1.25),
        static=rng.uniform(1.1, 1.6),
        viscous=base.viscous * rng.uniform(0.7, 1.4),
        positioner=POSITIONERS[int(rng.integers(4))],
        p1=base.p1 * rng.uniform(0.95, 1.05),
    )
    return replace(scattered, **changes)
