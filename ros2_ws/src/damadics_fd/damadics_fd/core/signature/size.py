# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sizes as a person reads them: shares of the valve as well as it is known, N, Pa."""

import math
from typing import Any

from damadics_fd.core.jit import jit
from damadics_fd.core.signature.state import (
    DP_OFFSET,
    FRICTION,
    POSITION_GAIN,
    PRELOAD,
    PRESSURE_GAIN,
    SET_SLOW,
    SIGN,
    SPRING,
    X1,
    V,
)

UNKNOWN = 0.2  # relative deviation of the unit from which no size is stated
APART = 4.0  # deviations by which dry and viscous friction must have changed differently
SMALL_FRICTION = 1e-3  # [1] least friction that a share is taken of


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
def physical_value(s: Any, c: Any, m: int, h: int) -> tuple[float, float]:
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
        F = max(s.theta[SIGN] + s.theta[V] * v, SMALL_FRICTION)
        F_unit = max(s.unit[SIGN] + s.unit[V] * v, SMALL_FRICTION)
        cov = s.unit_cov
        variance = cov[SIGN, SIGN] + 2.0 * v * cov[V, SIGN] + v * v * cov[V, V]
        late = v * s.unit[X1] * c.ps_lag_std  # friction that a lag not known would show
        variance += late * late
        if variance > (UNKNOWN * F_unit) ** 2:
            return math.nan, math.nan
        # the dry part leads where its share is the larger one
        beyond = s.apart[m] if value >= 0.0 else -s.apart[m]
        told = beyond > APART * s.apart_sd[m] and m == SET_SLOW
        F_dry = max(s.unit[SIGN], SMALL_FRICTION)
        leads = abs(s.dry[m]) * F_dry > 0.5 * abs(value) * F_unit
        if told and leads and cov[SIGN, SIGN] < (UNKNOWN * F_dry) ** 2:
            ratio = max(s.theta[SIGN], SMALL_FRICTION) / F_dry
            return in_units(s.dry[m], s.dry_sd[m], ratio, cov[SIGN, SIGN] / (F_dry * F_dry))
        std = math.sqrt(std * std + s.apart_sd[m] * s.apart_sd[m])
        return in_units(value, std, F / F_unit, variance / (F_unit * F_unit))
    if h == SPRING:
        K = s.unit[X1]
        return in_units(value, std, s.theta[X1] / K, s.unit_cov[X1, X1] / (K * K))
    if h == PRELOAD:
        force = c.force_scale if c.diaphragm_area > 0.0 else -c.force_scale  # the spring closes
        return value * force, std * c.force_scale
    if h in (POSITION_GAIN, PRESSURE_GAIN):
        gain = 1.0 / max(1.0 - value, 1e-3)  # the column uses the measured, wrong value
        return value * gain, std * gain * gain
    if h == DP_OFFSET:
        return -1e6 * value, 1e6 * std
    return value, std
