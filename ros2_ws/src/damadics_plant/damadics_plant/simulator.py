# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Run a scenario on one of the plants: all at once or block by block, with the same result."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from damadics_plant import dablib, lugre
from damadics_plant.disturbance import Disturbance
from damadics_plant.faults import CATALOGUE, EFFECTS_DTYPE, Fault, fault_table
from damadics_plant.library import load_scenario
from damadics_plant.measure import OUTPUTS
from damadics_plant.parameters import Actuator, LuGreActuator
from damadics_plant.scenario import Scenario
from damadics_plant.sources import RandomSteps, Source

COLUMNS = ('stamp', 'cv', *OUTPUTS)
"""Columns of a run."""

MODELS: dict[str, tuple[type[Actuator], ModuleType]] = {
    'dablib': (Actuator, dablib),
    'lugre': (LuGreActuator, lugre),
}

_BLOCK = 1 << 14
"""Ticks per call of the compiled loop: bounds memory, keeps the inputs in the cache."""

Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Run(Mapping[str, np.ndarray]):
    """
    A finished run: a mapping of names to columns, which are also attributes; `t` in s.

    `stamp` int64 [ns], `cv x1 p1 p2 t1 flow ps` float64 in SI, `fault` int64 (0 while none is
    active), `strength` float64; shape (n,) each.
    """

    scenario: Scenario
    columns: Columns

    def __getattr__(self, name: str) -> np.ndarray:
        """
        Return a column.

        :param name: of the column, or `t` for the time in s.
        :return: shape (n,).
        :raises AttributeError: if there is no such column.
        """
        if name == 't':
            return self.columns['stamp'] / 1e9
        if name.startswith('__') or name not in self.columns:
            raise AttributeError(f'a run has no column {name!r}; it has t, {", ".join(COLUMNS)}')
        return self.columns[name]

    def __getitem__(self, name: str) -> np.ndarray:
        """
        Return a column.

        :param name: one of `COLUMNS`.
        :return: shape (n,).
        """
        return self.columns[name]

    def __iter__(self) -> Iterator[str]:
        """
        Go through the names of the columns.

        :return: iterator of names.
        """
        return iter(self.columns)

    def __len__(self) -> int:
        """
        Count the columns.

        :return: number of columns.
        """
        return len(self.columns)

    def view(self, rate: float) -> 'Run':
        """
        Return what a slower recorder sees of this run, for instance SCADA at 1 Hz.

        :param rate: samples per second, a divisor of this run's.
        :return: the run with every n-th sample.
        :raises ValueError: if the rate does not divide.
        """
        own = 1e9 / (self.columns['stamp'][1] - self.columns['stamp'][0])
        every = round(own / rate)
        if every < 1 or not math.isclose(every * rate, own, rel_tol=1e-6):
            raise ValueError(f'rate: {rate:g} Hz does not divide the rate of the run, {own:g} Hz')
        return Run(self.scenario, {k: v[::every] for k, v in self.columns.items()})


class Simulator:
    """
    A plant that advances sample by sample; the size of the blocks does not change the result.

    :ivar scenario: what it runs.
    :ivar rate: samples per second.
    :ivar duration: of the scenario [s].
    """

    def __init__(self, scenario: str | Scenario, rate: float | None = None,
                 model: str | Actuator = 'dablib', noise: bool | str = False, seed: int = 0,
                 duration: float | None = None) -> None:
        """
        Put the plant to the start of a scenario.

        :param scenario: a name (see `scenario_names`), the path of a YAML file or a scenario.
        :param rate: samples per second; None: 400 for DABLib, 200 for LuGre.
        :param model: `dablib`, `lugre`, or constants of an actuator of your own.
        :param noise: True: the benchmark's disturbances act on CV and all outputs; 'cv': on the
            CV that the positioner gets only.
        :param seed: of the noise and of random inputs.
        :param duration: [s]; None: that of the scenario.
        :raises ValueError: if a value is not admissible; names it and what is.
        """
        self.scenario = load_scenario(scenario) if isinstance(scenario, str) else scenario
        self.duration = self.scenario.duration if duration is None else duration
        if not (math.isfinite(self.duration) and self.duration >= 0):
            raise ValueError(f'duration: {self.duration!r} is not a time in s >= 0')
        if noise not in (True, False, 'cv'):
            raise ValueError(f"noise: {noise!r} is not one of True, False, 'cv'")
        self.actuator = _actuator(model)
        module = MODELS[self.actuator.model][1]
        self.rate = float(module.RATE if rate is None else rate)
        self._tick_rate, self._every = _ticks(self.rate, self.actuator.model)
        self._advance: Callable[..., None] = module.simulate_block
        self._constants = self.actuator.record()
        self._state: Any = module.initial_state(self.actuator)
        self._strengths = np.zeros(20)
        self._faults = [_admissible(fault, self.actuator) for fault in self.scenario.faults]
        self._lay_out_faults()
        names = ('cv', 'p1', 'p2', 't1')
        self._sources: list[Source] = [
            source.seeded(seed) if isinstance(source, RandomSteps) else source
            for source in (getattr(self.scenario, name) for name in names)
        ]
        self._override: float | None = None
        self._disturbance = Disturbance(seed) if noise else None
        self._noisy_outputs = noise is True
        self._done = 0
        self._total = math.floor(self.duration * self.rate * (1 + 1e-12) + 1e-9) + 1

    @property
    def finished(self) -> bool:
        """
        Tell whether the scenario is over.

        :return: True when its last sample has been returned.
        """
        return self._done >= self._total

    @property
    def samples(self) -> int:
        """
        Count the samples of the whole scenario.

        :return: number of samples, both ends included.
        """
        return self._total

    @property
    def time(self) -> float:
        """
        Tell the time of the next sample.

        :return: [s] since scenario zero.
        """
        return self._done / self.rate

    def advance(self, n: int) -> Columns:
        """
        Return the next samples.

        :param n: how many at most.
        :return: columns as of `Run`, fewer rows at the end of the scenario.
        """
        n = max(0, min(n, self._total - self._done))
        out = np.empty((1 + len(OUTPUTS), n))
        step = max(1, _BLOCK // self._every)
        for first in range(0, n, step):
            self._fill(out[:, first:first + step])
        k = np.arange(self._done - n, self._done, dtype=np.int64)
        columns: Columns = {'stamp': _stamps(k, self.rate)}
        columns.update(zip(('cv', *OUTPUTS), out, strict=True))
        columns['fault'] = columns['fault'].astype(np.int64)
        return columns

    def override_cv(self, value: float | None) -> None:
        """
        Drive the plant by hand.

        :param value: control value 0..1 from the next sample on; None returns to the scenario.
        :raises ValueError: if the value is out of range.
        """
        if value is not None and not 0 <= value <= 1:
            raise ValueError(f'cv: {value!r} is not within 0..1')
        self._override = value

    def inject(self, fault: str, strength: float = 1.0, development: float = 0.0) -> None:
        """
        Let a fault begin with the next sample.

        :param fault: `f1` .. `f19`.
        :param strength: its final, signed strength.
        :param development: time to get there [s], 0 for an abrupt fault.
        :raises ValueError: if the fault is not admissible.
        """
        new = Fault(fault, strength, start=self.time, development=development)
        self._faults.append(_admissible(new, self.actuator))
        self._lay_out_faults()

    def clear(self) -> None:
        """Remove all faults, those to come included, from the next sample on."""
        self._faults.clear()
        self._lay_out_faults()

    def _lay_out_faults(self) -> None:
        self._table = fault_table(self._faults)
        self._effects = np.zeros(1, EFFECTS_DTYPE)

    def _fill(self, out: np.ndarray) -> None:
        n = out.shape[1]
        first = self._done * self._every
        t = np.arange(first, first + n * self._every) / self._tick_rate
        inputs = np.empty((4, len(t)))
        for row, source in zip(inputs, self._sources, strict=True):
            row[:] = source.at(t)
        if self._override is not None:
            inputs[0] = self._override
        out[0] = inputs[0, ::self._every]
        np.clip(inputs[0], 0.0, 1.024, out=inputs[0])
        noise = self._disturbance
        if noise:
            hum = noise.hum(first, len(t), self._tick_rate)
            inputs[0] = noise.disturb('cv', inputs[0], 1, hum)
        outputs = np.empty((len(OUTPUTS), n))  # contiguous, so that there is one compiled version
        self._advance(self._state, self._constants, self._table, self._strengths, self._effects,
                      inputs, self._tick_rate, self._every, outputs)
        out[1:] = outputs
        if noise and self._noisy_outputs:
            for row, name in zip(out[1:], OUTPUTS[:6], strict=False):
                row[:] = noise.disturb(name, row, self._every, hum[::self._every])
        self._done += n


def simulate(scenario: str | Scenario, rate: float | None = None,
             model: str | Actuator = 'dablib', noise: bool | str = False, seed: int = 0,
             duration: float | None = None) -> Run:
    """
    Run a scenario from its start to its end.

    :param scenario: a name (see `scenario_names`), the path of a YAML file or a scenario.
    :param rate: samples per second; None: 400 for DABLib, 200 for LuGre.
    :param model: `dablib`, `lugre`, or constants of an actuator of your own.
    :param noise: True: the benchmark's disturbances act on CV and all outputs; 'cv': on the CV
        that the positioner gets only.
    :param seed: of the noise and of random inputs.
    :param duration: [s]; None: that of the scenario.
    :return: the run, samples at k / rate with both ends.
    :raises ValueError: if a value is not admissible; names it and what is.

    >>> run = simulate('paper_nominal')
    >>> run.x1.shape, round(float(run.x1[28000]), 4)
    ((48001,), 0.7211)
    """
    simulator = Simulator(scenario, rate, model, noise, seed, duration)
    return Run(simulator.scenario, simulator.advance(simulator.samples))


def _actuator(model: str | Actuator) -> Actuator:
    if isinstance(model, Actuator):
        return model
    if model not in MODELS:
        raise ValueError(f'model: {model!r} is not one of {", ".join(MODELS)}')
    return MODELS[model][0]()


def _admissible(fault: Fault, actuator: Actuator) -> Fault:
    kind = CATALOGUE[fault.fault]
    if actuator.model == 'lugre':
        if fault.fault == 'f8':
            raise ValueError('fault: f8 scales the play, which the lugre model does not have; '
                             'use model dablib')
    elif not kind.minimum <= fault.direction * fault.strength <= 1:
        raise ValueError(f'strength: {fault.direction * fault.strength:g} is not within '
                         f'{kind.minimum:g}..1, the range of {fault.fault} on the dablib model')
    return fault


def _ticks(rate: float, model: str) -> tuple[float, int]:
    if not (math.isfinite(rate) and rate > 0):
        raise ValueError(f'rate: {rate!r} is not a positive number of samples per second')
    if model == 'dablib':
        every = round(dablib.RATE / rate)
        if every < 1 or not math.isclose(every * rate, dablib.RATE, rel_tol=1e-9):
            raise ValueError(f'rate: {rate:g} Hz is not 400 Hz divided by a whole number '
                             '(400, 200, 100, 80, 50, 40, 25, 20, 10, ... 1)')
        return dablib.RATE, every
    every = math.ceil(lugre.RATE / rate - 1e-9)
    return rate * every, every


def _stamps(k: np.ndarray, rate: float) -> np.ndarray:
    if rate >= 1 and rate == int(rate):
        whole, rest = np.divmod(k, int(rate))
        stamps: np.ndarray = whole * 1_000_000_000 + np.rint(rest * 1e9 / rate).astype(np.int64)
        return stamps
    return np.rint(k * 1e9 / rate).astype(np.int64)
