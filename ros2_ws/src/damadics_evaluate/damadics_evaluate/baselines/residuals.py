# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Classical tests on the deviation CV - X' and on a learned FIR model of the stem."""

import math
from abc import abstractmethod

import numpy as np
from damadics_fd.core.jit import jit

from damadics_evaluate.columns import Floats
from damadics_evaluate.detectors.base import CV, Detector, X

FIR_TAPS = 4


@jit
def _ewma(z: np.ndarray, weight: float) -> np.ndarray:
    out = np.zeros_like(z)
    mean = 0.0
    for i in range(z.size):
        mean += weight * (z[i] - mean)
        out[i] = abs(mean)
    return out


@jit
def _cusum(z: np.ndarray, k: float, ceiling: float) -> np.ndarray:
    out = np.zeros_like(z)
    up = 0.0
    down = 0.0
    for i in range(z.size):
        up = min(max(0.0, up + z[i] - k), ceiling)
        down = min(max(0.0, down - z[i] - k), ceiling)
        out[i] = max(up, down)
    return out


@jit
def _glr(z: np.ndarray, window: int) -> np.ndarray:
    """Return max over j <= window of (sum of the last j)^2 / (2 j)."""
    out = np.zeros_like(z)
    for i in range(z.size):
        total = 0.0
        for j in range(1, min(window, i + 1) + 1):
            total += z[i + 1 - j]
            out[i] = max(out[i], total * total / (2.0 * j))
    return out


class Deviation(Detector):
    """A test on z = (CV - X' - mean) / sigma."""

    def fit(self, hour: Floats) -> None:
        """Learn mean and sigma of the residual."""
        rows = self.learning_rows(hour)
        self._prepare(rows)
        residual = self._residual(rows)
        self._mean = float(residual.mean())
        self._sigma = float(residual.std())

    def statistic(self, samples: Floats) -> Floats:
        """Return the test's statistic, 0 before the tests are on."""
        on = self.active(samples)
        out = np.zeros(len(samples))
        z = (self._residual(samples) - self._mean) / self._sigma
        out[on] = self._test(z[on])
        return out

    def _prepare(self, rows: Floats) -> None:
        """Learn the residual generator, where there is one."""

    def _residual(self, samples: Floats) -> Floats:
        return np.asarray(samples[:, CV] - samples[:, X])

    @abstractmethod
    def _test(self, z: Floats) -> Floats:
        """Return the statistic of standard residuals."""


class FirResidual(Deviation):
    """A test on X' - FIR(CV), the linear model without valve knowledge."""

    def _prepare(self, rows: Floats) -> None:
        design = self._design(rows)
        self._weights = np.linalg.lstsq(design, rows[:, X], rcond=None)[0]

    def _design(self, samples: Floats) -> Floats:
        cv = samples[:, CV]
        lags = [np.concatenate((np.full(i, cv[0]), cv[: len(cv) - i])) for i in range(FIR_TAPS)]
        return np.column_stack([np.ones(len(cv)), *lags])

    def _residual(self, samples: Floats) -> Floats:
        return np.asarray(samples[:, X] - self._design(samples) @ self._weights)


class FixedThreshold(Deviation):
    """The deviation against one limit."""

    name, title = 'fixed', 'fixed threshold on abs(CV-X)'

    def _test(self, z: Floats) -> Floats:
        return np.abs(z)


class Ewma(Deviation):
    """Exponentially weighted mean of the deviation."""

    name, title = 'ewma', 'EWMA(0.05) of CV-X'

    def __init__(self, weight: float = 0.05) -> None:
        self.weight = weight

    def _test(self, z: Floats) -> Floats:
        return np.asarray(_ewma(z, self.weight))


class CusumOnDeviation(Deviation):
    """Two-sided CUSUM of the deviation."""

    name, title = 'cusum', 'CUSUM(0.5) of CV-X'
    plant_limit = 12.0
    ceiling = math.inf  # of the sums, so that an alarm ends soon after its fault

    def __init__(self, k: float = 0.5) -> None:
        self.k = k

    def prepare_for_plant(self) -> None:
        """Bound the sums at twice the limit."""
        super().prepare_for_plant()
        self.ceiling = 2.0 * self.plant_limit

    def _test(self, z: Floats) -> Floats:
        return np.asarray(_cusum(z, self.k, self.ceiling))


class FirCusum(CusumOnDeviation, FirResidual):
    """The same of the FIR residual."""

    name, title = 'fir_cusum', 'FIR(4) + CUSUM(1)'

    def __init__(self, k: float = 1.0) -> None:
        super().__init__(k)


class Glr(FirResidual):
    """Windowed generalised likelihood ratio for a change of mean."""

    name, title = 'glr', 'GLR(100) of the FIR residual'

    def __init__(self, window: int = 100) -> None:
        self.window = window

    def _test(self, z: Floats) -> Floats:
        return np.asarray(_glr(z, self.window))


class SmartPositioner(Deviation):
    """Low-passed |CV - X| over its limit for a monitoring time, as in a smart positioner."""

    name, title = 'positioner', 'smart positioner: low-passed abs(CV-X)'

    def __init__(self, filter_s: float = 10.0, monitoring_s: int = 10) -> None:
        self.filter_s = filter_s
        self.monitoring_s = monitoring_s

    def _test(self, z: Floats) -> Floats:
        smooth = _ewma(np.abs(z), 1.0 - math.exp(-1.0 / self.filter_s))
        n = self.monitoring_s
        padded = np.concatenate((np.zeros(n - 1), smooth))
        return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, n).min(axis=1))
