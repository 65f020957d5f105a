# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Reduced stem model driven by 1 Hz samples: massless stem, Euler sub-steps of 5 ms.

Chamber pressure and air mass are two states, integrated separately as in DABLib: p V / (m_a R T)
is not conserved through the play there, and a model with one state would drift away from it.
"""

import math

from damadics_fd.core.jit import jit
from damadics_fd.core.record import Record
from damadics_fd.core.scada.laws.actuator import P_RANGE
from damadics_fd.core.valve.parameters import Valve
from damadics_fd.core.valve.plug import recovery
from damadics_fd.core.valve.pneumatics import (
    AIR_TEMPERATURE,
    ATMOSPHERE,
    GAS_CONSTANT,
    air_flow,
    feedback_angle,
    transducer,
)

SUB_STEPS = 7  # Euler steps per controller tick, at least; four mistake a fast stem
MOST_SUB_STEPS = 40
STEADY = 0.75  # of the stem's time constant, the longest step
PRESSURE = 4.0e5  # Pa absolute, about the middle of what a chamber has
GAS = GAS_CONSTANT * AIR_TEMPERATURE
MINIMUM_SUPPLY = 1.2e5


class StemState(Record):
    """Remember the stem of the nominal actuator."""

    tick: int  # next controller tick, counted from time 0
    y1: float  # input filter
    y2: float
    p: float  # chamber pressure, Pa absolute
    m_a: float  # air mass, kg
    x: float  # stem before the play, m
    X: float  # stem, m
    feedback: float  # stem after the play of the feedback (f15), m


STEM = StemState.dtype()

STEM_FAULTS = (1, 2, 3, 4, 8, 9, 10, 11, 12, 13, 15, 16)


class Faults(Record):
    """Strength of each fault of the benchmark."""

    f1: float
    f2: float
    f3: float
    f4: float
    f5: float
    f6: float
    f7: float
    f8: float
    f9: float
    f10: float
    f11: float
    f12: float
    f13: float
    f14: float
    f15: float
    f16: float
    f17: float
    f18: float
    f19: float


FAULTS = Faults.dtype()


@jit
def start_stem(m: StemState, act: Valve, t: float) -> None:
    """Set the rest state at time t, s: chamber empty, so that the spring holds the stem."""
    m.tick = math.ceil(t / act.positioner_period)
    m.y1 = 0.0
    m.y2 = 0.0
    m.p = ATMOSPHERE
    m.m_a = ATMOSPHERE * act.chamber_volume / GAS
    m.x = 0.0 if act.air_sign > 0.0 else act.stroke
    m.X = m.x
    m.feedback = m.x


@jit
def air_over_rest(m: StemState, act: Valve) -> float:
    """Return how much air the chamber holds over what pressure and volume say; 1 at the start."""
    volume = act.open_volume + act.signed_area * m.X
    if not m.p * volume > 0.0:
        return 1.0
    value: float = m.m_a * GAS / (m.p * volume)
    return value


@jit
def copy_stem(source: StemState, target: StemState) -> None:
    """Copy one stem state into another."""
    target.tick = source.tick
    target.y1 = source.y1
    target.y2 = source.y2
    target.p = source.p
    target.m_a = source.m_a
    target.x = source.x
    target.X = source.X
    target.feedback = source.feedback


@jit
def steps_per_tick(act: Valve) -> int:
    """Return how many Euler steps the stem takes per tick of the positioner, stiff as it is."""
    air = act.area * act.area * PRESSURE / act.chamber_volume if act.chamber_volume > 0.0 else 0.0
    steps = act.positioner_period * (act.stiffness + air) / (STEADY * act.viscous)
    return int(min(max(math.ceil(min(steps, MOST_SUB_STEPS)), SUB_STEPS), MOST_SUB_STEPS))


@jit
def advance_stem(
    m: StemState,
    act: Valve,
    fault: Faults,
    t0: float,
    t1: float,
    cv0: float,
    cv1: float,
    dp0: float,
    dp1: float,
    slope0: float,
    slope1: float,
) -> float:
    """
    Advance the stem from t0 to t1 and return its measured position, 0..1.

    The valve's pressure drop is a cubic Hermite between the samples, CV a straight line; hand
    over cv1 = cv0 for a CV that is held.

    :param m: record of `STEM`, changed in place.
    :param act: the valve.
    :param fault: record of `FAULTS` (table 2.1); zeros for the nominal model.
    :param t0: time of the previous sample, s.
    :param t1: time of this sample, s.
    :param cv0: CV at t0; cv1 at t1.
    :param dp0: pressure drop at t0, share of 4 MPa; dp1 at t1.
    :param slope0: its slope at t0, 1/s; slope1 at t1.
    :return: X', the position a sensor shows.
    """
    dt = t1 - t0
    lag = math.exp(-act.positioner_period / act.positioner_lag)
    sub_steps = steps_per_tick(act)
    h = act.positioner_period / sub_steps
    mobility = h / act.viscous
    stroke = act.stroke
    per_stroke = 1.0 / stroke
    area = act.signed_area * (1.0 - fault.f10)
    weight = act.mass * act.gravity
    origin = act.spring_origin * stroke
    gain = act.air_sign * act.positioner_gain
    spring = act.stiffness * (1.0 - fault.f11)
    supply = act.supply_pressure * (1.0 - fault.f16)
    if supply < MINIMUM_SUPPLY:
        supply = 0.0
    top = stroke * (1.0 - fault.f1) * (1.0 - 0.2 * fault.f2) * (1.0 + 0.1 * fault.f3)
    offset = 0.2 * fault.f2 - 0.1 * fault.f3
    play0 = min(max(stroke * (act.stem_play + fault.f4), 0.0), stroke)
    leak = 0.2e-6 * (fault.f9 + fault.f10)
    sensor = 1.0 + 1.25 * fault.f13
    half_feedback = 0.5 * fault.f15 * stroke
    y1 = m.y1
    y2 = m.y2
    p = m.p
    m_a = m.m_a
    x = m.x
    X = m.X
    feedback = m.feedback
    tick = m.tick
    while tick * act.positioner_period < t1:
        a = (tick * act.positioner_period - t0 + 0.5 * act.positioner_period) / dt
        u = min(max(cv0 + (cv1 - cv0) * a, 0.0), 1.024)
        b = 1.0 - a
        drop = (
            (1.0 + 2.0 * a) * b * b * dp0
            + a * b * b * dt * slope0
            + a * a * (3.0 - 2.0 * a) * dp1
            - a * a * b * dt * slope1
        )
        thrust = P_RANGE * drop * act.signed_plug_area
        # positioner: P controller on the filtered command, E/P transducer
        shown = X
        if fault.f13 != 0.0:
            shown = min(max(X * sensor, -0.25 * stroke), 1.25 * stroke)
        feedback = min(max(feedback, shown - half_feedback), shown + half_feedback)
        pv = feedback_angle(min(max(feedback, -0.01), 0.05), stroke)
        e = min(max(transducer(y2, pv, gain) * (1.0 - fault.f12), -1.0), 1.0)
        for _ in range(sub_steps):
            gauge = p - ATMOSPHERE
            md = air_flow(e, supply, gauge, act.air_flow)
            if leak > 0.0:
                md -= leak * math.copysign(math.sqrt(abs(gauge)), gauge)
            plug = thrust / recovery(act.plug_table, X * per_stroke + offset)
            force = weight + area * gauge - plug - spring * (X + origin)
            if (force <= 0.0 and X <= 0.0) or (force > 0.0 and top <= X):
                force = 0.0
            step = mobility * force
            x = min(max(x + step, -0.05 * stroke), 1.25 * stroke)
            before = X
            half = 0.5 * play0
            if fault.f8 != 0.0:
                half *= 1.0 + 0.5 * fault.f8 * (1.0 - X * per_stroke)
            if step > 0.0:
                X = max(X, x - half)
            elif step < 0.0:
                X = min(X, x + half)
            X = min(max(X, 0.0), top)
            # the middle volume over the step: else p V / m_a drifts with every step of the stem
            volume = act.open_volume + 0.5 * area * (before + X)
            half_swept = 0.5 * area * min(max(step, -0.02 * h), 0.02 * h)
            inflow = h * md
            p *= (m_a + inflow) * (volume - half_swept) / (m_a * (volume + half_swept))
            p = min(max(p, 0.0), 7.0e5)
            m_a = min(max(m_a + inflow, 1e-9), 0.1)
        y1_next = u - (u - y1) * lag
        mean = 0.5 * (y1 + y1_next)
        y2 = mean - (mean - y2) * lag
        y1 = y1_next
        tick += 1
    m.tick = tick
    m.y1 = y1
    m.y2 = y2
    m.p = p
    m.m_a = m_a
    m.x = x
    m.X = X
    m.feedback = feedback
    shown_x: float = min(max(X / stroke * sensor, 0.0), 1.0)
    return shown_x
