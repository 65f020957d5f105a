# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What describes the valve: the one parameter record, read by every mode and by the simulator."""

import math
from dataclasses import dataclass
from typing import ClassVar

from damadics_fd.core.field import Section, choice, number, table
from damadics_fd.core.valve.plug import RECOVERY

DIRECTIONS = ('close', 'open')


@dataclass(frozen=True)
class Valve(Section):
    """
    Describe one valve with its actuator, as the data sheet or commissioning knows it.

    Positions X are 0 = open, 1 = closed for every valve; forces are positive towards closed:

        m a = m g + Ae Ps - Fvc - K L (X + origin) - friction.

    Where the air opens the valve, Ae counts negative, and the spring, which then closes, is
    relaxed beyond the closed end: origin = -(1 + preload). Where the flow closes the plug, its
    force Fvc = (P1 - P2) A / K_m counts negative.
    """

    DERIVED: ClassVar[tuple[str, ...]] = (
        *('air_sign', 'spring_origin', 'signed_area', 'signed_plug_area', 'open_volume'),
        *('weight_per_force', 'area_per_force', 'plug_per_force'),
    )

    # stem and spring
    air_to: str = choice(
        'what the air in the servomotor does to the valve; the spring does the opposite',
        DIRECTIONS,
        'close',
    )
    flow_to: str = choice(
        'what the flow does to the plug: it pushes it to open or to close', DIRECTIONS, 'open'
    )
    mass: float = number('kg', 'moving mass', 1e-3, 1e5, 2.0)
    gravity: float = number('m/s2', 'gravity along the stem, towards closed', -10.0, 10.0, 9.81)
    stiffness: float = number('N/m', 'spring and diaphragm constant K', 1.0, 1e9, 60892.0)
    stroke: float = number('m', 'travel of the stem', 1e-4, 10.0, 0.0381)
    preload: float = number(
        '', 'initial compression of the spring / stroke', 0.0, 10.0, 0.25, paper=0.0
    )
    area: float = number('m2', 'effective area of the diaphragm', 1e-6, 10.0, 0.029)
    viscous: float = number('N s/m', 'viscous friction of the stem', 0.0, 1e9, 1500.0)
    stem_play: float = number('', 'play of the stem / stroke, its dry friction', 0.0, 0.5, 0.01)
    hysteresis: float = number(
        'N', 'hysteresis of the diaphragm, which a moving stem shows as friction', 0.0, 1e9, 0.0
    )
    hysteresis_std: float = number(
        'N', 'how well that hysteresis is known: its standard deviation', 0.0, 1e9, 0.0
    )

    # plug and flow
    plug_diameter: float = number('m', 'plug diameter', 0.0, 2.0, 0.05)
    plug_table: tuple[float, ...] = table(
        '', 'K_m of the plug force at 0, 10, .., 90, 99, 100 % of stroke', 0.01, 10.0, RECOVERY
    )
    kv: float = number('m3/h', 'flow coefficient of the open valve', 1e-6, 1e6, 120.0)
    kv_exponent: float = number(
        '', 'n of the equal-percentage characteristic exp(-n x)', 0.0, 20.0, 5.0
    )
    bypass_kv: float = number('m3/h', 'flow coefficient of the open bypass', 0.0, 1e6, 19.75)

    # positioner and air path
    supply_pressure: float = number(
        'Pa', 'supply pressure of the positioner, gauge', 1e4, 5e6, 600e3
    )
    chamber_volume: float = number('m3', 'dead volume of the servomotor', 0.0, 10.0, 5.5e-3)
    air_flow: float = number('kg/s/Pa^0.5', 'flow factor of the open booster', 1e-12, 1.0, 2.5e-6)
    positioner_gain: float = number('', 'gain of the positioner', 1e-3, 1e6, 100.0)
    positioner_lag: float = number(
        's', 'each of the two lags of its set-point filter', 1e-3, 1e3, 0.3
    )
    positioner_period: float = number('s', 'sample time of the positioner', 1e-3, 10.0, 0.035)

    # transmitters
    signal_low: float = number(
        '', 'cv and x1 below it are refused (NAMUR NE 43: 3.6 mA)', -1.0, 0.0, -0.025
    )
    signal_high: float = number(
        '', 'cv and x1 above it are refused (NAMUR NE 43: 21 mA)', 1.0, 2.0, 1.0625
    )
    p_max: float = number('Pa', 'p1 and p2 above it are refused', 1e3, 1e9, 4.25e6)
    ps_max: float = number('Pa', 'ps above it is refused', 1e3, 1e8, 1e6)
    ps_lag: float = number(
        's',
        'damping of the transmitter of the chamber pressure; the other signals are delayed alike',
        0.0,
        10.0,
        0.0,
    )
    ps_lag_std: float = number(
        's', 'how well that damping is known: its standard deviation', 0.0, 10.0, 0.0
    )

    @property
    def air_sign(self) -> float:
        """
        Return which way the air drives the stem.

        :return: 1 where it closes the valve, -1 where it opens it.
        """
        return 1.0 if self.air_to == 'close' else -1.0

    @property
    def open_volume(self) -> float:
        """
        Return the volume of the chamber at the open end.

        :return: [m3]; `signed_area` times the position is to be added.
        """
        swept = self.area * self.stroke
        return self.chamber_volume if self.air_to == 'close' else self.chamber_volume + swept

    @property
    def spring_origin(self) -> float:
        """
        Return where the spring is relaxed, so that its force is K L (X + origin), + to open.

        :return: preload where the spring opens, -(1 + preload) where it closes [1].
        """
        return self.preload if self.air_to == 'close' else -1.0 - self.preload

    @property
    def signed_area(self) -> float:
        """
        Return the area of the diaphragm, negative where the air opens.

        :return: [m2].
        """
        return self.area if self.air_to == 'close' else -self.area

    @property
    def signed_plug_area(self) -> float:
        """
        Return the area of the plug, negative where the flow closes.

        :return: [m2].
        """
        area = math.pi * self.plug_diameter**2 / 4.0
        return area if self.flow_to == 'open' else -area

    @property
    def force_scale(self) -> float:
        """K L, the force of the spring over one stroke [N]."""
        return self.stiffness * self.stroke

    @property
    def weight_per_force(self) -> float:
        """Weight of what moves / (K L) [1]."""
        return self.mass * self.gravity / self.force_scale

    @property
    def area_per_force(self) -> float:
        """Area of the diaphragm / (K L), negative where the air opens [1/Pa]."""
        return self.signed_area / self.force_scale

    @property
    def plug_per_force(self) -> float:
        """Area of the plug / (K L), negative where the flow closes [1/Pa]."""
        return self.signed_plug_area / self.force_scale
