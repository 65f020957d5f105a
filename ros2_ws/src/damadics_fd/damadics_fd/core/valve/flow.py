# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Flow through the valve: equal-percentage characteristic, choked flow, properties of water."""

import math

import numpy as np

from damadics_fd.core.jit import jit
from damadics_fd.core.valve.tables import interpolate

CRITICAL_PRESSURE = (
    np.array([0, 1.723763, 3.447527, 6.895055, 13.790111, 17.237639, 20.685166]) * 1e6
)
CRITICAL_RATIO = np.array([0.94, 0.87, 0.84, 0.79, 0.75, 0.725, 0.685])
"""r_c over P1 [Pa]."""

COMPRESSIBILITY_TEMPERATURE = np.array([0.0, 10.0, 20.0, 50.0, 110.0])
COMPRESSIBILITY = np.array([5.26, 5.02, 4.81, 4.69, 4.42]) * 1e-10
"""Compressibility of water [1/Pa] over its temperature [degC]."""

SEAT = 0.975  # position from which the plug closes linearly


@jit
def vapour_pressure(temperature: float) -> float:
    """
    Evaluate the vapour pressure of water.

    :param temperature: of the medium [degC].
    :return: p_v [Pa].
    """
    return float(10.0 ** (10.7167 - 2141.0 / (temperature + 273.15)))


@jit
def water_density(temperature: float) -> float:
    """
    Evaluate the density of water at low pressure.

    :param temperature: of the medium [degC], clipped to 0..110.
    :return: density [kg/m3].

    >>> round(water_density(20.0), 1)
    998.2
    """
    t = min(max(temperature, 0.0), 110.0)
    d = (t - 4.0) * (t - 4.0)
    if t < 30.0:
        return 1000.0 - d / 503570.0 * (t + 283.0) * 1000.0 / (t + 67.2)
    return 1000.0 - d * (t + 273.0) * 1000.0 * (350.0 - t) / (466700.0 * (t + 67.0) * (365.0 - t))


@jit
def density(temperature: float, pressure: float) -> float:
    """
    Evaluate the density of water under pressure.

    :param temperature: of the medium [degC].
    :param pressure: of the medium [Pa].
    :return: density [kg/m3].
    """
    compressibility = interpolate(temperature, COMPRESSIBILITY_TEMPERATURE, COMPRESSIBILITY)
    return water_density(temperature) / (1.0 - compressibility * pressure)


@jit
def inherent(x: float, exponent: float) -> float:
    """
    Evaluate the inherent characteristic of the valve, equal percentage.

    :param x: position of the plug, 0 open, 1 closed.
    :param exponent: n of K_v = K_v0 exp(-n x).
    :return: K_v / K_v0, going linearly to 0 from `SEAT` on.

    >>> inherent(1.0, 5.0)
    0.0
    """
    if x <= SEAT:
        return math.exp(-exponent * x)
    return math.exp(-exponent * SEAT) * (1.0 - x) / 0.025


@jit
def effective_drop(km: float, p1: float, p2: float, vapour: float) -> float:
    """
    Return the pressure drop that makes the flow, which chokes where the liquid evaporates.

    :param km: K_m of the opening [1].
    :param p1: inlet pressure, not below the vapour pressure [Pa].
    :param p2: outlet pressure [Pa].
    :param vapour: vapour pressure of the medium [Pa].
    :return: [Pa], negative for a flow backwards.
    """
    liquid = p1 - interpolate(p1, CRITICAL_PRESSURE, CRITICAL_RATIO) * vapour
    return min(p1 - p2, max(0.0, km * liquid))


@jit
def mass_flow(kv: float, drop: float, rho: float) -> float:
    """
    Return the flow through an opening.

    :param kv: its coefficient [m3/h].
    :param drop: pressure drop that makes the flow [Pa]; its size alone matters.
    :param rho: density of the medium [kg/m3].
    :return: flow [t/h], >= 0.
    """
    return kv * 100.0 * math.sqrt(abs(drop) * 1e-6 / rho) * rho / 1000.0


@jit
def bypass_flow(kv: float, opening: float, drop: float) -> float:
    """
    Return the flow through the bypass.

    :param kv: coefficient of the open bypass [m3/h].
    :param opening: 0 closed .. 1 open.
    :param drop: pressure drop that makes the flow [Pa]; its size alone matters.
    :return: flow, >= 0; the benchmark adds it in m3/h to the valve's t/h.
    """
    return kv * opening * 100.0 * math.sqrt(abs(drop) * 1e-6 / 1000.0)
