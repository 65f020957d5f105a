# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Flow of the valve in the units of a control room: scaled to 0..1 and in t/h."""

from damadics_fd.core.jit import jit
from damadics_fd.core.valve.flow import (
    bypass_flow,
    density,
    effective_drop,
    inherent,
    mass_flow,
    vapour_pressure,
)
from damadics_fd.core.valve.parameters import Valve
from damadics_fd.core.valve.plug import recovery

P_RANGE = 4.0e6  # Pa, full scale of P1', P2'
T_RANGE = 200.0  # degC, full scale of T1'
F_RANGE = 40.0  # t/h, full scale of F'
TPH_PER_KGS = 3.6


@jit
def valve_flow(
    v: Valve,
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
    Return the flow through valve and bypass, t/h.

    :param v: the valve.
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
    k_vr = inherent(min(xr, 1.0), v.kv_exponent) * scale + leak
    vapour = vapour_pressure(t1)
    p1 = max(p1, vapour)
    drop = effective_drop(recovery(v.plug_table, xr), p1, p2, vapour)
    flow = mass_flow(v.kv * k_vr, drop, density(t1, p1))
    if bypass > 0.0:
        past = effective_drop(recovery(v.plug_table, bypass), p1, p2, vapour)
        flow += bypass_flow(v.bypass_kv, bypass, past)
    return -flow if drop < 0.0 else flow


@jit
def nominal_flow(v: Valve, x: float, p1: float, p2: float, t1: float) -> float:
    """Return f = min(1, F_v / 40), the fault-free flow from inputs scaled to 0..1."""
    flow = valve_flow(v, x, p1 * P_RANGE, p2 * P_RANGE, t1 * T_RANGE, 0.0, 1.0, 0.0, 0.0)
    return min(1.0, flow / F_RANGE)
