# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Guard against learning a fault: see that the valve stays the same while it is learned.

The force balance of the moving stem, u - x1 - (alpha1/alpha5) x2 = offset + dK x1 + friction s
with s the direction of motion, is fitted to blocks of the learning time by least squares with
a weak prior. A block that differs from the first by more than the fits' own uncertainty and
a tolerance means that stiffness or friction change; so does a force that leaves the fit of all
blocks by more than the friction itself. What was learned is then thrown away. The fit of all
blocks also tells what the approximator will meet where the stem has not been, or not gone that
way.
"""

import math

import numpy as np

from damadics_fd.core.approximator import network
from damadics_fd.core.approximator.state import FORCE, State
from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats
from damadics_fd.core.settings import Settings

CORRELATION = 0.1  # s; samples closer than this count as one
FRESH = 50_000_000  # ns after its last motion in which the stem slides; later it may stick
PRIOR = (0.05, 0.05, 0.02)  # standard deviations of offset, dK/K, friction
SIGMA_MIN = 1e-3  # of K L: model error of the moving stem
QUICK = 0.5  # s; mean over which a force that leaves the fit is judged
ENOUGH = 8.0  # weight that makes a block comparable, in correlation times
KNOWN = 2.0  # weight of a direction, more than what a reversal leaves of the other one
BLIND = 1.0  # standard deviation of offset against friction where a direction is not known
CONFIDENCE = 3.5  # standard deviations
FAR = 0.15  # change of stiffness, or of the force / (K L), that no valve of that sheet has
LEFT_OVER, LEAST_LEFT = 0.75, 0.015  # misfit: share of the friction, and of K L at least


@jit
def track(s: State, x: float, band: float) -> float:
    """
    Follow the stem through a play, so that noise is no travel.

    :param s: state record.
    :param x: position [1].
    :param band: half width of the play [1].
    :return: the travel since the last call [1].
    """
    if abs(x - s.place) <= band:
        return 0.0
    s.direction = 1.0 if x > s.place else -1.0
    step = x - s.direction * band - s.place
    s.place += step
    s.moved = s.elapsed
    return abs(step)


@jit
def collect(s: State, weight: float, x1: float, left: float) -> None:
    """
    Add a sample to the block.

    :param s: state record.
    :param weight: time step / CORRELATION.
    :param x1: position [1].
    :param left: u - x1 - (alpha1/alpha5) x2 [1].
    """
    b = s.block
    b[0] += weight
    b[1] += weight
    b[2] += weight * x1
    b[3] += weight * s.direction
    b[4] += weight * x1 * x1
    b[5] += weight * x1 * s.direction
    b[6] += weight
    b[7] += weight * left
    b[8] += weight * left * x1
    b[9] += weight * left * s.direction
    b[10] += weight * left * left


@jit
def fit(b: Floats, theta: Floats, cov: Floats) -> float:
    """
    Fit the force balance to the sums of a block.

    :param b: sums, see `collect`.
    :param theta: written: offset, dK/K, friction.
    :param cov: written: their covariance.
    :return: standard deviation of the force from the fit / (K L).
    """
    sigma = SIGMA_MIN
    for _ in range(2):  # with the least sigma, then with the one found
        scale = 1.0 / (sigma * sigma)
        k = 1
        for i in range(FORCE):
            for j in range(i, FORCE):
                cov[i, j] = cov[j, i] = b[k] * scale
                k += 1
            cov[i, i] += 1.0 / (PRIOR[i] * PRIOR[i])
        invert(cov)
        left = b[10]
        for i in range(FORCE):
            theta[i] = scale * (cov[i, 0] * b[7] + cov[i, 1] * b[8] + cov[i, 2] * b[9])
        k = 1
        for i in range(FORCE):
            left -= 2.0 * theta[i] * b[7 + i]
            for j in range(i, FORCE):
                left += (1.0 if i == j else 2.0) * theta[i] * theta[j] * b[k]
                k += 1
        sigma = max(SIGMA_MIN, math.sqrt(max(left, 0.0) / max(b[0] - FORCE, 1.0)))
    return sigma


@jit
def invert(a: Floats) -> None:
    """
    Invert a symmetric positive definite matrix in place by Gauss-Jordan elimination.

    :param a: the matrix.
    """
    for p in range(FORCE):
        pivot = 1.0 / a[p, p]
        a[p, p] = 1.0
        for j in range(FORCE):
            a[p, j] *= pivot
        for i in range(FORCE):
            if i != p:
                factor = a[i, p]
                a[i, p] = 0.0
                for j in range(FORCE):
                    a[i, j] -= factor * a[p, j]


@jit
def both_ways(s: State) -> bool:
    """
    Tell whether the first block holds enough motion in both directions to be complete.

    From motion in one direction a friction is as good an explanation as an offset.

    :param s: state record.
    :return: False where more blocks belong to the first one.
    """
    return bool(s.base[0] - abs(s.base[3]) >= ENOUGH)


@jit
def knows(b: Floats, d: float, least: float) -> bool:
    """
    Tell whether the sums hold motion in a direction.

    :param b: sums, see `collect`.
    :param d: direction of motion, -1 or 1.
    :param least: its least weight; KNOWN where less may be no more than a reversal.
    :return: False where there is less.
    """
    return bool(b[0] + d * b[3] >= 2.0 * least)


@jit
def shared(s: State) -> bool:
    """
    Tell whether the block holds enough motion in a direction that the first one knows.

    :param s: state record.
    :return: False where there is nothing to compare.
    """
    up = knows(s.base, 1.0, KNOWN) and knows(s.block, 1.0, ENOUGH)
    return bool(up or (knows(s.base, -1.0, KNOWN) and knows(s.block, -1.0, ENOUGH)))


@jit
def blind(b: Floats, cov: Floats) -> None:
    """
    Let a direction that the sums do not know tell nothing.

    :param b: sums, see `collect`.
    :param cov: covariance of their fit, in and out.
    """
    for d in (-1.0, 1.0):
        if not knows(b, d, KNOWN):  # offset - d friction is known, offset + d friction is not
            cov[0, 0] += BLIND * BLIND
            cov[2, 2] += BLIND * BLIND
            cov[0, 2] += d * BLIND * BLIND
            cov[2, 0] += d * BLIND * BLIND


@jit
def compare(s: State, c: Settings) -> None:
    """
    Set the distance of the block from the first one, and the change of the parameters.

    :param s: state record: distance, change out.
    :param c: settings record: what change of offset, stiffness and friction is tolerated.
    """
    theta, cov = np.zeros(FORCE), np.zeros((FORCE, FORCE))
    s.sigma = fit(s.base, s.theta, s.cov)
    fit(s.block, theta, cov)
    if not both_ways(s):
        blind(s.base, cov)
        blind(s.block, cov)
    for i in range(FORCE):
        s.change[i] = theta[i] - s.theta[i]
        for j in range(FORCE):
            cov[i, j] += s.cov[i, j]
    cov[0, 0] += c.settled_stiffness * c.settled_stiffness / 4.0
    cov[1, 1] += c.settled_stiffness * c.settled_stiffness
    cov[2, 2] += c.settled_friction * c.settled_friction
    invert(cov)
    s.distance = 0.0
    for i in range(FORCE):
        for j in range(FORCE):
            s.distance += s.change[i] * cov[i, j] * s.change[j]


@jit
def close_block(s: State, c: Settings) -> bool:
    """
    End a block with enough motion: compare it with the first one, and pool all.

    A first block that lacks a direction takes up those that agree with what it does tell; once
    the valve has changed, none that only shows the other direction, where the change is unseen.

    :param s: state record: proven out, the bound that was learned on a valve that stayed the same.
    :param c: settings record.
    :return: False where the valve has changed.
    """
    if s.block[0] < ENOUGH:
        return True
    same = True
    if s.base[0] > 0.0:
        compare(s, c)
        same = s.distance <= c.settled_max
    if both_ways(s):
        s.proven = network.bound(s, 0.0)
        if same:
            s.pool[:] += s.block
    elif same and (s.unsettled == 0 or shared(s)):
        s.base[:] += s.block
        s.pool[:] = s.base
    if same:
        s.sigma = fit(s.pool, s.theta, s.cov)
    s.block[:] = 0.0
    return same


@jit
def unlike(s: State) -> bool:
    """
    Tell whether the force balance is not that of a valve with the constants of the settings.

    :param s: state record with the fit of all blocks.
    :return: True where spring or its origin are far off, or the balance leaves more than friction.
    """
    if not both_ways(s):
        return False
    far = abs(s.theta[1]) > FAR or abs(s.theta[0]) > FAR
    return bool(far or s.sigma > max(LEFT_OVER * abs(s.theta[2]), LEAST_LEFT))


@jit
def foreseen(s: State, stiffness: float, noise: float, low: float, high: float) -> float:
    """
    Return the force the approximator will have to explain in the worst place of the stroke.

    The force balance leaves most at an end of the stroke, in one of the directions. To it come
    CONFIDENCE standard deviations of the noise or of the fit itself, whichever is larger.

    :param s: state record with the fit of all blocks.
    :param stiffness: the relative change of it that alpha5 has learned.
    :param noise: standard deviation of the force / (K L).
    :param low: position at the lower end, with preload [1].
    :param high: position at the upper end, with preload [1].
    :return: force / (K L).
    """
    most = 0.0
    for x1 in (low, high):
        for d in (-1.0, 1.0):
            left = abs(s.theta[0] + (s.theta[1] - stiffness) * x1 + s.theta[2] * d)
            sigma = math.sqrt(max(spread(s, x1, d), 0.0))
            most = max(most, left + CONFIDENCE * max(noise, sigma))
    return most


@jit
def spread(s: State, x1: float, d: float) -> float:
    """
    Return the variance of the force that the fit predicts.

    :param s: state record with the fit of all blocks.
    :param x1: position [1].
    :param d: direction of motion, -1 or 1.
    :return: variance [1].
    """
    return float(
        s.cov[0, 0]
        + s.cov[1, 1] * x1 * x1
        + s.cov[2, 2]
        + 2.0 * (s.cov[0, 1] * x1 + s.cov[0, 2] * d + s.cov[1, 2] * x1 * d)
    )


@jit
def strays(s: State, c: Settings, dt: float, x1: float, left: float) -> bool:
    """
    Tell whether the force has left the fit by more than friction and noise explain.

    :param s: state record: drift in and out.
    :param c: settings record.
    :param dt: time step [s].
    :param x1: position [1].
    :param left: u - x1 - (alpha1/alpha5) x2 [1].
    :return: True where it has.
    """
    d = s.direction
    whole = both_ways(s)
    if not (whole or knows(s.base, d, KNOWN)):
        s.drift = 0.0
        return False
    error = left - s.theta[0] - s.theta[1] * x1 - s.theta[2] * d
    s.drift += min(dt / QUICK, 1.0) * (error - s.drift)
    noise = 5.0 * s.sigma * math.sqrt(CORRELATION / QUICK) + 4.0 * math.sqrt(
        max(spread(s, x1, d), 0.0)
    )
    friction = max(s.theta[2], math.sqrt(s.cov[2, 2]), c.settled_friction)
    if not (whole or knows(s.base, -d, KNOWN)):  # what is taken for an offset may be friction
        friction = max(friction, abs(s.theta[0]) + abs(s.theta[2]))
    if abs(s.drift) <= 1.5 * friction + noise:
        return False
    s.change[0] = s.drift
    s.change[1] = 0.0
    s.change[2] = 0.0
    return True
