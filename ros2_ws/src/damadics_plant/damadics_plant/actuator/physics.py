# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Positioner, pneumatics and plug force: what the DABLib and the LuGre plant have in common."""

import math
from typing import Any

import numpy as np
from damadics_fd.core.jit import jit

Record = Any
"""A numpy record: settings or state of compiled code."""

KM_POSITION = np.array([0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.99, 1.0])
KM = np.array([1, 0.95, 0.90, 0.85, 0.785, 0.725, 0.67, 0.61, 0.555, 0.5, 0.45, 0.40])
"""Pressure recovery coefficient K_m over X_r."""

TRANSDUCER_INPUT = np.array([-1, -0.94, -0.54, 0.46, 0.86, 1])
TRANSDUCER_OUTPUT = np.array([-0.55, -0.55, -0.02, 0.02, 1, 1])
"""Characteristic of the E/P transducer: a strongly asymmetric quasi dead zone."""


@jit
def table(x: float, xs: np.ndarray, ys: np.ndarray) -> float:
    """
    Interpolate linearly in a short table; constant beyond its ends.

    :param x: where.
    :param xs: increasing abscissae.
    :param ys: ordinates.
    :return: the interpolated ordinate.

    >>> table(0.25, np.array([0.0, 1.0]), np.array([2.0, 4.0]))
    2.5
    """
    if x <= xs[0]:
        return ys[0]
    last = len(xs) - 1
    if x >= xs[last]:
        return ys[last]
    i = 1
    while x > xs[i]:
        i += 1
    return ys[i - 1] + (x - xs[i - 1]) / (xs[i] - xs[i - 1]) * (ys[i] - ys[i - 1])


@jit
def set_point_filter(
    y1: float, y2: float, cv: float, q: float, decay: float
) -> tuple[float, float]:
    """
    Pass CV through the positioner's two equal lags for one step, exactly.

    :param y1: output of the first lag.
    :param y2: output of the second lag.
    :param cv: control value, constant over the step.
    :param q: step / lag.
    :param decay: exp(-q).
    :return: both outputs after the step.
    """
    u = min(max(cv, 0.0), 1.024)
    return u + (y1 - u) * decay, u + (y2 - u + q * (y1 - u)) * decay


@jit
def feedback_angle(x: float, stroke: float) -> float:
    """
    Convert the stem position to the lever angle the positioner sees.

    :param x: position [m], -0.01..0.05.
    :param stroke: length of the lever [m].
    :return: PV, 0 open, 1 closed.
    """
    return 0.5 + math.asin((x - 0.5 * stroke) / stroke) * (180.0 / math.pi) / 60.0


@jit
def transducer(sp: float, pv: float, gain: float) -> float:
    """
    Evaluate the P controller and the E/P transducer.

    :param sp: filtered set point.
    :param pv: measured position.
    :param gain: k_p.
    :return: opening of the booster, > 0 fills the chamber, < 0 vents it.
    """
    cvi = min(max(gain * (sp - pv), -1.0), 1.0)
    return table(cvi, TRANSDUCER_INPUT, TRANSDUCER_OUTPUT)


@jit
def air_flow(opening: float, supply: float, ps: float, factor: float) -> float:
    """
    Evaluate the mass flow of air into the chamber.

    :param opening: output of the E/P transducer, -1..1.
    :param supply: supply pressure [Pa].
    :param ps: pressure of the chamber [Pa].
    :param factor: flow factor beta [kg/(s sqrt(Pa))].
    :return: mass flow [kg/s], > 0 into the chamber.
    """
    drop = (supply if opening > 0 else 0.0) - ps
    flow = factor * abs(opening) * math.sqrt(abs(drop))
    return flow if drop > 0 else -flow


@jit
def plug_force(xr: float, dp: float, diameter: float) -> float:
    """
    Evaluate the force of the medium on the plug, which opens the valve.

    :param xr: relative position of the plug.
    :param dp: pressure drop over the valve [Pa].
    :param diameter: of the plug [mm].
    :return: F_vc [N].

    >>> round(plug_force(0.0, 0.9e6, 50.0))
    1767
    """
    return dp / table(xr, KM_POSITION, KM) * (math.pi * diameter * diameter / 4e6)


@jit
def plug_stiffness(xr: float, dp: float, diameter: float, stroke: float) -> float:
    """
    Evaluate the slope of the plug force over the position.

    :param xr: relative position of the plug.
    :param dp: pressure drop over the valve [Pa].
    :param diameter: of the plug [mm].
    :param stroke: of the valve [m].
    :return: dF_vc/dx [N/m], 0 beyond the ends of the table.
    """
    if xr < 0.0 or xr >= 1.0:
        return 0.0
    i = 1
    while xr >= KM_POSITION[i]:
        i += 1
    slope = (KM[i] - KM[i - 1]) / (KM_POSITION[i] - KM_POSITION[i - 1])
    km = KM[i - 1] + slope * (xr - KM_POSITION[i - 1])
    return -dp / (km * km) * slope / stroke * (math.pi * diameter * diameter / 4e6)
