# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Interpolation in the tables of the valve, for every model of it."""

from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats


@jit
def between(x: float, x0: float, x1: float, y0: float, y1: float) -> float:
    """
    Interpolate linearly between two nodes.

    :param x: where, x0..x1.
    :param x0: abscissa of the first node.
    :param x1: abscissa of the second node.
    :param y0: ordinate of the first node.
    :param y1: ordinate of the second node.
    :return: the ordinate at x.
    """
    return y0 + (x - x0) / (x1 - x0) * (y1 - y0)


@jit
def interpolate(x: float, xs: Floats, ys: Floats) -> float:
    """
    Interpolate linearly in a short table; constant beyond its ends.

    :param x: where.
    :param xs: increasing abscissae.
    :param ys: ordinates.
    :return: the ordinate at x.

    >>> interpolate(0.25, np.array([0.0, 1.0]), np.array([2.0, 4.0]))
    2.5
    """
    last = len(xs) - 1
    if x <= xs[0]:
        return float(ys[0])
    if x >= xs[last]:
        return float(ys[last])
    i = 1
    while x > xs[i]:
        i += 1
    return between(x, xs[i - 1], xs[i], ys[i - 1], ys[i])
