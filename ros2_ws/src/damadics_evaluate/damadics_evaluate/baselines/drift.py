# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drift detectors on the size of the FIR residual: Page-Hinkley, ADWIN of the river library."""

import math

import numpy as np
from damadics_fd.core.jit import jit

from damadics_evaluate.baselines.residuals import FirResidual
from damadics_evaluate.columns import Floats
from damadics_evaluate.detectors.base import require


@jit
def _page_hinkley(values: np.ndarray, delta: float, alpha: float) -> np.ndarray:
    """Return Page's statistic of a rise or a fall of the mean, as Hinkley (1971) and river do."""
    out = np.zeros_like(values)
    mean = 0.0
    rise = 0.0
    fall = 0.0
    lowest = math.inf
    highest = -math.inf
    for i in range(values.size):
        mean += (values[i] - mean) / (i + 1)
        rise = alpha * rise + (values[i] - mean - delta)
        fall = alpha * fall + (values[i] - mean + delta)
        lowest = min(lowest, rise)
        highest = max(highest, fall)
        out[i] = max(rise - lowest, highest - fall)
    return out


class PageHinkley(FirResidual):
    """Page-Hinkley on the size of the FIR residual; the statistic is its own test value."""

    name, title = 'page_hinkley', 'Page-Hinkley'

    def __init__(self, delta: float = 0.05, alpha: float = 0.9999) -> None:
        self.delta = delta
        self.alpha = alpha

    def _test(self, z: Floats) -> Floats:
        return np.asarray(_page_hinkley(np.abs(z), self.delta, self.alpha))


class Adwin(FirResidual):
    """
    river's ADWIN: flags when two parts of its window differ.

    The statistic is -log10 of the smallest delta of a ladder whose detector has fired: the limit
    set on nominal days is a limit on ADWIN's own confidence. A detection latches.
    """

    name, title = 'adwin', 'ADWIN (river)'
    plant_limit = 4.0  # the weakest step of the ladder

    def __init__(self, decades: tuple[int, ...] = (4, 8, 16, 32, 64, 128, 192, 256, 300)) -> None:
        self.decades = decades

    def _test(self, z: Floats) -> Floats:
        drift = require('river.drift', self.name)
        values = np.clip(np.abs(z) / 20.0, 0.0, 1.0).tolist()  # ADWIN assumes [0, 1]
        out = np.zeros(len(values))
        for decade in self.decades:
            test = drift.ADWIN(delta=10.0**-decade)
            for i, value in enumerate(values):
                test.update(value)
                if test.drift_detected:
                    out[i:] = decade
                    break
            else:
                break  # a stricter one fires later still
        return out

    def statistic(self, samples: Floats) -> Floats:
        """Return the ladder's value; a latch by construction."""
        out = super().statistic(samples)
        return np.where(self.active(samples), out, 0.0)
