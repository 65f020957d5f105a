# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Constants of the DAMADICS actuator (DABLib v1.22) and of its LuGre variant, in one place."""

from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

ATMOSPHERE = 101325.0
"""Atmospheric pressure [Pa]; chamber and supply pressures are gauge unless called absolute."""

RANGES = {'cv': 1.0, 'x1': 1.0, 'p1': 4e6, 'p2': 4e6, 't1': 200.0, 'flow': 40.0 / 3.6}
"""Upper range value of each transmitter in SI (flow in kg/s: 40 t/h); the lower one is 0."""


@dataclass(frozen=True)
class Actuator:
    """
    Constants of the DABLib actuator; the defaults are those of the released library.

    Lengths in m, forces in N, pressures in Pa (gauge), times in s.
    """

    model: ClassVar[str] = 'dablib'

    stroke: float = 0.0381
    """Nominal travel of the plug, X0 [m]."""
    mass: float = 2.0
    """Moving mass m [kg]."""
    stiffness: float = 60892.0
    """Spring and diaphragm constant k [N/m]."""
    preload: float = 0.009525
    """Initial compression of the spring x0 [m]."""
    viscous: float = 1500.0
    """Viscous friction c [N s/m]."""
    play: float = 0.01
    """Width of the play operator, share of the stroke."""
    area: float = 0.0290
    """Effective area of the diaphragm Ae [m2]."""
    dead_volume: float = 0.0055
    """Volume of the chamber at X = 0, V0 [m3]."""
    gravity: float = 9.81
    """Gravity g [m/s2]."""
    supply: float = 600e3
    """Supply pressure Pz [Pa]."""
    supply_minimum: float = 120e3
    """Supply pressure below which the positioner gets none [Pa]."""
    gas_constant: float = 287.0
    """Specific gas constant of air [J/kg/K]."""
    air_temperature: float = 293.0
    """Temperature of the air [K]; the chamber is isothermal."""
    air_flow: float = 2.5e-6
    """Flow factor of the booster at full opening, beta [kg/(s sqrt(Pa))]."""
    leak_flow: float = 2e-7
    """Flow factor of a leak of the chamber at fault strength 1 [kg/(s sqrt(Pa))]."""
    gain: float = 100.0
    """Gain of the positioner k_p [1]."""
    lag: float = 0.30
    """Each of the two lags of the set-point filter [s]."""
    hold: float = 0.035
    """Sample time of the positioner [s]."""
    valve_coefficient: float = 120.0
    """K_v of the open valve [m3/h]."""
    bypass_coefficient: float = 19.75
    """K_v of the open bypass [m3/h]."""
    plug_diameter: float = 50.0
    """Diameter of the plug d [mm]."""

    def record(self) -> 'np.ndarray[Any, np.dtype[Any]]':
        """
        Return the constants as a structured array of length 1 for compiled code.

        :return: array of shape (1,), one float64 field per constant of either model.

        >>> float(Actuator().record()[0].stroke)
        0.0381
        """
        names = [field.name for field in fields(LuGreActuator)]
        constants = np.zeros(1, np.dtype((np.record, [(name, 'f8') for name in names])))
        for name in names:
            constants[name] = getattr(self, name, 0.0)
        return constants


@dataclass(frozen=True)
class LuGreActuator(Actuator):
    """
    The actuator with LuGre friction in place of the play, equations (1)-(9) of the paper.

    The friction constants are chosen, not published: 25 N of Coulomb friction widens the
    pressure-position loop as much as DABLib's play of 1 % of the stroke.
    """

    model: ClassVar[str] = 'lugre'

    coulomb: float = 25.0
    """Coulomb friction f_c [N]."""
    static: float = 35.0
    """Break-away friction f_s [N]."""
    stribeck: float = 1e-3
    """Stribeck velocity v_s [m/s]."""
    bristle_stiffness: float = 1e6
    """sigma_0 [N/m]."""
    bristle_damping: float = 1000.0
    """sigma_1 [N s/m]."""
