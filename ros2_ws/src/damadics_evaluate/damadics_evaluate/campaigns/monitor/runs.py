# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The runs of the studies: random valves, control values and pressures."""

from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from typing import TypedDict, Unpack

import numpy as np
from damadics_fd.core.monitor import run
from damadics_fd.core.settings import Settings
from damadics_plant import Fault, LuGreActuator, Scenario, simulate
from damadics_plant.scenarios.sources import RandomSteps, Sine

from damadics_evaluate.campaigns.monitor.sums import Summary, summary

RATE = 200.0


FRICTION, SPRING = 'f4', 'f11'


class Case(TypedDict, total=False):
    """What differs from a fault-free run, as `random_run` takes it."""

    fault: str
    strength: float
    start: float  # s
    development: float  # s
    duration: float  # s
    model: str


# the approximator alone: the signature's own alarm is measured by its own campaign
APPROXIMATOR = Settings.for_mode('monitor', signature=False, own_alarm=False)


EXACT = APPROXIMATOR.replace(ps_max=1e8)  # ps carries the plug force too and may be negative


PLACES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.99, 1.0)  # of the plug table


def random_valve(rng: np.random.Generator) -> LuGreActuator:
    """Draw a valve around the nominal one that the settings describe."""
    coulomb = 25.0 * rng.uniform(0.8, 1.2)
    return LuGreActuator(
        stiffness=60892.0 * rng.uniform(0.96, 1.04),
        coulomb=coulomb,
        static=coulomb * rng.uniform(1.2, 1.6),
        viscous=1500.0 * rng.uniform(0.8, 1.2),
    )


def random_scenario(seed: int, duration: float, *faults: Fault) -> tuple[Scenario, LuGreActuator]:
    """Draw a random control value, pulsating pressures and a valve."""
    rng = np.random.default_rng([seed, 4])
    scenario = Scenario(
        f'random_{seed}',
        duration,
        cv=RandomSteps(seed=seed),
        p1=Sine(3.5e6, 175e3, 0.1, rng.uniform(0.0, 2 * np.pi)),
        p2=Sine(2.6e6, 26e3, 1.0 / np.pi, rng.uniform(0.0, 2 * np.pi)),
        faults=faults,
    )
    return scenario, random_valve(rng)


def random_run(
    seed: int,
    fault: str | None = None,
    strength: float = 1.0,
    start: float = 70.0,
    development: float = 0.0,
    duration: float = 120.0,
    model: str = 'lugre',
    rate: float = RATE,
    noise: bool = True,
) -> Mapping[str, np.ndarray]:
    """Simulate one random run."""
    faults = (
        ()
        if fault is None
        else (
            Fault(fault, abs(strength), start, development, direction=1 if strength > 0 else -1),
        )
    )
    scenario, valve = random_scenario(seed, duration, *faults)
    return simulate(
        scenario, rate=rate, model=valve if model == 'lugre' else model, noise=noise, seed=seed
    )


def exact_force(columns: Mapping[str, np.ndarray], seed: int) -> Mapping[str, np.ndarray]:
    """
    Put the benchmark's noise on x1 alone and let the force be the plant's own.

    Its noise is 1e-3 of the spring force over one stroke. The plug force goes into ps, with
    p1 = p2, for else the noise of x1 would enter by the place at which it is computed.
    """
    c, rng, n = EXACT, np.random.default_rng([seed, 5]), len(columns['stamp'])
    plug = (
        (columns['p1'] - columns['p2'])
        * np.pi
        * c.plug_diameter**2
        / 4.0
        / np.interp(columns['x1'], PLACES, c.plug_table)
    )
    force = 1e-3 * c.stiffness * c.stroke * rng.standard_normal(n) - plug
    hum = 2.5e-3 * np.sin(2 * np.pi * (50.0 * columns['stamp'] * 1e-9 + rng.random()))
    return {
        **columns,
        'x1': columns['x1'] + 1.41e-3 * rng.standard_normal(n) + hum,
        'p1': columns['p2'],
        'ps': columns['ps'] + force / c.area,
    }


def paper_run(
    seed: int,
    model: str,
    fault: str | None = None,
    development: float = 0.0,
    force_exact: bool = False,
) -> Summary:
    base = simulate('paper_nominal', rate=RATE, duration=0.0).scenario
    faults = () if fault is None else (Fault(fault, 1.0, 70.0, development),)
    scenario = Scenario(
        'paper', 120.0, cv=base.cv, p1=base.p1, p2=base.p2, t1=base.t1, faults=faults
    )
    columns = simulate(scenario, rate=RATE, model=model, noise=not force_exact, seed=seed)
    if force_exact:
        return summary(run(exact_force(columns, seed), EXACT))
    return summary(run(columns, APPROXIMATOR))


def hour(seed: int, fault: str, start: float) -> Summary:
    result = run(random_run(seed, fault, 1.0, start, 3600.0, 3600.0 + start), APPROXIMATOR)
    row = summary(result)
    flags = result.decisions['fault']
    first = np.flatnonzero(flags)
    row['alarms'] = row['alarms'][:1]
    row['strength_at_alarm'] = ((row['alarms'][0] - start) / 3600.0) if row['alarms'] else None
    row['stays_flagged'] = bool(flags[first[0] :].all()) if len(first) else False
    return row


def irregular(seed: int, rate: float, **case: Unpack[Case]) -> Summary:
    """Sample a fast run at jittered instants, drop every tenth sample at random."""
    fast = random_run(seed, rate=1000.0, **case)
    rng = np.random.default_rng([seed, 9])
    period = 1000.0 / rate
    n = int((len(fast['stamp']) - 1) / period)
    instants = (np.arange(n) + rng.uniform(-0.5, 0.5, n)) * period
    if rate == 1000.0:  # the run is no finer: jitter the stamps by moving the samples with them
        columns = jittered(fast, rng)
    else:
        rows = np.unique(np.clip(np.round(instants).astype(int), 0, len(fast['stamp']) - 1))
        columns = {name: column[rows] for name, column in fast.items()}
    keep = rng.random(len(columns['stamp'])) >= 0.1
    columns = {name: column[keep] for name, column in columns.items()}
    return summary(run(columns, APPROXIMATOR.replace(sample_rate=rate)))


def jittered(fast: Mapping[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
    t = fast['stamp'] * 1e-9
    moved = np.sort(t + rng.uniform(-0.5e-3, 0.5e-3, len(t)))[1:-1]
    columns = {
        name: np.interp(moved, t, column) for name, column in fast.items() if name != 'stamp'
    }
    return {'stamp': np.round(moved * 1e9).astype(np.int64), **columns}


def one(seed: int, settings: Settings = APPROXIMATOR, **case: Unpack[Case]) -> Summary:
    return summary(run(random_run(seed, **case), settings))


def one_exact(seed: int, **case: Unpack[Case]) -> Summary:
    return summary(run(exact_force(random_run(seed, noise=False, **case), seed), EXACT))


def many(job: Callable[[int], Summary], seeds: range, workers: int) -> list[Summary]:
    if workers == 1:
        return [job(seed) for seed in seeds]
    with ProcessPoolExecutor(workers) as pool:
        return list(pool.map(job, seeds))
