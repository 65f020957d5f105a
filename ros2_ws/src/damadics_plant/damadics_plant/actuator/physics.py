# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Force of the medium on the plug, in the plant's units; the rest is the valve's own physics."""

import math

import numpy as np
from damadics_fd.core.jit import jit
from damadics_fd.core.valve.plug import RECOVERY, recovery, tangent

KM = np.array(RECOVERY)
"""Pressure recovery coefficient K_m over X_r."""


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
    return dp / recovery(KM, xr) * (math.pi * diameter * diameter / 4e6)


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
    km, slope = tangent(KM, xr)
    return -dp / (km * km) * slope / stroke * (math.pi * diameter * diameter / 4e6)
