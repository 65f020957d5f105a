# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""High-order neural network of equation (15): regressors S1, S2 with the printed sigmoids."""

import math

from damadics_fd.core.approximator.state import TERMS, Network
from damadics_fd.core.jit import jit, layer

M1, L1, C1, LAMBDA1 = 1.41, -10.0225, 0.5974, -2.11  # m, l, c, lambda of S1
M2, L2, C2, LAMBDA2 = 0.8, -4.0, 2.119, -1.5  # of S2
LARGEST = 700.0  # exp of more overflows; the sigmoid is at its lower end long before
MIRROR = math.exp(2.0 * L1 * C1)


@jit
def sigmoids(x2: float) -> tuple[float, float, float]:
    """
    Return the printed sigmoids s(x) = m / (1 + exp(-l (x - c))) + lambda for a velocity.

    :param x2: velocity / stroke [1/s].
    :return: s(x2) and s(|x2|) of S1, s(|x2|) of S2.
    """
    speed = abs(x2)
    fast = math.exp(min(-L1 * (speed - C1), LARGEST))
    slow = math.exp(min(-L2 * (speed - C2), LARGEST))
    # the exponential of -|x2| is MIRROR / fast; one division and no branch for both signs, since
    # noise makes that of a resting stem change at random
    above = 1.0 if x2 >= 0.0 else fast
    below = fast if x2 >= 0.0 else MIRROR
    return (
        M1 * above / (above + below) + LAMBDA1,
        M1 / (1.0 + fast) + LAMBDA1,
        M2 / (1.0 + slow) + LAMBDA2,
    )


@jit
def regress(s: Network, terms: tuple[float, float, float]) -> None:
    """
    Set S1 and S2 of (15) for the sigmoids of a velocity.

    S1 holds all products of total order 1 and 2 of s(x2), s(|x2|); S2 the powers 1..5 of s(|x2|).

    :param s: state record with S1, S2.
    :param terms: what `sigmoids` returns.
    """
    a, b, c = terms
    s.S1[0] = a
    s.S1[1] = b
    s.S1[2] = a * a
    s.S1[3] = a * b
    s.S1[4] = b * b
    power = 1.0
    for i in range(TERMS):
        power *= c
        s.S2[i] = power


@jit
def bound(s: Network, x2: float) -> float:
    """
    Return Phi of (15) for the regressors set by `regress`.

    :param s: state record with weights and regressors.
    :param x2: velocity / stroke [1/s].
    :return: Phi = |x2| w1'S1 + w2'S2 + |x2| eps1 + b1 [1/s2].
    """
    fast = s.eps1
    slow = s.b1
    for i in range(TERMS):
        fast += s.w1[i] * s.S1[i]
        slow += s.w2[i] * s.S2[i]
    return abs(x2) * fast + slow


@layer
def learn(s: Network, x2: float, step: float, w_max: float) -> None:
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
    for i in range(TERMS):
        s.w1[i] += fast * s.S1[i]
        s.w2[i] += step * s.S2[i]
        square += s.w1[i] * s.w1[i] + s.w2[i] * s.w2[i]
    if square > w_max * w_max:
        shrink = w_max / math.sqrt(square)
        s.eps1 *= shrink
        s.b1 *= shrink
        for i in range(TERMS):
            s.w1[i] *= shrink
            s.w2[i] *= shrink
