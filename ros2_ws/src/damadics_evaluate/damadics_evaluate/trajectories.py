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
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from damadics_fd.core.scada.monitor import scada_samples
from numpy.typing import NDArray

from damadics_evaluate.indices import T_FROM, Zones

Floats = NDArray[np.float64]
NOISE = 1.414e-3  # standard deviation of the benchmark's sensor noise, share of full scale
HOUR = 3600
DAY = 86400
PLANT_SEEDS = 20  # different disturbances of CV inside the plant; a run's seed picks one
LONG_PLANT_SEEDS = 4  # the same for runs of a day, each of which takes seconds to integrate
LEARNING, FREE = 10_000, 20_000  # added to it, so that fault-free records share none
DEVELOPMENT = {'S': 0.0, 'M': 0.0, 'B': 0.0, 'I': 86400.0}
SHORT_DEVELOPMENT = {4: 3600.0, 13: 900.0, 17: 3600.0}
CACHE_VARIABLE = 'DAMADICS_FD_CACHE'
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
    One standard scenario, or the plant with one fault of any strength.

    :param name: name of the scenario, such as f4_I.
    :param fault: number of the fault, 0 for none.
    :param zones: its time zones.
    """

    name: str
    fault: int
    zones: Zones

    @property
    def abrupt(self) -> bool:
        """Tell whether the fault comes at once."""
        return self.zones.t_hor <= T_FROM + 600.0

    @property
    def duration(self) -> int:
        """Return the length of the run, s."""
        return int(self.zones.t_hor)


def case(name: str) -> Case:
    """
    Return a standard scenario by name, or an abrupt fault of any strength.

    :param name: f1_S .. f19_B, or for example f12@-0.37.
    :return: the case.
    :raises ValueError: for a name that is neither.

    >>> case('f4_I').zones.t_hor
    5100.0
    >>> case('f12@-0.37').fault
    12
    """
    free = re.fullmatch(r'f(\d+)@(-?[\d.]+)', name)
    if free and int(free[1]) in STANDARD and abs(float(free[2])) <= 1.0:
        return Case(name, int(free[1]), Zones())
    if name not in SCENARIOS:
        raise ValueError(f'no scenario {name}: one of {", ".join(SCENARIOS)} or f11@0.37')
    match = re.fullmatch(r'f(\d+)_([SMBI])', name)
    assert match is not None
    fault, mode = int(match[1]), match[2]
    t_fd = DEVELOPMENT[mode]
    if mode == 'I':
        t_fd = SHORT_DEVELOPMENT.get(fault, t_fd)
    return Case(name, fault, Zones.of_development(t_fd))


def cache_directory() -> Path:
    """Return where trajectories are kept: $DAMADICS_FD_CACHE or the user's cache directory."""
    stated = os.environ.get(CACHE_VARIABLE)
    if stated:
        return Path(stated)
    base = os.environ.get('XDG_CACHE_HOME')
    return (Path(base) if base else Path.home() / '.cache') / 'damadics_fd'


@cache
def _plant_hash() -> str:
    """Return a hash of the plant's source, so that another plant makes new trajectories."""
    import damadics_plant

    digest = hashlib.sha256()
    for file in sorted(Path(damadics_plant.__path__[0]).rglob('*.py')):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def trajectory(name: str, duration: int, plant_seed: int) -> tuple[Floats, Floats]:
    """
    Return a run of the plant at 1 Hz without sensor noise.

    :param name: scenario, or 'nominal'.
    :param duration: seconds.
    :param plant_seed: seed of the disturbance of CV inside the plant.
    :return: rows t, CV, X', P1', P2', T1', F' (0..1) and the fault strength.
    """
    from damadics_plant import simulate

    directory = cache_directory() / 'trajectories' / _plant_hash()
    file = directory / f'{name}_{duration}_{plant_seed}.npy'
    if file.exists():
        stored = np.load(file)
    else:
        columns = simulate(name, rate=1.0, duration=float(duration), noise='cv', seed=plant_seed)
        stored = np.column_stack((scada_samples(columns), columns['strength']))
        directory.mkdir(parents=True, exist_ok=True)
        partial = file.with_suffix(f'.{os.getpid()}.tmp')
        with partial.open('wb') as stream:
            np.save(stream, stored)
        partial.replace(file)
    return stored[:, :7], stored[:, 7]


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


def learning_hour(seed: int) -> Floats:
    """Return the fault-free hour that belongs to a seed."""
    clean, _ = trajectory('nominal', HOUR, seed % PLANT_SEEDS + LEARNING)
    return noisy(clean[:HOUR], seed, 'learning hour')


def nominal_day(seed: int) -> Floats:
    """Return a fault-free day that belongs to a seed, started afresh."""
    clean, _ = trajectory('nominal', DAY, seed % (10 * PLANT_SEEDS) + FREE)
    return noisy(clean[:DAY], seed, 'nominal day')
