# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Reduced stem model driven by 1 Hz samples: massless stem, Euler sub-steps of 5 ms."""

import math

from damadics_fd.core.jit import jit
from damadics_fd.core.record import Record
from damadics_fd.core.scada.euler import Course, Moving, euler, fed_back, opening, plug_at
from damadics_fd.core.scada.laws.actuator import P_RANGE
from damadics_fd.core.valve.parameters import Valve
from damadics_fd.core.valve.pneumatics import AIR_TEMPERATURE, ATMOSPHERE, GAS_CONSTANT

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
def course(act: Valve, fault: Faults) -> Course:
    """Return what stays the same from step to step for a valve with a fault."""
    h = act.positioner_period / steps_per_tick(act)
    stroke = act.stroke
    supply = act.supply_pressure * (1.0 - fault.f16)
    if supply < MINIMUM_SUPPLY:
        supply = 0.0
    play = min(max(stroke * (act.stem_play + fault.f4), 0.0), stroke)
    return Course(
        h,
        h / act.viscous,
        stroke,
        1.0 / stroke,
        act.signed_area * (1.0 - fault.f10),
        act.mass * act.gravity,
        act.spring_origin * stroke,
        act.stiffness * (1.0 - fault.f11),
        supply,
        stroke * (1.0 - fault.f1) * (1.0 - 0.2 * fault.f2) * (1.0 + 0.1 * fault.f3),
        0.2 * fault.f2 - 0.1 * fault.f3,
        0.5 * play,
        fault.f8,
        0.2e-6 * (fault.f9 + fault.f10),
        1.0 + 1.25 * fault.f13,
        0.5 * fault.f15 * stroke,
        1.0 - fault.f12,
        act.air_sign * act.positioner_gain,
    )


@jit
def moving(m: StemState, act: Valve, k: Course) -> Moving:
    """Return what the Euler steps change of a stem."""
    return Moving(m.p, m.m_a, m.x, m.X, plug_at(k, act, m.X))


@jit
def keep(m: StemState, stem: Moving, feedback: float, tick: int, y1: float, y2: float) -> None:
    """Write a stem that was advanced."""
    m.tick = tick
    m.y1 = y1
    m.y2 = y2
    m.p = stem.p
    m.m_a = stem.m_a
    m.x = stem.x
    m.X = stem.X
    m.feedback = feedback


@jit
def shown(k: Course, X: float) -> float:
    """Return the position that a sensor shows of a stem at X, 0..1."""
    return min(max(X / k.stroke * k.sensor, 0.0), 1.0)


@jit
def inputs(
    act: Valve,
    tick: int,
    t0: float,
    t1: float,
    cv0: float,
    cv1: float,
    dp0: float,
    dp1: float,
    slope0: float,
    slope1: float,
) -> tuple[float, float]:
    """
    Return the inputs at a tick between two samples.

    :param tick: of the controller; the others are as for `advance_stem`.
    :return: command; force of the medium on the plug times K_m, N.
    """
    dt = t1 - t0
    a = (tick * act.positioner_period - t0 + 0.5 * act.positioner_period) / dt
    b = 1.0 - a
    drop = (
        (1.0 + 2.0 * a) * b * b * dp0
        + a * b * b * dt * slope0
        + a * a * (3.0 - 2.0 * a) * dp1
        - a * a * b * dt * slope1
    )
    return min(max(cv0 + (cv1 - cv0) * a, 0.0), 1.024), P_RANGE * drop * act.signed_plug_area


@jit
def filtered(u: float, y1: float, y2: float, lag: float) -> tuple[float, float]:
    """Pass a command through the two lags of the positioner for one tick; return both outputs."""
    y1_next = u - (u - y1) * lag
    mean = 0.5 * (y1 + y1_next)
    return y1_next, mean - (mean - y2) * lag


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
    lag = math.exp(-act.positioner_period / act.positioner_lag)
    sub_steps = steps_per_tick(act)
    k = course(act, fault)
    stem, feedback = moving(m, act, k), m.feedback
    y1, y2, tick = m.y1, m.y2, m.tick
    while tick * act.positioner_period < t1:
        u, thrust = inputs(act, tick, t0, t1, cv0, cv1, dp0, dp1, slope0, slope1)
        feedback = fed_back(k, stem.X, feedback)
        e = opening(k, y2, feedback)
        for _ in range(sub_steps):
            stem = euler(k, act, e, thrust, stem)
        y1, y2 = filtered(u, y1, y2, lag)
        tick += 1
    keep(m, stem, feedback, tick, y1, y2)
    return shown(k, stem.X)


@jit
def advance_two(
    m: StemState,
    n: StemState,
    act: Valve,
    fault: Faults,
    other: Faults,
    t0: float,
    t1: float,
    cv0: float,
    cv1: float,
    dp0: float,
    dp1: float,
    slope0: float,
    slope1: float,
) -> tuple[float, float]:
    """
    Do `advance_stem` for two stems side by side, in little more than the time of one.

    A step waits for square root and divisions of the step before; a second stem fills the wait.

    :param m: the first; both have had the same commands at the same times.
    :param n: the second.
    :param fault: of the first.
    :param other: of the second.
    :return: the position that a sensor shows of each.
    """
    lag = math.exp(-act.positioner_period / act.positioner_lag)
    sub_steps = steps_per_tick(act)
    k, k_n = course(act, fault), course(act, other)
    stem, feedback = moving(m, act, k), m.feedback
    stem_n, feedback_n = moving(n, act, k_n), n.feedback
    y1, y2, tick = m.y1, m.y2, m.tick
    while tick * act.positioner_period < t1:
        u, thrust = inputs(act, tick, t0, t1, cv0, cv1, dp0, dp1, slope0, slope1)
        feedback = fed_back(k, stem.X, feedback)
        feedback_n = fed_back(k_n, stem_n.X, feedback_n)
        e, e_n = opening(k, y2, feedback), opening(k_n, y2, feedback_n)
        for _ in range(sub_steps):
            stem = euler(k, act, e, thrust, stem)
            stem_n = euler(k_n, act, e_n, thrust, stem_n)
        y1, y2 = filtered(u, y1, y2, lag)
        tick += 1
    keep(m, stem, feedback, tick, y1, y2)
    keep(n, stem_n, feedback_n, tick, y1, y2)
    return shown(k, stem.X), shown(k_n, stem_n.X)
