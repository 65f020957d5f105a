# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Force of the medium on the plug: its table K_m over the stroke, interpolated in one way."""

from collections.abc import Sequence

import numpy as np

from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats, Rows
from damadics_fd.core.valve.tables import between

POSITION = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.99, 1.0)  # of the nodes [stroke]
RECOVERY = (1.0, 0.95, 0.90, 0.85, 0.785, 0.725, 0.67, 0.61, 0.555, 0.50, 0.45, 0.40)
"""K_m, the pressure recovery coefficient at these positions (DABLib 1.22)."""

_NODES = np.array(POSITION)
_LAST = len(POSITION) - 1


@jit
def recovery(table: Rows[float], x: float) -> float:
    """
    Interpolate K_m; constant beyond the ends of the stroke.

    A node belongs to the part of the table that ends with it. The search costs less than the
    index would, though the nodes are regular: a processor foresees where it ends.

    :param table: K_m at `POSITION`.
    :param x: position [1], 0 open, 1 closed.
    :return: K_m [1]; the force on the plug is (P1 - P2) A / K_m.

    >>> round(recovery(np.array(RECOVERY), 0.45), 4)
    0.755
    """
    if x <= 0.0:
        return float(table[0])
    if x >= 1.0:
        return float(table[_LAST])
    i = 0
    while x > _NODES[i + 1]:
        i += 1
    return between(x, _NODES[i], _NODES[i + 1], table[i], table[i + 1])


@jit
def tangent(table: Rows[float], x: float) -> tuple[float, float]:
    """
    Return K_m and its slope over the position, right of a node.

    :param table: K_m at `POSITION`.
    :param x: position [1], 0 <= x < 1.
    :return: K_m [1] on the tangent, dK_m/dx [1].
    """
    i = 0
    while x >= _NODES[i + 1]:
        i += 1
    slope = (table[i + 1] - table[i]) / (_NODES[i + 1] - _NODES[i])
    return table[i] + slope * (x - _NODES[i]), slope


def recoveries(table: Sequence[float], x: Floats) -> Floats:
    """
    Interpolate K_m at many positions, for figures and fits.

    :param table: K_m at `POSITION`.
    :param x: positions [1], any shape.
    :return: K_m [1], of the same shape.
    """
    km: Floats = np.interp(x, _NODES, np.asarray(table))
    return km
