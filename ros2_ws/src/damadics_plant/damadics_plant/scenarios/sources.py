# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What drives the plant: signals as functions of time for CV, P1, P2 and T1."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np


class Source(Protocol):
    """A signal."""

    def at(self, t: np.ndarray) -> np.ndarray:
        """
        Evaluate the signal.

        :param t: times [s], increasing, shape (n,).
        :return: values, shape (n,).
        """


@dataclass(frozen=True)
class Constant:
    """
    A constant.

    >>> Constant(2.0).at(np.array([0.0, 1.0]))
    array([2., 2.])
    """

    value: float

    def at(self, t: np.ndarray) -> np.ndarray:
        """Evaluate, see `Source`."""
        return np.full(len(t), float(self.value))


@dataclass(frozen=True)
class Steps:
    """
    A list of steps: `values[i]` from `times[i]` on.

    >>> Steps((0.0, 20.0), (1.0, 0.0)).at(np.array([0.0, 19.9, 20.0]))
    array([1., 1., 0.])
    """

    times: Sequence[float]
    values: Sequence[float]

    def __post_init__(self) -> None:
        """
        Check the list.

        :raises ValueError: if it is empty, unequal in length or its times do not increase.
        """
        if len(self.times) != len(self.values) or not len(self.times):
            raise ValueError('steps: wants pairs [time, value], at least one')
        if any(b <= a for a, b in zip(self.times, self.times[1:], strict=False)):
            raise ValueError('steps: times must increase')

    def at(self, t: np.ndarray) -> np.ndarray:
        """Evaluate, see `Source`; before the first time the first value holds."""
        edges = np.searchsorted(t, np.asarray(self.times[1:], float))
        return np.repeat(np.asarray(self.values, float), np.diff(edges, prepend=0, append=len(t)))


@dataclass(frozen=True)
class Sine:
    """mean + amplitude sin(2 pi frequency t + phase)."""

    mean: float
    amplitude: float
    frequency: float
    phase: float = 0.0

    def at(self, t: np.ndarray) -> np.ndarray:
        """Evaluate, see `Source`."""
        return self.mean + self.amplitude * np.sin(2 * np.pi * self.frequency * t + self.phase)


@dataclass
class RandomSteps:
    """
    Steps to values U(low, high), each held for U(shortest, longest) seconds.

    The same seed gives the same steps, however the time is cut into blocks.
    """

    low: float = 0.0
    high: float = 1.0
    shortest: float = 5.0
    longest: float = 15.0
    seed: int | None = None
    """None: the seed of the run."""
    _times: list[float] = field(default_factory=list, init=False, repr=False, compare=False)
    _values: list[float] = field(default_factory=list, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """
        Check the values.

        :raises ValueError: if the bounds are in the wrong order or a step may last 0 s.
        """
        if not self.low <= self.high:
            raise ValueError(f'random_steps: low {self.low:g} is above high {self.high:g}')
        if not 0 < self.shortest <= self.longest:
            raise ValueError('random_steps: wants 0 < shortest <= longest')
        self._random = np.random.default_rng(0 if self.seed is None else self.seed)

    def seeded(self, seed: int) -> 'RandomSteps':
        """
        Return a fresh source for a run.

        :param seed: seed of the run, used where the source has none.
        :return: a source at its beginning.
        """
        own = seed if self.seed is None else self.seed
        return RandomSteps(self.low, self.high, self.shortest, self.longest, own)

    def at(self, t: np.ndarray) -> np.ndarray:
        """Evaluate, see `Source`."""
        while not self._times or self._times[-1] <= t[-1]:
            self._values.append(self._random.uniform(self.low, self.high))
            last = self._times[-1] if self._times else 0.0
            self._times.append(last + self._random.uniform(self.shortest, self.longest))
        index = np.searchsorted(self._times, t, side='right')
        return np.asarray(self._values)[index]


@dataclass(frozen=True)
class Recorded:
    """
    A recorded signal over its times, held or interpolated linearly.

    :ivar times: [s], increasing.
    :ivar values: as many.
    """

    times: np.ndarray
    values: np.ndarray
    interpolate: bool = False

    def at(self, t: np.ndarray) -> np.ndarray:
        """Evaluate, see `Source`; constant beyond both ends."""
        if self.interpolate:
            between: np.ndarray = np.interp(t, self.times, self.values)
            return between
        index = np.searchsorted(self.times, t, side='right') - 1
        held: np.ndarray = self.values[np.maximum(index, 0)]
        return held
