# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Force on the stem from measured pressures: u = m g + Ae Ps - Fvc(X, P1, P2)."""

from typing import Any

from damadics_fd.core.jit import jit


@jit
def plug_coefficient(c: Any, x: float) -> float:
    """
    Interpolate K_m of the plug-force law.

    :param c: settings record with `plug_table` at 0, 10, .., 90, 99, 100 % of the stroke.
    :param x: stem position [1], clipped to 0..1.
    :return: K_m [1].
    """
    x = min(max(x, 0.0), 1.0)
    if x >= 0.99:
        return c.plug_table[10] + (c.plug_table[11] - c.plug_table[10]) * (x - 0.99) * 100.0
    if x >= 0.9:
        return c.plug_table[9] + (c.plug_table[10] - c.plug_table[9]) * (x - 0.9) / 0.09
    i = int(x * 10.0)
    return c.plug_table[i] + (c.plug_table[i + 1] - c.plug_table[i]) * (x * 10.0 - i)


@jit
def force_input(c: Any, x: float, p1: float, p2: float, ps: float) -> float:
    """
    Return the force on the stem in units of the spring force over one stroke.

    :param c: settings record.
    :param x: stem position, filtered [1].
    :param p1: pressure before the valve [Pa].
    :param p2: pressure behind the valve [Pa].
    :param ps: chamber pressure, gauge [Pa].
    :return: U = (m g + Ae Ps - Fvc) / (K L) [1].
    """
    plug = (p1 - p2) * c.plug_per_force / plug_coefficient(c, x)
    return c.weight + ps * c.area_per_force - plug
