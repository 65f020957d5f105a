# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The DABLib v1.22 actuator: fourth-order Runge-Kutta at 2.5 ms with the library's memory blocks.

A memory block gives the value of the previous step throughout a step. The library delays the
chamber pressure in the flow law, the position in spring and lower stop, and the history of the
play; the plug force is held over a step. Outputs show the state before the step.
"""

import math

import numpy as np
from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats, Record, Rows
from damadics_fd.core.valve.flow import vapour_pressure
from damadics_fd.core.valve.pneumatics import (
    ATMOSPHERE,
    air_flow,
    feedback_angle,
    set_point_filter,
    transducer,
)

from damadics_plant.actuator.measure import measure
from damadics_plant.actuator.parameters import Actuator, Constants
from damadics_plant.actuator.physics import KM, plug_force
from damadics_plant.faults.effects import Effects, FaultRow, update_effects

RATE = 400.0
"""Steps per second."""


class State(Record):
    """State of the model between two steps."""

    y1: float
    y2: float  # set-point filter [1]
    ma: float
    p: float  # air in the chamber [kg], its absolute pressure [Pa]
    v: float
    x: float  # stem before the play [m/s, m]
    x_: float
    xp_: float
    up: int  # history of the play: in, out, direction
    X_: float
    ps_: float
    at_stop: int  # memory: position [m], pressure [Pa], stops
    xb: float
    e: float  # position feedback [m], held E/P output
    t1: float
    pv: float  # medium [degC], its vapour pressure [Pa]
    k: int  # steps done


def initial_state(a: Actuator) -> np.ndarray:
    """
    Return the state at scenario zero: valve open and at rest, chamber vented.

    :param a: constants of the actuator.
    :return: structured array of shape (1,).
    """
    state = State.rows()
    state['p'] = ATMOSPHERE
    state['ma'] = ATMOSPHERE * a.dead_volume / (a.gas_constant * a.air_temperature)
    state['at_stop'] = 1
    state['t1'] = math.nan
    return state


@jit
def _play(x: float, s: State, width: float) -> tuple[float, int]:
    up = s.up
    if x > s.x_:
        up = 1
    elif x < s.x_:
        up = 0
    if up == 1:
        return max(x - 0.5 * width, s.xp_), up
    return min(x + 0.5 * width, s.xp_), up


@jit
def _derivatives(
    ma: float,
    p: float,
    v: float,
    x: float,
    inflow: float,
    held: float,
    width: float,
    s: State,
    a: Constants,
    e: Effects,
) -> tuple[float, float, float]:
    xp, _ = _play(x, s, width)
    X = min(max(xp, 0.0), e.stop)
    V = a.dead_volume + e.area * X
    ps = p - ATMOSPHERE
    dma = inflow
    if e.leak > 0.0:
        dma -= e.leak * math.sqrt(abs(ps))
    dp = p / V * (dma * V / ma - e.area * min(max(v, -0.02), 0.02))
    force = held + e.area * ps - a.viscous * v
    if (force <= 0.0 and s.X_ <= 0.0) or (force > 0.0 and e.stop <= X):
        force = 0.0
    return dma, dp, force / a.mass


@jit
def simulate_block(
    state: Rows[State],
    constants: Rows[Constants],
    faults: Rows[FaultRow],
    f: Floats,
    effects: Rows[Effects],
    inputs: np.ndarray,
    rate: float,
    every: int,
    out: np.ndarray,
) -> None:
    """
    Advance the plant over a block of steps and sample its outputs.

    :param state: of shape (1,), of `State`; updated.
    :param constants: `Actuator.record()`.
    :param faults: `fault_table`.
    :param f: work space of shape (20,).
    :param effects: of shape (1,), of `Effects`; updated.
    :param inputs: CV at the positioner, P1 [Pa], P2 [Pa], T1 [degC]; shape (4, steps).
    :param rate: steps per second, 400.
    :param every: steps per sample; the first step of the block is sampled.
    :param out: receives the rows of `measure`; shape (`ROWS`, ceil(steps / every)).
    """
    s, a, e = state[0], constants[0], effects[0]
    h = 1.0 / rate
    q = h / a.lag
    decay = math.exp(-q)
    hold = int(round(a.hold * rate))
    x_low, x_high = -0.05 * a.stroke, 1.25 * a.stroke
    for i in range(inputs.shape[1]):
        update_effects(faults, s.k / rate, f, a, e, False)
        width = e.play
        if e.twist > 0.0:
            width *= 1.0 + e.twist * (1.0 - s.X_ / a.stroke)
        xp, up = _play(s.x, s, width)
        X = min(max(xp, 0.0), e.stop)
        xr = X / a.stroke + e.xr_offset
        p1, p2 = inputs[1, i] * e.p1, inputs[2, i] * e.p2
        ps = s.p - ATMOSPHERE
        t1 = min(300.0, inputs[3, i] + e.heat) if e.heat > 0.0 else inputs[3, i]
        if t1 != s.t1:
            s.t1, s.pv = t1, vapour_pressure(t1)
        if i % every == 0:
            measure(xr, X / a.stroke, ps, p1, p2, t1, s.pv, a, e, out[:, i // every])

        at_stop = 1 if s.X_ <= 0.0 or e.stop <= X else 0
        if at_stop != s.at_stop:
            s.v = 0.0
            s.at_stop = at_stop

        fed_back = min(max(X * e.position, -0.25 * a.stroke), 1.25 * a.stroke)
        fed_back = min(max(fed_back, -0.01), 0.05)
        s.xb = min(max(s.xb, fed_back - 0.5 * e.feedback), fed_back + 0.5 * e.feedback)
        if s.k % hold == 0:
            s.e = transducer(s.y2, feedback_angle(s.xb, a.stroke), a.gain)
        opening = min(max(s.e * e.opening, -1.0), 1.0)
        inflow = air_flow(opening, e.supply, s.ps_, a.air_flow)

        held = (
            a.mass * a.gravity
            - plug_force(KM, xr, max(p1, s.pv) - p2, a.plug_diameter)
            - a.stiffness * (s.X_ + a.preload) * e.spring
        )
        m1, p1_, v1 = _derivatives(s.ma, s.p, s.v, s.x, inflow, held, width, s, a, e)
        x1 = s.v
        m2, p2_, v2 = _derivatives(
            s.ma + 0.5 * h * m1,
            s.p + 0.5 * h * p1_,
            s.v + 0.5 * h * v1,
            s.x + 0.5 * h * x1,
            inflow,
            held,
            width,
            s,
            a,
            e,
        )
        x2 = s.v + 0.5 * h * v1
        m3, p3_, v3 = _derivatives(
            s.ma + 0.5 * h * m2,
            s.p + 0.5 * h * p2_,
            s.v + 0.5 * h * v2,
            s.x + 0.5 * h * x2,
            inflow,
            held,
            width,
            s,
            a,
            e,
        )
        x3 = s.v + 0.5 * h * v2
        m4, p4_, v4 = _derivatives(
            s.ma + h * m3, s.p + h * p3_, s.v + h * v3, s.x + h * x3, inflow, held, width, s, a, e
        )
        x4 = s.v + h * v3

        s.x_, s.xp_, s.up, s.X_, s.ps_ = s.x, xp, up, X, ps
        s.ma = min(max(s.ma + h / 6 * (m1 + 2 * m2 + 2 * m3 + m4), 1e-9), 0.1)
        s.p = min(max(s.p + h / 6 * (p1_ + 2 * p2_ + 2 * p3_ + p4_), 0.0), 700e3)
        s.v += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
        s.x = min(max(s.x + h / 6 * (x1 + 2 * x2 + 2 * x3 + x4), x_low), x_high)
        s.y1, s.y2 = set_point_filter(s.y1, s.y2, inputs[0, i], q, decay)
        s.k += 1
