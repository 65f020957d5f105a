# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The fault-free valve: u = K x1 + b + c v + (Fc + Fs e^-(v/vs)^2) sgn v + error of the plug force.

Stiffness, preload, viscous and dry friction are the reference proper; what dry friction is more
at low speed (Stribeck) is fitted to keep it apart from them. The correction of the plug force
belongs to the valve too, for 1 % of the plug force is as large as the whole dry friction: a
piecewise linear share of it over the position, as no table is known that well, and the time by
which P1 - P2 is measured too late, as 3 ms of a pulsating pressure are 1 N.
"""

import math

from damadics_fd.core.jit import jit
from damadics_fd.core.linalg import inverse
from damadics_fd.core.record import Floats
from damadics_fd.core.signature.air.strokes import forget_air
from damadics_fd.core.signature.cues import forget_stick
from damadics_fd.core.signature.evidence import clear_set
from damadics_fd.core.signature.phase import enter
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.state import (
    LAG,
    N_REF,
    N_TABLE,
    SET_ALARM,
    SET_UNIT,
    SIGN,
    STATE_INSUFFICIENT,
    STATE_LEARN,
    STRIBECK,
    TABLE,
    State,
)
from damadics_fd.core.signature.sums import accumulate

INFLATION = 2.0  # model error of the reference, as a factor on its variance
STICK_FLOOR = 0.005  # [1] lowest stick range to compare with
GROWTH = 1.25  # of the record between two fits of the unit: a fault's first blocks seldom count


@jit
def start_learning(s: State, c: SignatureSettings) -> None:
    """
    Forget the reference and learn it anew.

    :param s: state record.
    :param c: settings record.
    """
    enter(s, STATE_LEARN, s.t)
    s.verified = 0
    s.kappa = 1.0
    s.sigma = c.sigma_min
    s.theta[:] = 0.0
    s.J0[:, :] = 0.0
    for i in range(TABLE):
        s.theta[i] = c.theta_nominal[i]
    clear_set(s, SET_ALARM)
    clear_set(s, SET_UNIT)
    s.unit_weight = 0.0
    s.n_learn = 0.0
    s.n_up = 0
    s.n_down = 0
    s.x_low = 1.0
    s.x_high = 0.0
    forget_stick(s)
    forget_air(s)


@jit
def learn_block(s: State) -> None:
    """
    Add a moving block to the sums of the reference.

    :param s: state record.
    """
    accumulate(s, SET_ALARM, 1.0, s.block.u)
    if s.block.v > 0.0:
        s.n_up += 1
    else:
        s.n_down += 1
    s.x_low = min(s.x_low, s.block.x)
    s.x_high = max(s.x_high, s.block.x)


@jit
def learning_progress(s: State, c: SignatureSettings) -> float:
    """
    Return the share of the learning that is done, by its slowest condition.

    :param s: state record.
    :param c: settings record.
    :return: 0..1.
    """
    done: float = (s.t - s.t0) * 1e-9 / c.learn
    done = min(done, s.n_up / c.learn_blocks)
    done = min(done, s.n_down / c.learn_blocks)
    done = min(done, s.ne[SET_ALARM] / c.learn_weight)
    done = min(done, (s.x_high - s.x_low) / c.learn_range)
    return max(0.0, min(1.0, done))


@jit
def finish_learning(s: State, c: SignatureSettings) -> bool:
    """
    Compute the reference if the valve has moved enough.

    :param s: state record; theta, J0, sigma and r_ref are written.
    :param c: settings record.
    :return: True if learning is over.
    """
    if learning_progress(s, c) < 1.0:
        if s.state == STATE_LEARN and (s.t - s.t0) * 1e-9 >= 2.0 * c.learn:
            enter(s, STATE_INSUFFICIENT, s.t)
        return False
    if not solve_reference(s, c):
        return False
    s.r_ref = max(s.r_max, max(2.4 * s.theta[SIGN], STICK_FLOOR))
    return True


@jit
def fit_sums(s: State, c: SignatureSettings, m: int, theta: Floats) -> float:
    """
    Fit the fault-free model to the sums of one set.

    :param s: state record; Gm receives the covariance of the fit in units of sigma^2.
    :param c: settings record.
    :param m: index of the set.
    :param theta: receives the parameters.
    :return: sigma, noise of a block; negative where the sums are not usable.
    """
    S, q = s.S[m], s.q[m]
    H, work, prior = s.work.Gm[0], s.work.L[0], s.work.Y[0]
    n = len(theta)
    prior_precision(prior, c, work, n)
    for i in range(n):
        for j in range(n):
            H[i, j] = S[i, j] + prior[i, j]
    if not inverse(H, work, n):
        return -1.0
    for i in range(n):  # theta0 = H^-1 (q0 + Pi theta_nominal)
        theta[i] = 0.0
        for j in range(n):
            a = q[j]
            for k in range(TABLE):
                a += prior[j, k] * c.theta_nominal[k]
            theta[i] += H[i, j] * a
    misfit, freedom = s.rr[m], s.ne[m]
    for i in range(n):
        misfit -= 2.0 * theta[i] * q[i]
        for j in range(n):
            misfit += theta[i] * S[i, j] * theta[j]
            freedom -= H[i, j] * S[j, i]  # parameters that the data, not the prior, decide
    sigma: float = max(c.sigma_min, math.sqrt(max(misfit, 0.0) / max(freedom, 1.0)))
    return sigma


@jit
def solve_reference(s: State, c: SignatureSettings) -> bool:
    """
    Compute the reference from the sums over the fault-free valve.

    :param s: state record; theta, J0, sigma, n_learn and the unit of sizes are written.
    :param c: settings record.
    :return: False where the sums are not usable.
    """
    sigma = fit_sums(s, c, SET_ALARM, s.theta)
    if sigma < 0.0:
        return False
    s.sigma = sigma
    s.n_learn = s.ne[SET_ALARM]
    take_unit(s, s.theta, sigma, s.n_learn)
    H, n = s.work.Gm[0], len(s.theta)
    for i in range(n):
        for j in range(n):
            H[i, j] *= INFLATION * sigma * sigma
        floor = c.floor[i] if i < TABLE else c.plug_floor
        H[i, i] += floor * floor
    if not inverse(H, s.work.L[0], n):
        return False
    for i in range(n):
        for j in range(n):
            s.J0[i, j] = H[i, j]
    return True


@jit
def take_unit(s: State, theta: Floats, sigma: float, weight: float) -> None:
    """
    State sizes from now on in units of the valve just fitted.

    :param s: state record; Gm is read, the unit of sizes is written.
    :param theta: parameters of the fit.
    :param sigma: noise of a block.
    :param weight: blocks that the fit rests on.
    """
    variance = (s.kappa * sigma) ** 2
    for i in range(TABLE):
        s.unit[i] = theta[i]
        for j in range(TABLE):
            s.unit_cov[i, j] = variance * s.work.Gm[0, i, j]
    s.unit_weight = weight


@jit
def refine_unit(s: State, c: SignatureSettings) -> None:
    """
    Add a fault-free block to what sizes are stated in; fit anew when its record has grown.

    A strong change is a share of the learned value, and no better known than that. What alarms
    rest on does not change.

    :param s: state record.
    :param c: settings record.
    """
    if s.unit_weight >= c.size_weight:
        return
    accumulate(s, SET_UNIT, 1.0, s.block.u)
    if s.ne[SET_UNIT] >= GROWTH * s.unit_weight:
        sigma = fit_sums(s, c, SET_UNIT, s.work.y0)
        if sigma > 0.0:
            take_unit(s, s.work.y0, sigma, s.ne[SET_UNIT])


@jit
def prior_precision(Pi: Floats, c: SignatureSettings, work: Floats, n: int) -> None:
    """
    Fill the prior information on the reference, scaled to the smallest block noise.

    :param Pi: n x n or larger, written.
    :param c: settings record.
    :param work: scratch of at least n x n.
    :param n: N_REF.
    """
    for i in range(n):
        for j in range(n):
            Pi[i, j] = 0.0
    for i in range(TABLE):
        Pi[i, i] = c.theta_std[i] * c.theta_std[i]
    for i in range(N_TABLE):
        for j in range(N_TABLE):
            Pi[TABLE + i, TABLE + j] = c.plug_gain_std * c.plug_gain_std
        Pi[TABLE + i, TABLE + i] += c.plug_shape_std * c.plug_shape_std
    Pi[LAG, LAG] = c.lag_std * c.lag_std
    Pi[STRIBECK, STRIBECK] = c.stribeck_std * c.stribeck_std
    inverse(Pi, work, n)
    for i in range(n):
        for j in range(n):
            Pi[i, j] *= c.sigma_min * c.sigma_min


@jit
def widen_reference(s: State, kappa: float) -> None:
    """
    Verify the reference: take the misfit seen into its noise and its error.

    :param s: state record.
    :param kappa: factor on the standard deviations, at least 1.
    """
    s.verified = 1
    s.kappa = kappa
    s.sigma *= kappa
    for i in range(N_REF):
        for j in range(N_REF):
            s.J0[i, j] /= kappa * kappa
    for i in range(TABLE):
        for j in range(TABLE):
            s.unit_cov[i, j] *= kappa * kappa
