# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What every detector of a campaign offers: fit to a fault-free hour, give a statistic."""

import importlib
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from damadics_evaluate.columns import Floats
from damadics_evaluate.indices import T_ON

T, CV, X, P1, P2, T1, F = range(7)
PACKAGES = {
    'sklearn': 'scikit-learn',
    'river': 'river',
    'filterpy': 'filterpy',
    'scipy': 'scipy',
}
Setting = bool | int | float | str | tuple[float, ...]


class MissingPackageError(ImportError):
    """A baseline's library is not installed; the message tells how to get it."""


def require(module: str, detector: str) -> ModuleType:
    """
    Import a library that only a baseline needs.

    :param module: module name, such as 'river.drift'.
    :param detector: detector that asks for it.
    :return: the module.
    :raises MissingPackageError: naming the package and the command that installs it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = PACKAGES.get(module.split('.', 1)[0], module)
        raise MissingPackageError(
            f'detector {detector} needs {package}: pip install {package}, '
            f'or leave it out with --detectors'
        ) from error


@dataclass(frozen=True)
class Diagnosis:
    """
    What a detector names at one time.

    :param t: s.
    :param ranking: fault, strength (NaN if unknown) and cost over the best, best first.
    :param candidates: the faults that it does not tell apart.
    :param group: of the best fault, as `core.scada` groups them.
    """

    t: float
    ranking: tuple[tuple[int, float, float], ...]
    candidates: tuple[int, ...]
    group: str = ''


class Detector(ABC):
    """
    One detector under test.

    Rows of samples are t (s), CV, X', P1', P2', T1', F', scaled to 0..1. The detector flags
    while its statistic is at or above its limit; a campaign sets the limit (`calibrated`).
    """

    name: ClassVar[str]
    title: ClassVar[str]
    calibrated: ClassVar[bool] = True  # the limit comes from nominal days, else it is 1
    t_on: float = T_ON
    learn_from: float = 60.0
    plant_limit: float | None = None  # the textbook's limit, for records too short to set one

    @abstractmethod
    def fit(self, hour: Floats) -> None:
        """Learn from a fault-free record."""

    @abstractmethod
    def statistic(self, samples: Floats) -> Floats:
        """Return the statistic, one per row; anything below the limit while it starts up."""

    def prepare_for_plant(self) -> None:
        """Get ready for a record of a running plant: no start-up, alarms that end."""
        self.t_on = self.learn_from = 0.0

    def cause(self, samples: Floats, alarm: float) -> str:
        """
        Name the fault behind an alarm.

        :param samples: rows up to the time at which it is to be named.
        :param alarm: when the alarm was raised, s.
        :return: such as 'f16' or 'f16 or f17'; empty where the detector names none.
        """
        return ''

    def isolate_at(self, samples: Floats, alarm: float, times: Sequence[float]) -> list[Diagnosis]:
        """
        Name the fault at given times after an alarm, each time from what came before it.

        :param samples: rows of a run.
        :param alarm: when the alarm was raised, s.
        :param times: ascending, s.
        :return: one diagnosis per time at which there was enough; empty where it names nothing.
        """
        return []

    def settings(self) -> dict[str, Setting]:
        """Return the plain numbers that shape the detector, for the settings hash."""
        return {
            key: value
            for key, value in vars(self).items()
            if not key.startswith('_') and isinstance(value, bool | int | float | str | tuple)
        }

    def learning_rows(self, hour: Floats) -> Floats:
        """Return the rows after the start-up transient of the plant."""
        return np.asarray(hour[hour[:, T] - hour[0, T] >= self.learn_from])

    def active(self, samples: Floats) -> NDArray[np.bool_]:
        """Return where tests are on: after the set-up zone."""
        mask: NDArray[np.bool_] = samples[:, T] - samples[0, T] >= self.t_on
        return mask
