# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Mean squared errors of X' and F' over a window under one fault of a given strength."""

import math

import numpy as np

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.laws.actuator import F_RANGE, P_RANGE, T_RANGE, valve_flow
from damadics_fd.core.scada.laws.stem_law import shrink
from damadics_fd.core.scada.model import (
    Faults,
    StemState,
    advance_stem,
    copy_stem,
)
from damadics_fd.core.valve.parameters import Valve

SETTLING = 60  # samples after which a stem that starts late has arrived


@jit
def stem_error(
    window: np.ndarray, act: Valve, fault: Faults, stem: StemState, late: bool, bias: float
) -> float:
    """
    Return the mean squared error of X' under a fault that is present in the whole window.

    :param bias: mean error that may be the model's own, share of stroke.
    """
    copy_stem(window[0].stem, stem)
    first = 0
    if late:  # the fault has been there for long: start from the position it has led to
        stem.X = window[0].x / (1.0 + 1.25 * fault.f13) * act.stroke
        stem.x += stem.X - window[0].stem.X
        stem.feedback = stem.X
        first = min(SETTLING, window.shape[0] - 1)  # the pressure finds its place, too
    total = 0.0
    squares = 0.0
    for i in range(window.shape[0]):
        e = window[i]
        x = advance_stem(
            stem,
            act,
            fault,
            e.t0,
            e.t,
            e.cv0,
            e.cv,
            e.dp0,
            e.dp,
            e.slope0,
            e.slope,
        )
        if i >= first:
            error = e.x - x - e.correction
            total += error
            squares += error * error
    n = window.shape[0] - first
    mean = total / n
    value: float = squares / n - mean * mean + shrink(mean, bias) ** 2
    return value


@jit
def flow_error(window: np.ndarray, act: Valve, fault: Faults, g0: float, g1: float) -> float:
    """Return the mean squared error of F' in units of its sigma; NaN where F' is not measured."""
    offset = 0.2 * fault.f2 - 0.1 * fault.f3
    scale = (1.0 - 0.2 * fault.f2) * (1.0 + 0.1 * fault.f3)
    gain = (1.0 - 0.05 * fault.f5) * (1.0 - fault.f19)
    sensor = 1.0 + 1.25 * fault.f13
    total = 0.0
    n = 0
    for i in range(window.shape[0]):
        e = window[i]
        if math.isnan(e.flow) or math.isnan(e.t1):
            continue
        flow = valve_flow(
            act,
            e.x / sensor,
            e.p1 * P_RANGE,
            e.p2 * P_RANGE,
            e.t1 * T_RANGE,
            offset,
            scale,
            0.1 * fault.f6,
            fault.f18,
        )
        f = min(1.0, gain * (g0 + g1 * flow / F_RANGE))
        total += ((e.flow - f) / e.sq) ** 2
        n += 1
    return total / n if n else math.nan
