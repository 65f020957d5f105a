# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
One Euler step of the stem model: air, force and play, from numbers that stand in registers.

Chamber pressure and air mass are two states, integrated separately as in DABLib: p V / (m_a R T)
is not conserved through the play there, and a model with one state would drift away from it.
"""

import math
from typing import NamedTuple

from damadics_fd.core.jit import jit, layer
from damadics_fd.core.valve.parameters import Valve
from damadics_fd.core.valve.plug import recovery
from damadics_fd.core.valve.pneumatics import (
    ATMOSPHERE,
    air_flow,
    feedback_angle,
    transducer,
)


class Course(NamedTuple):
    """Hold what stays the same from step to step, with the fault in it."""

    h: float  # step, s
    mobility: float
    stroke: float
    per_stroke: float
    area: float
    weight: float
    origin: float
    spring: float
    supply: float
    top: float
    offset: float
    half_play: float
    wear: float
    leak: float
    sensor: float
    half_feedback: float
    response: float
    gain: float


class Moving(NamedTuple):
    """Hold a stem between two steps."""

    p: float  # as in `model.StemState`
    m_a: float
    x: float
    X: float
    km: float  # K_m of the plug where the stem is


@jit
def plug_at(k: Course, act: Valve, X: float) -> float:
    """Return K_m of the plug for the stem at X, m."""
    return recovery(act.plug_table, X * k.per_stroke + k.offset)


@jit
def fed_back(k: Course, X: float, feedback: float) -> float:
    """Return the stem that the positioner is shown, m, behind the play of the feedback."""
    shown = X
    if k.sensor != 1.0:
        shown = min(max(X * k.sensor, -0.25 * k.stroke), 1.25 * k.stroke)
    return min(max(feedback, shown - k.half_feedback), shown + k.half_feedback)


@jit
def opening(k: Course, y2: float, feedback: float) -> float:
    """Return the opening of the booster: P controller on the filtered command, transducer."""
    pv = feedback_angle(min(max(feedback, -0.01), 0.05), k.stroke)
    return min(max(transducer(y2, pv, k.gain) * k.response, -1.0), 1.0)


@layer
def euler(k: Course, act: Valve, e: float, thrust: float, m: Moving) -> Moving:
    """
    Take one step.

    :param k: what stays the same.
    :param act: the valve.
    :param e: opening of the booster.
    :param thrust: force of the medium on the plug times K_m, N.
    :param m: the stem before the step.
    :return: the stem after it.
    """
    p, X = m.p, m.X
    gauge = p - ATMOSPHERE
    md = air_flow(e, k.supply, gauge, act.air_flow)
    if k.leak > 0.0:
        md -= k.leak * math.copysign(math.sqrt(abs(gauge)), gauge)
    force = k.weight + k.area * gauge - thrust / m.km - k.spring * (X + k.origin)
    if (force <= 0.0 and X <= 0.0) or (force > 0.0 and k.top <= X):
        force = 0.0
    step = k.mobility * force
    x = min(max(m.x + step, -0.05 * k.stroke), 1.25 * k.stroke)
    half = k.half_play
    if k.wear != 0.0:
        half *= 1.0 + 0.5 * k.wear * (1.0 - X * k.per_stroke)
    if step > 0.0:
        X = max(X, x - half)
    elif step < 0.0:
        X = min(X, x + half)
    X = min(max(X, 0.0), k.top)
    # the middle volume over the step: else p V / m_a drifts with every step of the stem
    volume = act.open_volume + 0.5 * k.area * (m.X + X)
    half_swept = 0.5 * k.area * min(max(step, -0.02 * k.h), 0.02 * k.h)
    inflow = k.h * md
    p *= (m.m_a + inflow) * (volume - half_swept) / (m.m_a * (volume + half_swept))
    p = min(max(p, 0.0), 7.0e5)
    m_a = min(max(m.m_a + inflow, 1e-9), 0.1)
    km = m.km
    if X != m.X:
        km = plug_at(k, act, X)
    return Moving(p, m_a, x, X, km)
