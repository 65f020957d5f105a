# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The control valve and its bypass: equal-percentage characteristic, choked flow, density."""

import math

import numpy as np
from damadics_fd.core.jit import jit

from damadics_plant.actuator.physics import KM, KM_POSITION, Record, table

CRITICAL_PRESSURE = (
    np.array([0, 1.723763, 3.447527, 6.895055, 13.790111, 17.237639, 20.685166]) * 1e6
)
CRITICAL_RATIO = np.array([0.94, 0.87, 0.84, 0.79, 0.75, 0.725, 0.685])
"""r_c over P1 [Pa]."""

COMPRESSIBILITY_TEMPERATURE = np.array([0.0, 10.0, 20.0, 50.0, 110.0])
COMPRESSIBILITY = np.array([5.26, 5.02, 4.81, 4.69, 4.42]) * 1e-10
"""Compressibility of water [1/Pa] over its temperature [degC]."""

BYPASS_POSITION = np.linspace(0.0, 1.0, 11)
BYPASS_KM = np.array([0.45, 0.5, 0.555, 0.61, 0.67, 0.725, 0.785, 0.85, 0.90, 0.95, 1.0])
"""K_m of the bypass valve over X_b (1 = closed)."""


@jit
def vapour_pressure(temperature: float) -> float:
    """
    Evaluate the vapour pressure of water.

    :param temperature: of the medium [degC].
    :return: p_v [Pa].
    """
    return 10.0 ** (10.7167 - 2141.0 / (temperature + 273.15))


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
def compressibility(temperature: float) -> float:
    """
    Look up the compressibility of water.

    :param temperature: of the medium [degC].
    :return: C(T) [1/Pa].
    """
    return table(temperature, COMPRESSIBILITY_TEMPERATURE, COMPRESSIBILITY)


@jit
def characteristic(xr: float) -> float:
    """
    Evaluate the inherent characteristic of the valve, equal percentage with n = 5.

    :param xr: relative position of the plug, 0 open, 1 closed.
    :return: K_v / K_v0, going linearly to 0 over the last 2.5 % of the stroke.

    >>> characteristic(1.0)
    0.0
    """
    if xr <= 0.975:
        return math.exp(-5.0 * xr)
    return math.exp(-4.875) * (1.0 - xr) / 0.025


@jit
def valve_flow(
    xr: float, p1: float, p2: float, pv: float, density: float, a: Record, e: Record
) -> float:
    """
    Evaluate the flow through valve and bypass.

    :param xr: relative position of the plug, with the offsets of f2 and f3.
    :param p1: inlet pressure [Pa].
    :param p2: outlet pressure [Pa].
    :param pv: vapour pressure [Pa]; `p1` is not less.
    :param density: of the medium [kg/m3].
    :param a: constants of the actuator.
    :param e: effects of the faults.
    :return: F [t/h]; the benchmark adds the bypass in m3/h.
    """
    liquid = p1 - table(p1, CRITICAL_PRESSURE, CRITICAL_RATIO) * pv
    dp = p1 - p2
    dp_e = min(dp, max(0.0, table(xr, KM_POSITION, KM) * liquid))
    kvr = characteristic(xr) * e.kv_factor + e.kv_offset
    q = a.valve_coefficient * kvr * 100.0 * math.sqrt(abs(dp_e) * 1e-6 / density)
    flow = q * density / 1000.0 * e.flow_factor
    if e.bypass > 0.0:
        km = table(1.0 - e.bypass, BYPASS_POSITION, BYPASS_KM)
        dp_b = min(dp, max(0.0, km * liquid))
        flow += a.bypass_coefficient * e.bypass * 100.0 * math.sqrt(abs(dp_b) * 1e-6 / 1000.0)
    return flow
