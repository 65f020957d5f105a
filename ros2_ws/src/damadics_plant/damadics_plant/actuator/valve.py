# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Flow of the medium through the faulty valve and its bypass."""

import numpy as np
from damadics_fd.core.jit import jit
from damadics_fd.core.valve.flow import bypass_flow, effective_drop, inherent, mass_flow
from damadics_fd.core.valve.plug import RECOVERY, recovery
from damadics_fd.core.valve.tables import interpolate

from damadics_plant.actuator.parameters import Constants
from damadics_plant.actuator.physics import KM
from damadics_plant.faults.effects import Effects

EXPONENT = 5.0
"""Of the equal-percentage characteristic."""

BYPASS_POSITION = np.linspace(0.0, 1.0, 11)
BYPASS_KM = np.array((0.45, *RECOVERY[9::-1]))
"""K_m of the bypass valve over X_b (1 = closed)."""


@jit
def valve_flow(
    xr: float, p1: float, p2: float, pv: float, density: float, a: Constants, e: Effects
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
    drop = effective_drop(recovery(KM, xr), p1, p2, pv)
    kvr = inherent(xr, EXPONENT) * e.kv_factor + e.kv_offset
    flow: float = mass_flow(a.valve_coefficient * kvr, drop, density) * e.flow_factor
    if e.bypass > 0.0:
        km = interpolate(1.0 - e.bypass, BYPASS_POSITION, BYPASS_KM)
        flow += bypass_flow(a.bypass_coefficient, e.bypass, effective_drop(km, p1, p2, pv))
    return flow
