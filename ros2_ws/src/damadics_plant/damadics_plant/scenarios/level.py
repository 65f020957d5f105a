# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A closed loop around the valve: the level of a drum under a PI controller."""

from dataclasses import dataclass, field

import numpy as np

from damadics_plant.scenarios.sources import Constant, Sine, Source


@dataclass
class LevelLoop:
    """
    The loop LC74_20 as a source of CV: the valve feeds a drum, steam is drawn from it.

    Gain and reset time are those of the plant's controller; area of the drum from DABLib's
    Example IV; span of the level and steam draw are chosen.
    """

    set_point: float = 0.5
    """Level, share of the span."""
    gain: float = 5.0
    """k_p [1]: CV per level; a high level closes the valve (CV towards 1)."""
    reset_time: float = 1000 / 0.15
    """T_i [s]."""
    bias: float = 0.6
    """CV at the set point [1]."""
    area: float = 20.0
    """Cross section of the drum [m2]."""
    span: float = 1.0
    """Height that the level transmitter covers [m]."""
    draw: Source = field(default_factory=lambda: Sine(15 / 3.6, 3 / 3.6, 0.005))
    """Steam drawn [kg/s]."""
    period: float = 1.0
    """Sample time of the controller [s]."""
    level: float = field(default=0.5, init=False)
    """Present level, share of the span."""
    _integral: float = field(default=0.0, init=False, repr=False)
    _cv: float = field(default=0.0, init=False, repr=False)

    def __post_init__(self) -> None:
        """
        Check the values.

        :raises ValueError: if one is not admissible.
        """
        for name in ('reset_time', 'area', 'span', 'period'):
            if not getattr(self, name) > 0:
                raise ValueError(f'level_loop: {name} must be > 0, is {getattr(self, name)!r}')
        self.level = self.set_point

    def fresh(self) -> 'LevelLoop':
        """
        Return the loop at its beginning.

        :return: a loop with the same settings.
        """
        return LevelLoop(
            self.set_point,
            self.gain,
            self.reset_time,
            self.bias,
            self.area,
            self.span,
            self.draw,
            self.period,
        )

    def control(self) -> None:
        """Evaluate the controller on the present level for the next period."""
        error = self.level - self.set_point
        cv = self.bias + self.gain * error + self._integral
        if 0.0 <= cv <= 1.0:  # no wind-up
            self._integral += self.gain * error * self.period / self.reset_time
        self._cv = min(max(cv, 0.0), 1.0)

    def fill(self, t: float, inflow: float) -> None:
        """
        Balance the drum over a period.

        :param t: begin of the period [s].
        :param inflow: mean flow through the valve [kg/s].
        """
        outflow = float(self.draw.at(np.array([t]))[0])
        level = self.level + (inflow - outflow) * self.period / (1000.0 * self.area * self.span)
        self.level = min(max(level, 0.0), 1.0)

    def at(self, t: np.ndarray) -> np.ndarray:
        """Evaluate, see `Source`; the controller's present output."""
        return Constant(self._cv).at(t)
