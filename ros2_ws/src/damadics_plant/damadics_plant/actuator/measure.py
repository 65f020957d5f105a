# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The transmitters of the actuator, noise-free: position, pressures, temperature, flow."""

import numpy as np
from damadics_fd.core.jit import jit
from damadics_fd.core.valve.flow import density

from damadics_plant.actuator.parameters import Constants
from damadics_plant.actuator.valve import valve_flow
from damadics_plant.faults.effects import Effects

OUTPUTS = ('x1', 'p1', 'p2', 't1', 'flow', 'ps', 'fault', 'strength')
"""Rows of the output of a model, in SI; the last row after them is the true flow [kg/s]."""

ROWS = len(OUTPUTS) + 1


@jit
def measure(
    xr: float,
    x: float,
    ps: float,
    p1: float,
    p2: float,
    t1: float,
    pv: float,
    a: Constants,
    e: Effects,
    out: np.ndarray,
) -> None:
    """
    Fill one sample of the outputs, each within the range of its transmitter.

    :param xr: relative position of the plug with the offsets of f2 and f3.
    :param x: position of the stem / stroke.
    :param ps: pressure of the chamber [Pa].
    :param p1: inlet pressure, faulty where f17 is active [Pa].
    :param p2: outlet pressure [Pa].
    :param t1: temperature of the medium, faulty where f7 is active [degC].
    :param pv: its vapour pressure [Pa].
    :param a: constants of the actuator.
    :param e: effects of the faults.
    :param out: receives `OUTPUTS` and the true flow; shape (`ROWS`,).
    """
    p = max(p1, pv)
    flow = valve_flow(xr, p, p2, pv, density(t1, p), a, e)
    out[0] = min(max(x * e.position, 0.0), 1.0)
    out[1] = min(max(p1, 0.0), 4e6)
    out[2] = min(max(p2, 0.0), 4e6)
    out[3] = min(max(t1, 0.0), 200.0)
    out[4] = min(max(flow * e.flow_sensor, 0.0), 40.0) / 3.6
    out[5] = ps * e.ps_sensor
    out[6] = e.number
    out[7] = e.strength
    out[8] = flow / 3.6
