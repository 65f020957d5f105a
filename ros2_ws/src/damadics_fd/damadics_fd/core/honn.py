# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""High-order neural network of equation (15): regressors S1, S2 with the printed sigmoids."""

import math
from typing import Any

from damadics_fd.core.jit import jit

N = 5  # terms in each regressor
STATE = [('w1', 'f8', (N,)), ('w2', 'f8', (N,)), ('eps1', 'f8'), ('b1', 'f8'),
         ('S1', 'f8', (N,)), ('S2', 'f8', (N,))]


@jit
def sigmoid(x: float, m: float, slope: float, center: float, shift: float) -> float:
    """
    Return the printed sigmoid m / (1 + exp(-l (x - c))) + lambda.

    :param x: input.
    :param m: height m.
    :param slope: slope l.
    :param center: centre c.
    :param shift: offset lambda.
    :return: its value.
    """
    power = -slope * (x - center)
    if power > 700.0:  # exp would overflow; the sigmoid is at its lower end
        return shift
    return m / (1.0 + math.exp(power)) + shift


@jit
def regress(s: Any, x2: float) -> None:
    """
    Set S1 and S2 of (15) for a velocity.

    S1 holds all products of total order 1 and 2 of s(x2), s(|x2|); S2 the powers 1..5 of s(|x2|).

    :param s: state record with S1, S2.
    :param x2: velocity / stroke [1/s].
    """
    speed = abs(x2)
    b = sigmoid(speed, 1.41, -10.0225, 0.5974, -2.11)
    a = b if x2 >= 0.0 else sigmoid(x2, 1.41, -10.0225, 0.5974, -2.11)
    s.S1[0] = a
    s.S1[1] = b
    s.S1[2] = a * a
    s.S1[3] = a * b
    s.S1[4] = b * b
    c = sigmoid(speed, 0.8, -4.0, 2.119, -1.5)
    power = 1.0
    for i in range(N):
        power *= c
        s.S2[i] = power


@jit
def bound(s: Any, x2: float) -> float:
    """
    Return Phi of (15) for the regressors set by `regress`.

    :param s: state record with weights and regressors.
    :param x2: velocity / stroke [1/s].
    :return: Phi = |x2| w1'S1 + w2'S2 + |x2| eps1 + b1 [1/s2].
    """
    fast = s.eps1
    slow = s.b1
    for i in range(N):
        fast += s.w1[i] * s.S1[i]
        slow += s.w2[i] * s.S2[i]
    return abs(x2) * fast + slow


@jit
def learn(s: Any, x2: float, step: float, w_max: float) -> None:
    """
    Adapt the weights of (15) by one Euler step, projected on a ball.

    :param s: state record with weights and regressors.
    :param x2: velocity / stroke [1/s].
    :param step: dt gw (|xi2| - dz).
    :param w_max: bound on the norm of (w1, w2, eps1, b1).
    """
    fast = step * abs(x2)
    s.eps1 += fast
    s.b1 += step
    square = s.eps1 * s.eps1 + s.b1 * s.b1
    for i in range(N):
        s.w1[i] += fast * s.S1[i]
        s.w2[i] += step * s.S2[i]
        square += s.w1[i] * s.w1[i] + s.w2[i] * s.w2[i]
    if square > w_max * w_max:
        shrink = w_max / math.sqrt(square)
        s.eps1 *= shrink
        s.b1 *= shrink
        for i in range(N):
            s.w1[i] *= shrink
            s.w2[i] *= shrink
