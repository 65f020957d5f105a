# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""How much a stem has moved: travel, reversals, full strokes."""

import math

import numpy as np
from numpy.typing import NDArray

DEADBAND = 0.005  # of the stroke: what is smaller counts as noise, not as motion
OPEN, CLOSED = 0.05, 0.95  # positions that a full stroke has to reach
STEP = 0.05  # s between two looks at the position


class Motion:
    """
    Counts of one stem since the last `reset`.

    >>> motion = Motion()
    >>> time = np.arange(31) / 10.0
    >>> motion.take(time, np.abs(time - 1.5) / 1.5)
    >>> round(motion.travel, 2), motion.reversals, motion.cycles
    (2.0, 1, 1)
    """

    def __init__(self) -> None:
        self.travel = 0.0  # strokes
        self.reversals = 0
        self.cycles = 0  # full strokes there and back
        self.seconds = 0.0  # that were looked at
        self.last_full = math.nan  # s, time of the last full stroke
        self._turn = math.nan  # position of the last extreme
        self._way = 0  # 1 closing, -1 opening
        self._ends: list[int] = []  # ends of the stroke that were reached since the last cycle
        self._time = math.nan

    def take(self, time: NDArray[np.float64], position: NDArray[np.float64]) -> None:
        """
        Look at positions.

        :param time: rising [s].
        :param position: 0 = open, 1 = closed; NaN is left out.
        """
        for t, x in zip(time.tolist(), position.tolist(), strict=True):
            if not math.isfinite(x):
                continue
            gap = t - self._time
            if 0.0 <= gap < STEP:
                continue
            self.seconds += gap if 0.0 < gap < 60.0 else 0.0
            self._time = t
            self._move(t, x)

    def reset(self) -> None:
        """Begin to count anew; the last full stroke stays known."""
        self.travel, self.reversals, self.cycles, self.seconds = 0.0, 0, 0, 0.0

    def _move(self, t: float, x: float) -> None:
        if math.isnan(self._turn):
            self._turn = x
        way = 1 if x > self._turn + DEADBAND else -1 if x < self._turn - DEADBAND else 0
        if way:
            self.travel += abs(x - self._turn)
            self.reversals += way == -self._way
            self._turn, self._way = x, way
        end = -1 if x < OPEN else 1 if x > CLOSED else 0
        if end and (not self._ends or self._ends[-1] != end):
            self._ends.append(end)
            if len(self._ends) == 3:
                self.cycles += 1
                self.last_full = t
                self._ends = [end]
