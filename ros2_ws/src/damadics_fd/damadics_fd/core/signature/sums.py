# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Exponentially weighted sums over moving blocks, one set for each memory, and fits to them.

The error of the reference is common to all hypotheses, so it is eliminated once (Schur
complement) before the columns that a hypothesis adds are fitted. The result equals the
restricted least squares of each hypothesis term by term.
"""

from damadics_fd.core.jit import jit
from damadics_fd.core.linalg import cholesky, forward, inverse
from damadics_fd.core.record import Ints
from damadics_fd.core.signature.state import N_COL, N_REF, STRIBECK, TABLE, State, Sums


@jit
def clear_sums(s: Sums, m: int) -> None:
    """
    Empty one accumulator.

    :param s: state record.
    :param m: index of the set.
    """
    s.S[m][:, :] = 0.0
    s.q[m][:] = 0.0
    s.rr[m] = 0.0
    s.ne[m] = 0.0
    s.vb[m] = 0.0


@jit
def copy_sums(s: Sums, to: int, m: int) -> None:
    """
    Copy the sums of one accumulator to another.

    :param s: state record.
    :param to: index of the set to overwrite.
    :param m: index of the set to copy.
    """
    s.S[to][:, :] = s.S[m]
    s.q[to][:] = s.q[m]
    s.rr[to] = s.rr[m]
    s.ne[to] = s.ne[m]
    s.vb[to] = s.vb[m]


@jit
def accumulate(s: State, m: int, forget: float, r: float) -> None:
    """
    Add the block under evaluation to one accumulator.

    :param s: state record.
    :param m: index of the set.
    :param forget: l = 1 - 1/N; 1 to remember everything.
    :param r: what the columns have to explain.
    """
    S = s.S[m]
    q = s.q[m]
    ph = s.block.ph
    w = s.block.w
    for i in range(N_COL):
        a = w * ph[i]
        for j in range(N_COL):
            S[i, j] = forget * S[i, j] + a * ph[j]
        q[i] = forget * q[i] + a * r
    s.rr[m] = forget * s.rr[m] + w * r * r
    s.ne[m] = forget * s.ne[m] + w
    s.vb[m] = forget * s.vb[m] + w * abs(s.block.v)


@jit
def residual(s: State) -> float:
    """
    Return what the reference does not explain of the force of the block.

    :param s: state record.
    :return: r = u - phi' theta0.
    """
    r: float = s.block.u
    for i in range(N_REF):
        r -= s.block.ph[i] * s.theta[i]
    return r


@jit
def growth_time(s: State) -> float:
    """
    Return the time that growing changes are counted in.

    :param s: state record.
    :return: [10 s] since the alarm, at most 3.
    """
    since = (s.t - s.alarm_t) * 1e-10
    return float(max(0.0, min(3.0, since)))


@jit
def precision(s: State, m: int, eps: float) -> float:
    """
    Return 1 / variance of a block of one set.

    :param s: state record.
    :param m: index of the set.
    :param eps: model error as a share of the signal.
    :return: [1].
    """
    sigma2 = s.sigma * s.sigma
    iv: float = 1.0 / (sigma2 * max(1.0, eps * eps * s.rr[m] / (sigma2 * s.ne[m])))
    return iv


@jit
def eliminate_reference(s: State, m: int, iv: float) -> float:
    """
    Eliminate the error of the reference from one set.

    :param s: state record; Gm and gv receive information matrix and vector of the columns
        that remain (unit: 1 / variance of the change).
    :param m: index of the set.
    :param iv: 1 / variance of a block.
    :return: J_0, the misfit without any change; negative if the sums are not usable.
    """
    S = s.S[m]
    q = s.q[m]
    L, Y, y0 = s.work.L[0], s.work.Y[0], s.work.y0
    n = len(y0)
    for i in range(n):
        for j in range(i + 1):
            L[i, j] = iv * S[i, j] + s.J0[i, j]
        for j in range(N_COL):
            Y[i, j] = iv * S[i, j]
        y0[i] = iv * q[i]
    if not cholesky(L, L, n):
        return -1.0
    forward(L, Y, n, len(q))
    for i in range(n):
        a = y0[i]
        for k in range(i):
            a -= L[i, k] * y0[k]
        y0[i] = a / L[i, i]
    J_0: float = iv * s.rr[m]
    for i in range(N_REF):
        J_0 -= y0[i] * y0[i]
    for i in range(N_COL):
        if TABLE <= i < STRIBECK:
            continue
        g = iv * q[i]
        for k in range(N_REF):
            g -= Y[k, i] * y0[k]
        s.work.gv[i] = g
        a = iv * S[i, i]
        for k in range(N_REF):
            a -= Y[k, i] * Y[k, i]
        s.work.Gm[0, i, i] = max(a, 0.0)
    return max(J_0, 0.0)


@jit
def cross_information(s: State, m: int, iv: float, i: int, j: int) -> float:
    """
    Return one off-diagonal entry of the information matrix after `eliminate_reference`.

    :param s: state record.
    :param m: index of the set.
    :param iv: 1 / variance of a block.
    :param i: column.
    :param j: column.
    :return: the entry.
    """
    a: float = iv * s.S[m][i, j]
    for k in range(N_REF):
        a -= s.work.Y[0, k, i] * s.work.Y[0, k, j]
    return a


@jit
def solve_group(
    s: State,
    m: int,
    iv: float,
    columns: Ints,
    count: int,
    prior: tuple[float, float, float, float],
) -> float:
    """
    Fit the columns of one hypothesis.

    :param s: state record; the changes d and their covariance H are written.
    :param m: index of the set.
    :param iv: 1 / variance of a block.
    :param columns: of the regressor; the first `count` of them are used.
    :param count: number of columns.
    :param prior: standard deviation of each change.
    :return: misfit that the hypothesis explains; negative if the sums are not usable.
    """
    H, d = s.work.H[0], s.work.d
    for i in range(count):
        H[i, i] = s.work.Gm[0, columns[i], columns[i]] + 1.0 / (prior[i] * prior[i])
        for j in range(i):
            H[i, j] = cross_information(s, m, iv, columns[i], columns[j])
        d[i] = 0.0
    if not inverse(H, s.work.W[0], count):
        return -1.0
    explained = 0.0
    for i in range(count):
        for j in range(count):
            d[i] += H[i, j] * s.work.gv[columns[j]]
        explained += d[i] * s.work.gv[columns[i]]
    return max(explained, 0.0)
