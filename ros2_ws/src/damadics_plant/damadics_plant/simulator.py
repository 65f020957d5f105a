# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Run a scenario on one of the plants: all at once or block by block, with the same result."""

import math
import warnings
from collections.abc import Callable, Iterator
from types import ModuleType

import numpy as np

from damadics_plant.actuator import dablib, lugre
from damadics_plant.actuator.measure import OUTPUTS, ROWS
from damadics_plant.actuator.parameters import Actuator, LuGreActuator
from damadics_plant.faults.catalogue import CATALOGUE, Fault
from damadics_plant.faults.effects import Effects, fault_table
from damadics_plant.run import Columns, Run, stamps
from damadics_plant.scenarios.disturbance import Disturbance
from damadics_plant.scenarios.level import LevelLoop
from damadics_plant.scenarios.library import load_scenario
from damadics_plant.scenarios.scenario import Scenario
from damadics_plant.scenarios.sources import RandomSteps, Source
from damadics_plant.strokes import Strokes

MODELS: dict[str, tuple[type[Actuator], ModuleType]] = {
    'dablib': (Actuator, dablib),
    'lugre': (LuGreActuator, lugre),
}

_BLOCK = 1 << 14
"""Ticks per call of the compiled loop: bounds memory, keeps the inputs in the cache."""


class Simulator:
    """
    A plant that advances sample by sample; the size of the blocks does not change the result.

    :ivar scenario: what it runs.
    :ivar rate: samples per second.
    :ivar duration: of the scenario [s].
    """

    def __init__(
        self,
        scenario: str | Scenario,
        rate: float | None = None,
        model: str | Actuator = 'dablib',
        noise: bool | str = False,
        seed: int = 0,
        duration: float | None = None,
    ) -> None:
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
        self._state: np.ndarray = module.initial_state(self.actuator)
        self._strengths = np.zeros(20)
        self._faults = [_admissible(fault, self.actuator) for fault in self.scenario.faults]
        if len(self._faults) > 1:
            warnings.warn(
                f'{self.scenario.name}: the benchmark allows one fault at a time, '
                f'here are {len(self._faults)}',
                stacklevel=2,
            )
        self._lay_out_faults()
        names = ('cv', 'p1', 'p2', 't1')
        self._sources: list[Source] = [
            _fresh(getattr(self.scenario, name), seed + 7919 * i)  # no two inputs alike
            for i, name in enumerate(names)
        ]
        self._loop = self._sources[0] if isinstance(self._sources[0], LevelLoop) else None
        self._inflow = 0.0  # sum over the ticks of the loop's present period [kg/s]
        self._override: float | None = None
        self._strokes: Strokes | None = None
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
            self._fill(out[:, first : first + step])
        k = np.arange(self._done - n, self._done, dtype=np.int64)
        columns: Columns = {'stamp': stamps(k, self.rate)}
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

    def stroke(self, amplitude: float, count: int) -> None:
        """
        Make partial strokes about the present control value, from the next sample on.

        :param amplitude: half of a stroke, share of full travel, above 0 and at most 0.5.
        :param count: how many; 0 ends those under way.
        :raises ValueError: if the amplitude is out of range.
        """
        if count and not 0.0 < amplitude <= 0.5:
            raise ValueError(f'amplitude: {amplitude!r} is not above 0 and at most 0.5')
        self._strokes = Strokes(self.time, amplitude, count) if count else None

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

    def replace_actuator(self, actuator: Actuator) -> None:
        """
        Go on with other constants of the valve from the next sample on.

        :param actuator: of the same model as before.
        :raises ValueError: if it is of another model.
        """
        if type(actuator) is not type(self.actuator):
            raise ValueError(f'actuator: {actuator!r} is no {type(self.actuator).__name__}')
        self._constants = actuator.record()
        self._lay_out_faults()

    def _lay_out_faults(self) -> None:
        self._table = fault_table(self._faults)
        self._effects = Effects.rows()

    def _fill(self, out: np.ndarray) -> None:
        """Fill samples (rows CV and `OUTPUTS`), the loop's period by period."""
        first = self._done * self._every
        if self._loop:
            ticks = out.shape[1] * self._every
            parts = [self._run_loop(k, n) for k, n in self._periods(first, ticks)]
            out[:] = np.concatenate(parts, axis=1)[:, :: self._every]
        else:
            out[:] = self._run(first, out.shape[1], self._every)[:-1]
        if self._disturbance and self._noisy_outputs:
            hum = self._disturbance.hum(first, self._every, out.shape[1], self._tick_rate)
            for row, name in zip(out[1:], OUTPUTS[:6], strict=False):
                row[:] = self._disturbance.disturb(name, row, self._every, hum)
        self._done += out.shape[1]

    def _run(self, first: int, n: int, every: int) -> np.ndarray:
        """Run n samples from a tick on; return rows CV, `OUTPUTS` and the true flow."""
        t = np.arange(first, first + n * every) / self._tick_rate
        inputs = np.empty((4, len(t)))
        for row, source in zip(inputs, self._sources, strict=True):
            row[:] = source.at(t)
        if self._override is not None:
            inputs[0] = self._override
        if self._strokes:
            self._strokes.apply(t, inputs[0])
        out = np.empty((1 + ROWS, n))
        out[0] = inputs[0, ::every]
        if self._disturbance:
            hum = self._disturbance.hum(first, 1, len(t), self._tick_rate)
            inputs[0] = self._disturbance.disturb('cv', inputs[0], 1, hum)
        rows = np.empty((ROWS, n))  # contiguous, so that there is one compiled version
        self._advance(
            self._state,
            self._constants,
            self._table,
            self._strengths,
            self._effects,
            inputs,
            self._tick_rate,
            every,
            rows,
        )
        out[1:] = rows
        return out

    def _periods(self, first: int, n: int) -> Iterator[tuple[int, int]]:
        """Cut ticks at the sample times of the loop's controller."""
        assert self._loop
        period = max(1, round(self._loop.period * self._tick_rate))
        k = first
        while k < first + n:
            if k % period == 0:
                if k > 0:
                    self._loop.fill((k - period) / self._tick_rate, self._inflow / period)
                self._loop.control()
                self._inflow = 0.0
            end = min(first + n, k - k % period + period)
            yield k, end - k
            k = end

    def _run_loop(self, first: int, n: int) -> np.ndarray:
        rows = self._run(first, n, 1)
        for flow in rows[-1].tolist():  # in order, so that blocks do not change the sum
            self._inflow += flow
        return rows[:-1]


def simulate(
    scenario: str | Scenario,
    rate: float | None = None,
    model: str | Actuator = 'dablib',
    noise: bool | str = False,
    seed: int = 0,
    duration: float | None = None,
) -> Run:
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


def _fresh(source: Source, seed: int) -> Source:
    if isinstance(source, RandomSteps):
        return source.seeded(seed)
    return source.fresh() if isinstance(source, LevelLoop) else source


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
            raise ValueError(
                'fault: f8 scales the play, which the lugre model does not have; use model dablib'
            )
    elif not kind.minimum <= fault.direction * fault.strength <= 1:
        raise ValueError(
            f'strength: {fault.direction * fault.strength:g} is not within '
            f'{kind.minimum:g}..1, the range of {fault.fault} on the dablib model'
        )
    return fault


def _ticks(rate: float, model: str) -> tuple[float, int]:
    if not (math.isfinite(rate) and rate > 0):
        raise ValueError(f'rate: {rate!r} is not a positive number of samples per second')
    if model == 'dablib':
        every = round(dablib.RATE / rate)
        if every < 1 or not math.isclose(every * rate, dablib.RATE, rel_tol=1e-9):
            raise ValueError(
                f'rate: {rate:g} Hz is not 400 Hz divided by a whole number '
                '(400, 200, 100, 80, 50, 40, 25, 20, 10, ... 1)'
            )
        return dablib.RATE, every
    every = math.ceil(lugre.RATE / rate - 1e-9)
    return rate * every, every
