# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Valves of random build on both plants, and what the parts read from a result."""

from collections.abc import Iterable

import numpy as np
from damadics_fd.core.decision.alarm import RAISED
from damadics_fd.core.result import Result
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.state import CAUSE_ELASTIC, CAUSE_SUPPLY, CAUSES
from damadics_plant import Actuator, Fault, LuGreActuator, Scenario, simulate
from damadics_plant.actuator.parameters import RANGES
from damadics_plant.scenarios.disturbance import CHAMBER_NOISE, HUM, WHITE
from damadics_plant.scenarios.sources import RandomSteps, Sine, Source, Steps

RATE = 200.0


SETTINGS = Settings.for_mode('monitor', t_learn=60.0)


FRICTION = {'friction_up', 'friction_down', 'stick_play'}


ELASTIC = set(CAUSES[CAUSE_ELASTIC:CAUSE_SUPPLY])


Columns = dict[str, np.ndarray]


Build = tuple[tuple[Fault, ...], dict[str, float]]  # faults and constants of a plant
NOISE = {'x1', 'ps'}


def paper_cv(duration: float) -> Steps:
    starts, values = (0, 20, 30, 40, 50, 60, 80), (1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0)
    laps = range(int(duration // 120) + 1)
    return Steps([120.0 * k + s for k in laps for s in starts], list(values) * len(laps))


def plant_run(
    seed: int,
    duration: float,
    model: str = 'lugre',
    faults: Iterable[Fault] = (),
    cv: str | Steps = 'random',
    **constants: float,
) -> Columns:
    """Simulate one valve of a random build; see the module for its spread and noise."""
    rng = np.random.default_rng(seed)
    build: dict[str, float] = {'stiffness': 60892.0 * (1 + rng.uniform(-0.04, 0.04))}
    dry, ratio = 25.0 * (1 + rng.uniform(-0.2, 0.2)), rng.uniform(1.2, 1.6)
    viscous = 1500.0 * (1 + rng.uniform(-0.2, 0.2))
    phase = rng.uniform(0.0, 2 * np.pi, 2)
    actuator: Actuator
    if model == 'lugre':
        build.update(coulomb=dry, static=dry * ratio, viscous=viscous)
        actuator = LuGreActuator(**{**build, **constants})
    else:
        actuator = Actuator(**{**build, **constants})
    drive: Source = cv if isinstance(cv, Steps) else paper_cv(duration)
    if cv == 'random':
        drive = RandomSteps(seed=seed)
    scenario = Scenario(
        'campaign',
        duration,
        cv=drive,
        faults=tuple(faults),
        p1=Sine(3.5e6, 175e3, 0.1, phase[0]),
        p2=Sine(2.6e6, 26e3, 1 / np.pi, phase[1]),
    )
    columns = dict(simulate(scenario, RATE, actuator, noise='cv', seed=seed))
    disturb(columns, np.random.default_rng(seed + 1))
    return columns


def disturb(columns: Columns, rng: np.random.Generator) -> None:
    """Add the benchmark's noise to the signals that the force is computed from."""
    t = columns['stamp'] * 1e-9
    for name in sorted(NOISE):
        white = rng.standard_normal(len(t))
        if name == 'ps':
            columns[name] = columns[name] + CHAMBER_NOISE * white
        else:
            hum = HUM * np.sin(2 * np.pi * 50.0 * t + 0.3)
            columns[name] = columns[name] + RANGES[name] * (hum + WHITE * white)


def stiffened(
    model: str,
    change: float,
    start: float,
    development: float = 0.0,
) -> tuple[tuple[Fault, ...], dict[str, float]]:
    """Return faults and constants that change the stiffness by a share, on either plant."""
    if model == 'lugre' or change <= 0.0:
        strength = change if model == 'lugre' else -change
        return (
            Fault('f11', abs(strength), start, development, direction=1 if strength >= 0 else -1),
        ), {}
    # f11 only softens DABLib's spring: a stiffer one is softened until the change
    return (Fault('f11', change / (1 + change), 0.0, end=start),), {
        'stiffness': 60892.0 * (1 + change)
    }


def family(cause: str) -> str:
    return 'friction' if cause in FRICTION else 'elastic' if cause in ELASTIC else ''


def first_alarm(result: Result, after: float) -> float:
    """Return the time of the first alarm of either source, NaN if there is none."""
    times = [event.stamp * 1e-9 for event in result.events if event.transition == RAISED]
    return min((t for t in times if t >= after), default=np.nan)


def causes_at(result: Result, t: float) -> str:
    row = min(int(t * RATE), len(result.decisions) - 1)
    return CAUSES[result.decisions['cause'][row]]


def share(part: int, whole: int) -> float:
    return round(part / max(whole, 1), 4)


def quantiles(values: list[float]) -> list[float] | None:
    return [round(float(q), 1) for q in np.quantile(values, [0.5, 0.9])] if values else None
