# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Force of the medium on the plug, in the plant's units; the rest is the valve's own physics."""

import math

import numpy as np
from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats
from damadics_fd.core.valve.plug import RECOVERY, recovery, tangent

KM = np.array(RECOVERY)
"""Pressure recovery coefficient K_m over X_r."""


@jit
def plug_force(km: Floats, xr: float, dp: float, diameter: float) -> float:
    """
    Evaluate the force of the medium on the plug, which opens the valve.

    :param km: pressure recovery coefficient over X_r, `KM` or of a valve of one's own.
    :param xr: relative position of the plug.
    :param dp: pressure drop over the valve [Pa].
    :param diameter: of the plug [mm].
    :return: F_vc [N].

    >>> round(plug_force(KM, 0.0, 0.9e6, 50.0))
    1767
    """
    return dp / recovery(km, xr) * (math.pi * diameter * diameter / 4e6)


@jit
def plug_stiffness(table: Floats, xr: float, dp: float, diameter: float, stroke: float) -> float:
    """
    Evaluate the slope of the plug force over the position.

    :param table: as `km` of `plug_force`.
    :param xr: relative position of the plug.
    :param dp: pressure drop over the valve [Pa].
    :param diameter: of the plug [mm].
    :param stroke: of the valve [m].
    :return: dF_vc/dx [N/m], 0 beyond the ends of the table.
    """
    if xr < 0.0 or xr >= 1.0:
        return 0.0
    km, slope = tangent(table, xr)
    return -dp / (km * km) * slope / stroke * (math.pi * diameter * diameter / 4e6)
