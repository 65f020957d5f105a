# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
A detector written outside this package, in the place of a built-in one.

The class has `fit(columns)` and either `statistic(columns)`, one value per sample, or
`update(sample) -> (score, limit)`. The page
docs/evaluation.md tells what columns and sample hold and what is optional.
"""

import copy
import hashlib
import inspect
from collections.abc import Callable, Mapping
from functools import cache
from importlib.metadata import entry_points
from typing import ClassVar, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np

from damadics_evaluate.columns import Columns, Floats, columns_of
from damadics_evaluate.detectors.base import Detector, Setting
from damadics_evaluate.loading import load_object, told

ENTRY_POINTS = 'damadics_evaluate.detectors'
TINY = 1e-12
Answer = TypeVar('Answer')


class Sample(NamedTuple):
    """One sample as `update` gets it: SI, NaN where not measured."""

    t: float  # s
    cv: float  # 0 open .. 1 closed
    x1: float  # 0 open .. 1 closed
    p1: float  # Pa
    p2: float  # Pa
    t1: float  # degC
    flow: float  # kg/s


@runtime_checkable
class OffLine(Protocol):
    """A detector that judges a whole record."""

    def fit(self, columns: Columns) -> None:
        """Learn from a fault-free record."""
        ...

    def statistic(self, columns: Columns) -> np.ndarray:
        """Return one value per sample; the larger, the worse."""
        ...


@runtime_checkable
class OnLine(Protocol):
    """A detector that judges sample by sample with a limit of its own."""

    def fit(self, columns: Columns) -> None:
        """Learn from a fault-free record."""
        ...

    def update(self, sample: Sample) -> tuple[float, float]:
        """Return score and limit; it flags while score >= limit."""
        ...


class RefusedError(ValueError):
    """A detector did what no detector may; the message names it and what it did."""


class Own(Detector):
    """A user's object behind the interface of the built-in detectors, every answer checked."""

    make: ClassVar[type]

    def __init__(self) -> None:
        self._fitted = self._tried('is made', self.make)

    def _tried(self, doing: str, call: Callable[..., Answer], *arguments: object) -> Answer:
        try:
            return call(*arguments)
        except (Exception, SystemExit) as error:
            # whatever it raises, it is refused by name and the others go on
            raise RefusedError(f'{self.name} raises when it {doing}: {told(error)}') from error

    def fit(self, hour: Floats) -> None:
        """Let it learn, afresh each time."""
        fitted = self._tried('is made', self.make)
        self._tried('learns (fit)', fitted.fit, columns_of(self.learning_rows(hour)))
        self._fitted = fitted

    def statistic(self, samples: Floats) -> Floats:
        """Return its statistic, over its limit where it brings one; 0 before tests are on."""
        judge = self._tried('is copied', copy.deepcopy, self._fitted)  # it remembers no other run
        columns = columns_of(samples)
        if isinstance(judge, OnLine):
            values = self._updates(judge, columns)
        else:
            limit = float(getattr(judge, 'limit', 1.0))
            found = self._tried('judges (statistic)', judge.statistic, columns)
            values = self._checked(found, len(samples)) / limit
        return np.where(self.active(samples), values, 0.0)

    def _updates(self, judge: OnLine, columns: Columns) -> Floats:
        t = columns['stamp'] / 1e9
        names = Sample._fields[1:]
        rows = zip(t.tolist(), *(columns[name].tolist() for name in names), strict=True)
        values = np.empty(len(t))
        for i, row in enumerate(rows):
            answer = self._tried('judges (update)', judge.update, Sample(*row))
            try:
                score, limit = answer
                values[i] = float(score) / max(float(limit), TINY)
            except (TypeError, ValueError, OverflowError) as error:
                raise RefusedError(
                    f'{self.name}: update() returned {answer!r}, not (score, limit)'
                ) from error
        return self._checked(values, len(t))

    def _checked(self, found: object, samples: int) -> Floats:
        try:
            values = np.asarray(found, dtype=np.float64)
        except (TypeError, ValueError, OverflowError) as error:
            raise RefusedError(
                f'{self.name} returns {type(found).__name__}, no numbers'
            ) from error
        if values.shape != (samples,):
            raise RefusedError(
                f'{self.name} returns shape {values.shape} for {samples} samples: one value each'
            )
        if np.isnan(values).any():
            first = int(np.flatnonzero(np.isnan(values))[0])
            raise RefusedError(f'{self.name} returns NaN, first at sample {first} of {samples}')
        return values

    def cause(self, samples: Floats, alarm: float) -> str:
        """Return what it names, where it has `name_fault(columns, alarm)`."""
        name_fault = getattr(self._fitted, 'name_fault', None)
        if name_fault is None:
            return ''
        return str(self._tried('names a fault', name_fault, columns_of(samples), alarm))

    def settings(self) -> dict[str, Setting]:
        """Return the numbers that shape it and a hash of its file."""
        shape: dict[str, Setting] = {
            key: value
            for key, value in vars(self._fitted).items()
            if isinstance(value, bool | int | float | str)
        }
        return {**shape, 'source': source_digest(self.make)}


def source_digest(made: type) -> str:
    """Return a hash of the file that a class was loaded from."""
    try:
        text = inspect.getsource(inspect.getmodule(made) or made)
    except (OSError, TypeError):
        text = repr(made)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


@cache
def adapted(name: str) -> type[Own]:
    """
    Return a user's class as a detector of this package.

    :param name: FILE.py:CLASS, MODULE:CLASS or the name of an entry point.
    :raises ValueError: where there is none, or it has not the methods it needs.
    """
    installed = {entry.name: entry for entry in entry_points(group=ENTRY_POINTS)}
    try:
        made = installed[name].load() if name in installed else load_object(name)
    except ImportError as error:
        raise ValueError(f'{name}: {told(error)}') from error
    if not isinstance(made, type):
        raise ValueError(f'{name} is no class')
    online, offline = (callable(getattr(made, m, None)) for m in ('update', 'statistic'))
    if not callable(getattr(made, 'fit', None)) or not (online or offline):
        raise ValueError(
            f'{name} needs fit(columns) and either statistic(columns) or update(sample)'
        )
    own_limit = online or hasattr(made, 'limit')
    members = {
        'name': name,
        'title': str(getattr(made, 'title', made.__name__)),
        'calibrated': not own_limit,
        'plant_limit': 1.0 if own_limit else None,
        'make': made,
    }
    return type(f'Own_{made.__name__}', (Own,), members)


def names_of_installed() -> Mapping[str, str]:
    """Return the detectors of installed packages: name and where it is."""
    return {entry.name: entry.value for entry in entry_points(group=ENTRY_POINTS)}
