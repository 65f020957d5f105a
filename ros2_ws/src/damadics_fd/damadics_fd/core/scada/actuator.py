# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Nominal actuator of the SCADA-rate monitor: parameters, valve curves, flow (benchmark 1.6)."""

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from damadics_fd.core.jit import jit

P_RANGE = 4.0e6  # Pa, full scale of P1', P2'
T_RANGE = 200.0  # degC, full scale of T1'
F_RANGE = 40.0  # t/h, full scale of F'
TPH_PER_KGS = 3.6

K_M = np.array([1.0, 0.95, 0.90, 0.85, 0.785, 0.725, 0.67, 0.61, 0.555, 0.5])
R_C_PRESSURE = np.array([0.0, 1.723763, 3.447527, 6.895055, 13.790111, 17.237639, 20.685166])
R_C = np.array([0.94, 0.87, 0.84, 0.79, 0.75, 0.725, 0.685])
COMPRESSION_T = np.array([0.0, 10.0, 20.0, 50.0, 110.0])
COMPRESSION = np.array([5.26e-10, 5.02e-10, 4.81e-10, 4.69e-10, 4.42e-10])


@dataclass(frozen=True)
class Actuator:
    """
    Nominal parameters of the reduced model; the defaults are the benchmark's (section 1.2).

    :param stroke: plug travel X_0, m.
    :param weight: m g, N.
    :param area: diaphragm area A_e, m2.
    :param spring: spring constant k, N/m.
    :param compression: initial spring compression x_0, m.
    :param viscous: viscous friction c, N s/m.
    :param play: width of the play D_b0 as a share of the stroke.
    :param volume: dead volume V_0, m3.
    :param supply: supply pressure P_z, Pa gauge.
    :param beta: air flow factor, kg/(s sqrt(Pa)).
    :param gain: positioner gain k_p.
    :param filter_s: time constant of each of the two input lags, s.
    :param tick_s: hold of the positioner's controller, s.
    :param lever: lever length of the feedback, m.
    :param plug_area: area of the plug, m2.
    :param kv: valve coefficient, m3/h.
    :param exponent: exponent of the equal-percentage curve.
    :param bypass: coefficient of the bypass valve, m3/h.
    """

    stroke: float = 0.0381
    weight: float = 19.62
    area: float = 0.029
    spring: float = 60892.0
    compression: float = 0.009525
    viscous: float = 1500.0
    play: float = 0.01
    volume: float = 0.0055
    supply: float = 6.0e5
    beta: float = 2.5e-6
    gain: float = 100.0
    filter_s: float = 0.3
    tick_s: float = 0.035
    lever: float = 0.0381
    plug_area: float = math.pi * 2500.0 / 4.0e6
    kv: float = 120.0
    exponent: float = 5.0
    bypass: float = 19.75

    def record(self) -> np.ndarray:
        """Return the parameters as a structured array of length 1 for the compiled functions."""
        values = np.zeros(1, ACTUATOR)
        for name, value in asdict(self).items():
            values[name] = value
        return values


ACTUATOR = np.dtype((np.record, [(name, np.float64) for name in Actuator.__dataclass_fields__]))


@jit
def interpolate(x: float, xs: np.ndarray, ys: np.ndarray) -> Any:
    """Return ys at x by linear interpolation, held beyond both ends."""
    if x <= xs[0]:
        return ys[0]
    for i in range(1, xs.size):
        if x <= xs[i]:
            return ys[i - 1] + (ys[i] - ys[i - 1]) * (x - xs[i - 1]) / (xs[i] - xs[i - 1])
    return ys[-1]


@jit
def pressure_recovery(x: float) -> Any:
    """Return K_m at relative stroke x (0 open, 1 closed)."""
    if x <= 0.0:
        return 1.0
    if x < 0.9:
        i = int(x * 10.0)
        return K_M[i] + (K_M[i + 1] - K_M[i]) * (x * 10.0 - i)
    if x < 0.99:
        return 0.5 - 0.05 * (x - 0.9) / 0.09
    if x < 1.0:
        return 0.45 - 0.05 * (x - 0.99) / 0.01
    return 0.40


@jit
def density(t1: float, p1: float) -> Any:
    """Return the density of water, kg/m3, at t1 (degC, clipped to 0..110) and p1 (Pa)."""
    t = min(max(t1, 0.0), 110.0)
    d2 = (t - 4.0) ** 2
    if t < 30.0:
        rho = 1000.0 - d2 / 503570.0 * (t + 283.0) * 1000.0 / (t + 67.2)
    else:
        rho = 1000.0 - d2 * (t + 273.0) * 1000.0 * (350.0 - t) / (
            466700.0 * (t + 67.0) * (365.0 - t)
        )
    return rho / (1.0 - interpolate(t, COMPRESSION_T, COMPRESSION) * p1)


@jit
def valve_flow(
    act: Any,
    x: float,
    p1: float,
    p2: float,
    t1: float,
    offset: float,
    scale: float,
    leak: float,
    bypass: float,
) -> float:
    """
    Return the flow through valve and bypass, t/h (benchmark 1.6).

    :param act: record of `Actuator`.
    :param x: stem position, 0 open .. 1 closed.
    :param p1: inlet pressure, Pa.
    :param p2: outlet pressure, Pa.
    :param t1: temperature, degC.
    :param offset: added to x (faults f2, f3).
    :param scale: factor on K_vr (f2, f3).
    :param leak: added to K_vr (f6).
    :param bypass: opening of the bypass, 0 closed .. 1 (f18).
    :return: flow, t/h; negative where p2 > p1.
    """
    xr = x + offset
    xe = min(xr, 0.975)
    k_vr = math.exp(-act.exponent * xe)
    if xr > 0.975:
        k_vr = math.exp(-4.875) * max(1.0 - xr, 0.0) / 0.025
    k_vr = k_vr * scale + leak
    p_v = 10.0 ** (10.7167 - 2141.0 / (t1 + 273.15))
    p1 = max(p1, p_v)
    dp = p1 - p2
    r_c = interpolate(p1 * 1e-6, R_C_PRESSURE, R_C)
    choked = p1 - r_c * p_v
    dp_e = min(dp, max(0.0, pressure_recovery(xr) * choked))
    rho = density(t1, p1)
    q = act.kv * k_vr * 100.0 * math.sqrt(abs(dp_e) * 1e-6 / rho)
    flow = q * rho / 1000.0
    if bypass > 0.0:
        dp_b = min(dp, max(0.0, pressure_recovery(bypass) * choked))
        flow += act.bypass * bypass * 100.0 * math.sqrt(abs(dp_b) * 1e-6 / 1000.0)
    signed: float = -flow if dp_e < 0.0 else flow
    return signed


@jit
def nominal_flow(act: Any, x: float, p1: float, p2: float, t1: float) -> float:
    """Return f = min(1, F_v / 40), the fault-free flow from inputs scaled to 0..1."""
    flow = valve_flow(act, x, p1 * P_RANGE, p2 * P_RANGE, t1 * T_RANGE, 0.0, 1.0, 0.0, 0.0)
    return min(1.0, flow / F_RANGE)
