# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Runs of the simulated plant at 1 Hz, cached on disk, with fresh sensor noise at every use.

Integrating a plant day takes far longer than judging it. The trajectory (with benchmark noise on
the plant's own copy of CV, from `plant_seed`) is therefore kept, and the sensor noise of a run is
added from that run's seed.
"""

import hashlib
import os
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from damadics_fd.core import valve
from damadics_plant import Simulator, load_scenario
from damadics_plant import __path__ as plant_path

from damadics_evaluate.columns import Columns, Floats, rows_of
from damadics_evaluate.scenarios.cases import NOMINAL, case
from damadics_evaluate.scenarios.own import OwnFault, digest, load_fault

NOISE = 1.414e-3  # standard deviation of the benchmark's sensor noise, share of full scale
HOUR = 3600
DAY = 86400
PLANT_SEEDS = 20  # different disturbances of CV inside the plant; a run's seed picks one
LONG_PLANT_SEEDS = 4  # the same for runs of a day, each of which takes seconds to integrate
LEARNING, FREE = 10_000, 20_000  # added to it, so that fault-free records share none
CACHE_VARIABLE = 'DAMADICS_FD_CACHE'
FREE_OF_FAULTS = ' without its faults'


def cache_directory() -> Path:
    """Return where trajectories are kept: $DAMADICS_FD_CACHE or the user's cache directory."""
    stated = os.environ.get(CACHE_VARIABLE)
    if stated:
        return Path(stated)
    base = os.environ.get('XDG_CACHE_HOME')
    return (Path(base) if base else Path.home() / '.cache') / 'damadics_fd'


@cache
def plant_hash() -> str:
    """Return a hash of the plant's source, so that another plant makes new trajectories."""
    digest_of_sources = hashlib.sha256()
    for folder in (plant_path[0], valve.__path__[0]):
        for file in sorted(Path(folder).rglob('*.py')):
            digest_of_sources.update(file.read_bytes())
    return digest_of_sources.hexdigest()[:12]


def trajectory(name: str, duration: int, plant_seed: int) -> tuple[Floats, Floats]:
    """
    Return a run of the plant at 1 Hz without sensor noise.

    :param name: case, 'nominal', or a scenario file followed by FREE_OF_FAULTS.
    :param duration: seconds.
    :param plant_seed: seed of the disturbance of CV inside the plant.
    :return: rows t, CV, X', P1', P2', T1', F' (0..1) and the fault strength.
    """
    own = '.py:' in name or '.yaml' in name
    stem = re.sub(r'[^\w@.+-]', '_', Path(name).name)
    if own:
        place = hashlib.sha256(name.encode()).hexdigest()[:8]
        stem = f'{stem}_{place}_{digest(name.removesuffix(FREE_OF_FAULTS))}'
    directory = cache_directory() / 'trajectories' / plant_hash()
    file = directory / f'{stem}_{duration}_{plant_seed}.npy'
    if file.exists():
        stored = np.load(file)
    else:
        columns = _simulated(name, float(duration), plant_seed)
        stored = np.column_stack((rows_of(columns), columns['strength']))
        directory.mkdir(parents=True, exist_ok=True)
        partial = file.with_suffix(f'.{os.getpid()}.tmp')
        with partial.open('wb') as stream:
            np.save(stream, stored)
        partial.replace(file)
    return stored[:, :7], stored[:, 7]


def _simulated(name: str, duration: float, seed: int) -> Columns:
    """Return the plant's answer to a case."""
    fault: OwnFault | None = None
    if '.py:' in name:
        fault, name = load_fault(name), NOMINAL
    scenario = load_scenario(name.removesuffix(FREE_OF_FAULTS))
    if name.endswith(FREE_OF_FAULTS):
        scenario = replace(scenario, faults=())
    plant = Simulator(scenario, rate=1.0, duration=duration, noise='cv', seed=seed)
    if fault is None:
        return plant.advance(plant.samples)
    return with_fault(plant, fault)


def with_fault(plant: Simulator, fault: OwnFault) -> Columns:
    """
    Run a plant with a fault of one's own to its end.

    :param plant: at the start of a scenario, one sample per second.
    :param fault: changes the valve second by second, and what is recorded.
    :return: columns as of the plant, `strength` that of the fault.
    :raises ValueError: where the fault returns something else than it should.
    """
    t = np.arange(plant.samples) / plant.rate
    strength = fault.at(t)
    parts, done = [], 0
    while done < len(t):
        last = done + 1
        if fault.valve is not None:
            plant.replace_actuator(fault.valve(plant.actuator, float(strength[done])))
            while last < len(t) and strength[last] == strength[done]:
                last += 1
        else:
            last = len(t)
        parts.append(plant.advance(last - done))
        done = last
    columns = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    if fault.signals is not None:
        changed = fault.signals({key: value.copy() for key, value in columns.items()}, strength)
        if set(changed) != set(columns) or any(len(v) != len(t) for v in changed.values()):
            raise ValueError(f'{fault.name}: signals() must return all columns, all samples')
        columns = dict(changed)
    return {**columns, 'strength': strength}


def noisy(samples: Floats, seed: int, purpose: str) -> Floats:
    """
    Return the samples with benchmark sensor noise; CV is known undisturbed.

    :param samples: rows of `trajectory`.
    :param seed: seed of the run.
    :param purpose: name of the run, so that no two runs of one seed share noise.
    :return: a new array. At integer seconds the 50 Hz term of the benchmark is zero.
    """
    digest = hashlib.sha256(f'{purpose}/{seed}'.encode()).digest()
    generator = np.random.default_rng(int.from_bytes(digest[:8], 'little'))
    out = samples.copy()
    out[:, 2:] = np.clip(out[:, 2:] + generator.normal(0.0, NOISE, (len(out), 5)), 0.0, 1.0)
    return out


def scenario_run(name: str, seed: int) -> tuple[Floats, Floats]:
    """Return samples and strength of one scenario under one seed."""
    duration = case(name).duration
    clean, strength = trajectory(
        name, duration, seed % (LONG_PLANT_SEEDS if duration >= DAY else PLANT_SEEDS)
    )
    return noisy(clean, seed, name), strength


def learning_hour(seed: int, feed: str = NOMINAL) -> Floats:
    """
    Return the fault-free hour that belongs to a seed.

    :param feed: scenario whose inputs it has.
    """
    name = feed if feed == NOMINAL else feed + FREE_OF_FAULTS
    clean, _ = trajectory(name, HOUR, seed % PLANT_SEEDS + LEARNING)
    return noisy(clean[:HOUR], seed, 'learning hour')


def nominal_day(seed: int) -> Floats:
    """Return a fault-free day that belongs to a seed, started afresh."""
    clean, _ = trajectory('nominal', DAY, seed % (10 * PLANT_SEEDS) + FREE)
    return noisy(clean[:DAY], seed, 'nominal day')
