# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drift detectors of the river library on the size of the FIR residual."""

import math
from typing import Any

import numpy as np

from damadics_evaluate.baselines.base import Floats, require
from damadics_evaluate.baselines.residuals import FirResidual


class PageHinkley(FirResidual):
    """river's Page-Hinkley; the statistic is its own test value."""

    name, title = 'page_hinkley', 'Page-Hinkley (river)'

    def __init__(self, delta: float = 0.05, alpha: float = 0.9999) -> None:
        self.delta = delta
        self.alpha = alpha

    def _test(self, z: Floats) -> Floats:
        drift = require('river.drift', self.name)
        # a threshold of its own would reset the sums at every detection
        test = drift.PageHinkley(delta=self.delta, alpha=self.alpha, threshold=math.inf)
        out = np.zeros_like(z)
        for i, value in enumerate(np.abs(z).tolist()):
            test.update(value)
            out[i] = max(
                test._sum_increase - test._min_increase, test._max_decrease - test._sum_decrease
            )
        return out


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
        drift: Any = require('river.drift', self.name)
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
