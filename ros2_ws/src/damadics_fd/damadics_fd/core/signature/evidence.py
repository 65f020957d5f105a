# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Evidence for each hypothesis from exponentially weighted sums over moving blocks.

Every hypothesis adds one or two columns to the reference model, whose error is eliminated first
(`sums`); then each hypothesis is a division.
"""

import math

import numpy as np

from damadics_fd.core.jit import jit
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.state import (
    FRICTION,
    N_HYP,
    N_REF,
    ONE,
    PRELOAD,
    SET_ALARM,
    SIGN,
    SIGN_T,
    SMALL_FRICTION,
    SPRING,
    X1,
    X1_T,
    Evidence,
    State,
    V,
)
from damadics_fd.core.signature.sums import (
    clear_sums,
    eliminate_reference,
    growth_time,
    precision,
    solve_group,
)

# column of hypotheses 3 to 7: 1, position gain, chamber pressure, P1 - P2, position offset
COLUMN = np.array([-1, -1, -1, ONE, N_REF + 3, N_REF, N_REF + 1, N_REF + 2])
FRICTION_COLUMNS = np.array([SIGN, V, SIGN_T])
SPRING_COLUMNS = np.array([X1, X1_T])
MIN_EVIDENCE = 4.0  # blocks
CONFLICT = 3.0  # log odds of the moving stem against friction that outweigh the stick range
D_VERIFY = 12.0  # largest D expected of a right model
SMALL = 2e-3  # [1] tolerance of the exclusions


@jit
def combine(
    s: State, count: int, first: float, a: float, b: float, scale: float
) -> tuple[float, float]:
    """
    Return the change first d0 + a d1 + b d2 of the last group in units of `scale`.

    :param s: state record after `solve_group`.
    :param count: number of columns; a fourth is not counted.
    :param first: weight of the first column.
    :param a: weight of the second column.
    :param b: weight of the third column.
    :param scale: unit.
    :return: value and standard deviation.
    """
    weight = (first, a, b, 0.0)
    value, variance = 0.0, 0.0
    for i in range(count):
        value += weight[i] * s.work.d[i]
        for j in range(count):
            variance += weight[i] * weight[j] * s.work.H[0, i, j]
    return value / scale, math.sqrt(max(variance, 0.0)) / scale


@jit
def share_friction(s: State, m: int, count: int, third: float) -> float:
    """
    Restate the friction just solved for as shares.

    :param s: state record after `solve_group`; value, sd, dry and apart of the set are written.
    :param m: index of the set.
    :param count: number of columns.
    :param third: weight of the third column: the time of what grows, 0 of what does not count.
    :return: friction at the mean speed, the unit of the value [1].
    """
    v_mean = s.vb[m] / s.ne[m]
    scale: float = max(s.theta[SIGN] + s.theta[V] * v_mean, SMALL_FRICTION)
    s.value[m][FRICTION], s.sd[m][FRICTION] = combine(s, count, 1.0, v_mean, third, scale)
    dry = max(s.theta[SIGN], SMALL_FRICTION)
    s.dry[m], s.dry_sd[m] = combine(s, count, 1.0, 0.0, third, dry)
    gap = 1.0 / dry - 1.0 / scale
    s.apart[m], s.apart_sd[m] = combine(s, count, gap, -v_mean / scale, gap * third, 1.0)
    return scale


@jit
def share_spring(s: State, m: int, count: int, second: float) -> None:
    """
    Restate the stiffness just solved for as a share, as `share_friction` does.

    :param s: state record after `solve_group`; value and sd of the set are written.
    :param m: index of the set.
    :param count: number of columns.
    :param second: weight of the second one.
    """
    s.value[m][SPRING], s.sd[m][SPRING] = combine(s, count, 1.0, second, 0.0, s.theta[X1])


@jit
def evaluate(s: State, c: SignatureSettings, m: int, eps: float, b_r: float, b_p: float) -> float:
    """
    Weigh the hypotheses on one set.

    :param s: state record; logp, value, sd and D of the set are written.
    :param c: settings record.
    :param m: index of the set.
    :param eps: model error as a share of the signal.
    :param b_r: log evidence of the stick range for friction.
    :param b_p: log evidence of passivity for the elastic family.
    :return: D.
    """
    ne = s.ne[m]
    s.D[m] = 0.0
    if ne < 1.0 or (ne < MIN_EVIDENCE and b_r <= 0.0 and b_p <= 0.0):
        return 0.0
    iv = precision(s, m, eps)
    J_0 = eliminate_reference(s, m, iv)
    if J_0 < 0.0:
        return 0.0
    logp, value, std = s.logp[m], s.value[m], s.sd[m]
    logp[0] = J_0  # first the misfits J_h
    now = growth_time(s)
    count = 3 if m == SET_ALARM else 2
    explained = solve_group(
        s, m, iv, FRICTION_COLUMNS, count, (c.change_std[1], c.change_std[0], c.growth_std[0], 1.0)
    )
    logp[FRICTION] = J_0 - explained
    scale = share_friction(s, m, count, now)
    if value[FRICTION] < -1.3 - SMALL / scale:
        logp[FRICTION] = J_0  # friction cannot become negative
    # spring
    explained = solve_group(
        s, m, iv, SPRING_COLUMNS, count - 1, (c.change_std[2], c.growth_std[1], 1.0, 1.0)
    )
    logp[SPRING] = J_0 - explained
    share_spring(s, m, count - 1, now)
    if value[SPRING] < -1.05:
        logp[SPRING] = J_0
    for h in range(PRELOAD, N_HYP):
        k = COLUMN[h]
        info = s.work.Gm[0, k, k] + 1.0 / (c.change_std[h] * c.change_std[h])
        value[h] = s.work.gv[k] / info
        std[h] = 1.0 / math.sqrt(info)
        logp[h] = J_0 - s.work.gv[k] * value[h]
    J_min = logp[0]
    for h in range(1, N_HYP):
        J_min = min(J_min, logp[h])
    sc = max(1.0, J_min / max(ne - 2.0, 1.0))
    # misfits to log posteriors, normalised over h >= 1
    for h in range(1, N_HYP):
        logp[h] = math.log(c.prior[h]) - logp[h] / (2.0 * sc)
    logp[FRICTION] -= 0.5 * math.log(ne)
    elastic = logp[SPRING]
    for h in range(PRELOAD, N_HYP):
        elastic = max(elastic, logp[h])
    if elastic - logp[FRICTION] > CONFLICT:
        b_r = 0.0  # a growing spring change widens the stick range too
    D: float = (J_0 - J_min) / sc + 2.0 * b_r
    s.D[m] = D
    logp[FRICTION] += b_r
    for h in range(SPRING, N_HYP):
        logp[h] += b_p
    top = max(logp[FRICTION], elastic + b_p)
    total = 0.0
    for h in range(1, N_HYP):
        total += math.exp(logp[h] - top)
    for h in range(1, N_HYP):
        logp[h] -= top + math.log(total)
    return D


@jit
def clear_set(s: State, m: int) -> None:
    """
    Empty one set, sums and evidence.

    :param s: state record.
    :param m: index of the set.
    """
    clear_sums(s, m)
    s.D[m] = 0.0
    s.due[m] = 0
    s.over[m] = 0


@jit
def restart_sets(s: State) -> None:
    """
    Empty the sets of the watch.

    :param s: state record.
    """
    for m in range(SET_ALARM):
        clear_set(s, m)
        s.d_max[m] = 0.0


@jit
def look(s: State, c: SignatureSettings, m: int) -> bool:
    """
    Look for a change on one memory, before any alarm.

    A set is evaluated as often as its memory can change, and at every block once D is not
    small. Where the whole misfit is below a limit, D is below it too and need not be computed.

    :param s: state record.
    :param c: settings record.
    :param m: index of the set.
    :return: True where the set was evaluated.
    """
    s.due[m] += 1
    if s.rr[m] < D_VERIFY * s.sigma * s.sigma:
        s.D[m] = 0.0
        s.over[m] = 0
        return False
    if s.D[m] < 0.5 * c.d_alarm and s.due[m] < c.memory[m] / 10.0:
        return False
    s.due[m] = 0
    D = evaluate(s, c, m, c.model_error, 0.0, 0.0)
    s.d_max[m] = max(s.d_max[m], D)
    s.over[m] = s.over[m] + 1 if c.d_alarm < D else 0
    return True


@jit
def due(s: Evidence, m: int, stride: int, enough: bool) -> bool:
    """
    Tell whether it is a set's turn to be evaluated.

    :param s: state record; the block is counted.
    :param m: index of the set.
    :param stride: blocks between two turns.
    :param enough: whether it holds enough to be evaluated.
    :return: True if so.
    """
    s.due[m] += 1
    if s.due[m] < stride or not enough:
        return False
    s.due[m] = 0
    return True
