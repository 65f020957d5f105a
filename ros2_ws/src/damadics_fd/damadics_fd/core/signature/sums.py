# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Exponentially weighted sums over moving blocks, one set for each memory."""

from damadics_fd.core.jit import jit
from damadics_fd.core.signature.state import N_COL, N_REF, State, Sums


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
