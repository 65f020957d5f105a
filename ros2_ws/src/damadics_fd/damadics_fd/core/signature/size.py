# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sizes as a person reads them: shares of the valve as well as it is known, N, Pa."""

import math

import numpy as np

from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats
from damadics_fd.core.signature.evidence import share_friction, share_spring
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.sliding import STICKY_DOUBT
from damadics_fd.core.signature.state import (
    DP_OFFSET,
    FRICTION,
    ONE,
    POSITION_GAIN,
    PRELOAD,
    PRESSURE_GAIN,
    SET_SLOW,
    SET_UNIT,
    SIGN,
    SMALL_FRICTION,
    SPRING,
    STRIBECK,
    X1,
    State,
    V,
)
from damadics_fd.core.signature.sums import eliminate_reference, precision, solve_group

UNKNOWN = 0.2  # relative deviation of the unit from which no size is stated
LARGE = 1.0  # friction change that is stated only if it is known as well itself
# deviations, and share of the change, by which dry and viscous friction must change differently
APART, APART_SHARE = 4.0, 0.06
# what a size is in error because no valve rubs and springs as the model says, as a share of it
MODEL_FRICTION, MODEL_SPRING = 0.08, 0.02
PLAY = 0.00125  # [1] half the play of a position sensor, which passes for friction
STICK_SLIP = 0.15  # the same of friction, of a stem that only sticks and slips
FRICTION_SIZE = np.array([SIGN, V, STRIBECK, ONE])
SPRING_SIZE = np.array([X1, ONE])
ONE_WAY = 0.3  # of a friction change: how much more of it one way than on the mean
SHOWN, MATTERS = 25.0, 0.2  # evidence, and share of the change, from which it is taken in
ASIDE = 0.02  # [1] offset that a spring's change may leave: friction that is larger one way
JOINT_COLUMNS = np.array([X1, ONE, SIGN, V])
JOINT_EVIDENCE = 60.0  # blocks


@jit
def at_most(value: float, std: float, share: float) -> float:
    """
    Return how large a change is at most, by what its data leave open.

    The model's own error is no reason to call a change larger than it was found.

    :param value: change.
    :param std: its standard deviation.
    :param share: MODEL_FRICTION or MODEL_SPRING, which `std` holds.
    :return: two standard deviations of the data above its size.
    """
    model = share * value
    return abs(value) + 2.0 * math.sqrt(max(std * std - model * model, 0.0))


@jit
def in_units(value: float, std: float, ratio: float, variance: float) -> tuple[float, float]:
    """
    Restate a share of the reference as a share of the unit of sizes.

    :param value: change / reference.
    :param std: its standard deviation.
    :param ratio: reference / unit.
    :param variance: of the unit, relative.
    :return: value and standard deviation; the error of the unit grows with the change.
    """
    value *= ratio
    std *= ratio
    return value, math.sqrt(std * std + value * value * variance)


@jit
def friction_at(theta: Floats, v: float) -> float:
    """
    Return the friction of a reference.

    :param theta: its parameters, or the unit of sizes.
    :param v: [1/s] speed.
    :return: dry and viscous friction [1], not less than is worth a share.
    """
    F: float = max(theta[SIGN] + theta[V] * v, SMALL_FRICTION)
    return F


@jit
def friction_error(s: State, m: int) -> float:
    """
    Return how wrong a friction change may be because no stem rubs as the model says.

    A stem that sticks and slips bears anything between dry and static friction.

    :param s: state record.
    :param m: index of the set with the change.
    :return: standard deviation as a share of the change.
    """
    jumps = max(jumping(s, m), jumping(s, SET_UNIT))
    return math.sqrt(MODEL_FRICTION * MODEL_FRICTION + jumps * jumps * STICK_SLIP * STICK_SLIP)


@jit
def jumping(s: State, m: int) -> float:
    """
    Return the share of the blocks of a set in which the stem sticks and slips.

    :param s: state record.
    :param m: index of the set.
    :return: 0 to 1.
    """
    weight = s.S[m][STRIBECK, STRIBECK]  # such a block has a 1 there, and little weight
    blocks = weight * (1.0 + STICKY_DOUBT)
    share: float = blocks / max(blocks + s.ne[m] - weight, 1.0)
    return share


@jit
def physical_value(s: State, c: SignatureSettings, m: int, h: int) -> tuple[float, float]:
    """
    Convert a change to what a person reads.

    :param s: state record.
    :param c: settings record.
    :param m: index of the set.
    :param h: hypothesis.
    :return: value and standard deviation, NaN where the unit is not known well enough. Friction
        and spring as shares, preload in N, gains as the sensor's gain error, P1 - P2 offset in
        Pa, position offset as share of the stroke.
    """
    value, std = s.value[m][h], s.sd[m][h]
    if h == FRICTION:
        v = s.vb[m] / max(s.ne[m], 1.0)
        F = friction_at(s.theta, v)
        F_unit = max(friction_at(s.unit, v) - c.hysteresis, SMALL_FRICTION)
        cov = s.unit_cov
        other = c.hysteresis_std * c.hysteresis_std + PLAY * PLAY
        variance = cov[SIGN, SIGN] + 2.0 * v * cov[V, SIGN] + v * v * cov[V, V]
        late = v * s.unit[X1] * c.ps_lag_std  # friction that a lag not known would show
        variance += late * late + other
        error = friction_error(s, m)
        if variance + (error * F_unit) ** 2 > (UNKNOWN * F_unit) ** 2:
            return math.nan, math.nan
        # the dry part leads where its share is the larger one
        beyond = s.apart[m] if value >= 0.0 else -s.apart[m]
        least = max(APART * s.apart_sd[m], APART_SHARE * abs(value))
        told = beyond > least and m == SET_SLOW
        F_dry = max(s.unit[SIGN] - c.hysteresis, SMALL_FRICTION)
        dry_variance = cov[SIGN, SIGN] + other
        leads = abs(s.dry[m]) * F_dry > 0.5 * abs(value) * F_unit
        if told and leads and dry_variance < (UNKNOWN * F_dry) ** 2:
            ratio = max(s.theta[SIGN], SMALL_FRICTION) / F_dry
            known = dry_variance / (F_dry * F_dry) + error * error
            return in_units(s.dry[m], s.dry_sd[m], ratio, known)
        std = math.sqrt(std * std + s.apart_sd[m] * s.apart_sd[m])
        known = variance / (F_unit * F_unit) + error * error
        value, std = in_units(value, std, F / F_unit, known)
        if abs(value) > LARGE and std > UNKNOWN * abs(value):
            return math.nan, math.nan
        return value, std
    if h == SPRING:
        K = s.unit[X1]
        known = s.unit_cov[X1, X1] / (K * K) + MODEL_SPRING * MODEL_SPRING
        return in_units(value, std, s.theta[X1] / K, known)
    if h == PRELOAD:
        force = c.force_scale if c.diaphragm_area > 0.0 else -c.force_scale  # the spring closes
        return value * force, std * c.force_scale
    if h in (POSITION_GAIN, PRESSURE_GAIN):
        gain = 1.0 / max(1.0 - value, 1e-3)  # the column uses the measured, wrong value
        return value * gain, std * gain * gain
    if h == DP_OFFSET:
        return -1e6 * value, 1e6 * std
    return value, std


@jit
def size_beside_offset(s: State, c: SignatureSettings, m: int, eps: float) -> None:
    """
    Size friction and spring anew, with what else a valve's friction may do beside them.

    Friction that has grown has grown at low speed as well, where it would pass for more dry and
    less viscous friction. A valve that rubs more one way pushes as well, and passes for one with
    more preload, which a spring's change would have to hold; beside friction such an offset is
    taken in if the record shows one. Evidence and posteriors stay those of the plain change.

    :param s: state record after `evaluate` of the set; friction and spring are written.
    :param c: settings record.
    :param m: index of the set.
    :param eps: model error as a share of the signal, that of `evaluate`.
    """
    iv = precision(s, m, eps)
    change = abs(s.value[m][FRICTION]) * friction_at(s.theta, s.vb[m] / s.ne[m])
    offset = max(ONE_WAY * change, SMALL_FRICTION)
    prior = (c.change_std[1], c.change_std[0], max(change, SMALL_FRICTION), offset)
    aside = solve_group(s, m, iv, FRICTION_SIZE, 4, prior)
    one_way = abs(s.work.d[3]) > MATTERS * change
    alike = solve_group(s, m, iv, FRICTION_SIZE, 3, prior)
    if alike >= 0.0:
        if one_way and aside - alike > SHOWN:
            solve_group(s, m, iv, FRICTION_SIZE, 4, prior)
            share_friction(s, m, 4, 0.0)
        else:
            share_friction(s, m, 3, 0.0)
    prior = (c.change_std[2], ASIDE, 1.0, 1.0)
    if solve_group(s, m, iv, SPRING_SIZE, len(SPRING_SIZE), prior) >= 0.0:
        share_spring(s, m, len(SPRING_SIZE), 0.0)


@jit
def joint_change(s: State, c: SignatureSettings, m: int) -> bool:
    """
    Estimate spring, preload and friction together, for the trends.

    :param s: state record; now, now_std and now_t are written: dK/K0, preload in N, dF.
    :param c: settings record.
    :param m: index of the set.
    :return: False if the set is not usable yet.
    """
    ne = s.ne[m]
    if ne < JOINT_EVIDENCE:
        return False
    iv = 1.0 / (s.sigma * s.sigma)
    if eliminate_reference(s, m, iv) < 0.0:
        return False
    prior = (c.change_std[2], c.change_std[3], c.change_std[1], c.change_std[0])
    if solve_group(s, m, iv, JOINT_COLUMNS, len(s.work.d), prior) < 0.0:
        return False
    H, d = s.work.H[0], s.work.d
    v = s.vb[m] / ne
    scale = max(s.theta[SIGN] + s.theta[V] * v, SMALL_FRICTION)
    s.now[0] = d[0] / s.theta[X1]
    s.now[1] = d[1] * (c.force_scale if c.diaphragm_area > 0.0 else -c.force_scale)
    s.now[2] = (d[2] + d[3] * v) / scale
    s.now_std[0] = math.sqrt(H[0, 0]) / s.theta[X1]
    s.now_std[1] = math.sqrt(H[1, 1]) * c.force_scale
    s.now_std[2] = math.sqrt(H[2, 2] + 2.0 * v * H[2, 3] + v * v * H[3, 3]) / scale
    s.now_t = s.t
    return True
