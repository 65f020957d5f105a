# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Partial strokes: steps of the control value about the scenario's own."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

HOLD = 4.0  # s on each side


@dataclass(frozen=True)
class Strokes:
    """Hold strokes to be made."""

    start: float  # s of scenario time
    amplitude: float  # half of a stroke, share of full travel
    count: int

    def apply(self, t: NDArray[np.float64], cv: NDArray[np.float64]) -> None:
        """
        Add the strokes to a control value.

        :param t: times [s].
        :param cv: control value 0..1 at these times; changed in place.
        """
        half = np.floor((t - self.start) / HOLD)
        under_way = (half >= 0.0) & (half < 2 * self.count)
        side = np.where(half % 2.0 == 0.0, self.amplitude, -self.amplitude)
        cv[under_way] = np.clip(cv + side, 0.0, 1.0)[under_way]
