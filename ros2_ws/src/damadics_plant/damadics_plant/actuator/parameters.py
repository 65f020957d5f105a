# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Constants of the DAMADICS actuator (DABLib v1.22) and of its LuGre variant, in one place."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from damadics_fd.core.record import Array, Floats, Record
from damadics_fd.core.sample import TABLE
from damadics_fd.core.valve.parameters import Valve
from damadics_fd.core.valve.plug import RECOVERY
from damadics_fd.core.valve.pneumatics import AIR_TEMPERATURE, GAS_CONSTANT

NODES = 31
"""Errors at which the opening of a positioner of one's own is stated."""

OTHERWISE = {'recovery': RECOVERY}
"""Of an actuator that is no twin; all else is 0."""

VALVE = Valve()
"""The benchmark's valve as its monitor knows it."""

RANGES = {signal.name: signal.span for signal in TABLE if signal.name != 'ps'}
"""Upper range value of each transmitter in SI (flow in kg/s: 40 t/h); the lower one is 0."""


class Constants(Record):
    """What compiled code knows of an actuator of either model; units as in `TwinActuator`."""

    stroke: float
    mass: float
    stiffness: float
    preload: float
    viscous: float
    play: float
    area: float
    dead_volume: float
    gravity: float
    supply: float
    supply_minimum: float
    gas_constant: float
    air_temperature: float
    air_flow: float
    leak_flow: float
    gain: float
    lag: float
    hold: float
    valve_coefficient: float
    bypass_coefficient: float
    plug_diameter: float
    coulomb: float
    static: float
    stribeck: float
    bristle_stiffness: float
    bristle_damping: float
    air_opens: float
    flow_closes: float
    recovery: Annotated[Floats, len(RECOVERY)]
    errors: Annotated[Floats, NODES]
    openings: Annotated[Floats, NODES]
    reset_rate: float
    reset_band: float
    fill_slope: float
    vent_slope: float


@dataclass(frozen=True)
class Actuator:
    """
    Constants of the DABLib actuator; the defaults are those of the released library.

    Lengths in m, forces in N, pressures in Pa (gauge), times in s.
    """

    model: ClassVar[str] = 'dablib'

    stroke: float = VALVE.stroke
    """Nominal travel of the plug, X0 [m]."""
    mass: float = VALVE.mass
    """Moving mass m [kg]."""
    stiffness: float = VALVE.stiffness
    """Spring and diaphragm constant k [N/m]."""
    preload: float = VALVE.preload * VALVE.stroke
    """Initial compression of the spring x0 [m]."""
    viscous: float = VALVE.viscous
    """Viscous friction c [N s/m]."""
    play: float = VALVE.stem_play
    """Width of the play operator, share of the stroke."""
    area: float = VALVE.area
    """Effective area of the diaphragm Ae [m2]."""
    dead_volume: float = VALVE.chamber_volume
    """Volume of the chamber at X = 0, V0 [m3]."""
    gravity: float = VALVE.gravity
    """Gravity g [m/s2]."""
    supply: float = VALVE.supply_pressure
    """Supply pressure Pz [Pa]."""
    supply_minimum: float = 120e3
    """Supply pressure below which the positioner gets none [Pa]."""
    gas_constant: float = GAS_CONSTANT
    """Specific gas constant of air [J/kg/K]."""
    air_temperature: float = AIR_TEMPERATURE
    """Temperature of the air [K]; the chamber is isothermal."""
    air_flow: float = VALVE.air_flow
    """Flow factor of the booster at full opening, beta [kg/(s sqrt(Pa))]."""
    leak_flow: float = 2e-7
    """Flow factor of a leak of the chamber at fault strength 1 [kg/(s sqrt(Pa))]."""
    gain: float = VALVE.positioner_gain
    """Gain of the positioner k_p [1]."""
    lag: float = VALVE.positioner_lag
    """Each of the two lags of the set-point filter [s]."""
    hold: float = VALVE.positioner_period
    """Sample time of the positioner [s]."""
    valve_coefficient: float = VALVE.kv
    """K_v of the open valve [m3/h]."""
    bypass_coefficient: float = VALVE.bypass_kv
    """K_v of the open bypass [m3/h]."""
    plug_diameter: float = 1000.0 * VALVE.plug_diameter
    """Diameter of the plug d [mm]."""

    def record(self) -> Array:
        """
        Return the constants as a structured array of length 1 for compiled code.

        :return: array of shape (1,), one float64 field per constant of either model.

        >>> float(Actuator().record()[0].stroke)
        0.0381
        """
        constants = Constants.rows()
        for name in Constants.names():
            constants[name] = getattr(self, name, OTHERWISE.get(name, 0.0)) or 0.0
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


@dataclass(frozen=True)
class TwinActuator(LuGreActuator):
    """The actuator with LuGre friction and what else a valve of one's own has otherwise."""

    air_opens: float = 0.0
    """1: the air opens the valve and the spring closes it; 0: the other way."""
    flow_closes: float = 0.0
    """1: the flow pushes the plug to close; 0: to open."""
    recovery: tuple[float, ...] = RECOVERY
    """K_m of the plug force at 0, 10, .., 90, 99, 100 % of the stroke."""
    errors: tuple[float, ...] = ()
    """Set-point less position at `NODES` points, rising, 0 in their middle; empty: the
    benchmark's lever and transducer."""
    openings: tuple[float, ...] = ()
    """Opening of the booster there as a share of `air_flow`: > 0 fills, < 0 vents."""
    reset_rate: float = 0.0
    """Rate at which such a positioner integrates the error, to half of the band at most [1/s]."""
    reset_band: float = 0.1
    """Error beyond which it begins anew, share of the stroke."""
    fill_slope: float = 0.0
    """Growth of the filling flow beside the root law with the chamber pressure, per supply."""
    vent_slope: float = 0.0
    """The same of venting."""
