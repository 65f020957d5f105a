# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Force on the stem from measured pressures: u = m g + Ae Ps - Fvc(X, P1, P2)."""

from damadics_fd.core.jit import jit
from damadics_fd.core.valve.parameters import Valve
from damadics_fd.core.valve.plug import recovery


@jit
def force_input(v: Valve, x: float, p1: float, p2: float, ps: float) -> float:
    """
    Return the force on the stem in units of the spring force over one stroke.

    :param v: the valve.
    :param x: stem position, filtered [1].
    :param p1: pressure before the valve [Pa].
    :param p2: pressure behind the valve [Pa].
    :param ps: chamber pressure, gauge [Pa].
    :return: U = (m g + Ae Ps - Fvc) / (K L) [1].
    """
    plug = (p1 - p2) * v.plug_per_force / recovery(v.plug_table, x)
    return v.weight_per_force + ps * v.area_per_force - plug
