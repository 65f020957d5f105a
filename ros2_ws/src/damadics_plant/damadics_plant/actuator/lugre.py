# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The actuator with LuGre friction, equations (1)-(9) of the paper: implicit midpoint, 1 ms.

Explicit schemes diverge as soon as friction is faulted, because the bristles are stiff. Here the
bristle state is eliminated: one scalar equation in the new velocity remains, solved by bracketed
Newton for half a step; twice the half step is the implicit midpoint rule, of second order.
"""

import math

import numpy as np
from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats, Record, Rows
from damadics_fd.core.valve.flow import vapour_pressure
from damadics_fd.core.valve.parameters import Valve
from damadics_fd.core.valve.pneumatics import ATMOSPHERE, air_flow, set_point_filter, transducer
from damadics_fd.core.valve.tables import interpolate

from damadics_plant.actuator.measure import measure
from damadics_plant.actuator.parameters import Constants, LuGreActuator, TwinActuator
from damadics_plant.actuator.physics import plug_force, plug_stiffness
from damadics_plant.faults.effects import Effects, FaultRow, update_effects

RATE = 200.0
"""Natural rate [Hz]; slower samples are every n-th of at least these."""

SUBSTEP = 1e-3
"""Longest substep [s]."""

NOMINAL = Valve().stroke
"""Stroke of the benchmark's valve, for which the lever of the positioner was made [m]."""

JERK = 0.01
"""Change of velocity in a substep beyond which the substep is done again in four [m/s]."""


class State(Record):
    """State of the model between two steps."""

    y1: float
    y2: float  # set-point filter [1]
    ma: float  # air in the chamber [kg]
    v: float
    x: float
    z: float  # stem [m/s, m], bristles [m]
    xb: float
    e: float  # position feedback [m], held E/P output
    reset: float  # integral of the error of a positioner of one's own
    t1: float
    pv: float  # medium [degC], its vapour pressure [Pa]
    k: int
    substep: int
    held: int  # ticks, substeps and holds done


def initial_state(a: LuGreActuator) -> np.ndarray:
    """
    Return the state at scenario zero: at rest, chamber vented, where the spring has moved it.

    :param a: constants of the actuator.
    :return: structured array of shape (1,).
    """
    state = State.rows()
    state['ma'] = ATMOSPHERE * a.dead_volume / (a.gas_constant * a.air_temperature)
    if isinstance(a, TwinActuator) and a.air_opens:
        state['x'] = state['xb'] = a.stroke  # the spring has closed it
    state['t1'] = math.nan
    return state


@jit
def _half_step(
    v: float,
    z: float,
    h: float,
    mass: float,
    force: float,
    stiffness: float,
    scale: float,
    a: Constants,
) -> tuple[float, float]:
    """
    Solve one implicit Euler step of stem and bristles for the new velocity.

    :param v: velocity [m/s].
    :param z: deflection of the bristles [m].
    :param h: length of the step [s].
    :param mass: moving mass [kg].
    :param force: on the stem at the old position, without friction [N].
    :param stiffness: -d force / dx [N/m], >= 0 in use.
    :param scale: 1 + Delta F_1.
    :param a: constants of the actuator.
    :return: velocity and deflection after the step.
    """
    s0, s1 = a.bristle_stiffness, a.bristle_damping
    fc, df = a.coulomb, a.static - a.coulomb
    low, high = -200.0, 200.0
    w, zn, dzn, move = v, z, 0.0, 0.0
    for _ in range(100):
        ratio = (w / a.stribeck) * (w / a.stribeck)
        stribeck = df * math.exp(-ratio) if ratio < 50.0 else 0.0
        g = fc + stribeck
        lam = s0 * abs(w) / g
        dg = -2.0 * w / (a.stribeck * a.stribeck) * stribeck
        dlam = ((s0 if w >= 0 else -s0) - lam * dg) / g
        d = 1.0 + h * lam
        zn = (z + h * w) / d
        dzn = (h - zn * h * dlam) / d
        friction = scale * (s0 * zn + s1 * (zn - z) / h + a.viscous * w)
        r = mass * (w - v) / h - force + stiffness * h * w + friction
        dr = mass / h + stiffness * h + scale * ((s0 + s1 / h) * dzn + a.viscous)
        if r > 0.0:
            high = w
        else:
            low = w
        step = r / dr if dr > 0.0 else 0.0
        new = w - step
        if not low < new < high or dr <= 0.0:
            new = 0.5 * (low + high)
        move = new - w
        w = new
        if abs(move) <= 1e-9 + 1e-7 * abs(w):  # quadratic convergence: the error is its square
            break
    return w, zn + dzn * move


@jit
def chamber(x: float, a: Constants, e: Effects) -> float:
    """
    Evaluate the volume of the chamber.

    :param x: position of the stem [m].
    :param a: constants of the actuator.
    :param e: effects of the faults.
    :return: [m3].
    """
    way = a.stroke - x if a.air_opens > 0.0 else x
    volume: float = a.dead_volume + e.area * way
    return volume


@jit
def booster(s: State, a: Constants) -> float:
    """
    Evaluate the positioner.

    :param s: state; set point and feedback are read, the integral of the error is kept.
    :param a: constants of the actuator.
    :return: opening of the booster, > 0 fills the chamber, < 0 vents it.
    """
    position = s.xb / a.stroke
    if a.errors[0] >= 0.0:
        return transducer(s.y2, position, a.gain)
    error = (s.y2 - position) * (1.0 - 2.0 * a.air_opens)
    reset = s.reset + a.reset_rate * error * a.hold
    s.reset = min(max(reset, -0.5 * a.reset_band), 0.5 * a.reset_band)
    if abs(error) > a.reset_band:
        s.reset = 0.0
    return interpolate(error + s.reset, a.errors, a.openings)


@jit
def _substep(s: State, a: Constants, e: Effects, dp: float, h: float) -> None:
    rt = a.gas_constant * a.air_temperature
    volume = chamber(s.x, a, e)
    p = s.ma * rt / volume
    factor = a.air_flow
    if a.errors[0] < 0.0:
        slope = a.fill_slope if s.e > 0.0 else a.vent_slope
        factor *= max(1.0 + slope * ((p - ATMOSPHERE) / a.supply - 0.5), 0.0)
    flow = air_flow(min(max(s.e * e.opening, -1.0), 1.0), e.supply, p - ATMOSPHERE, factor)
    if e.leak > 0.0:
        flow -= e.leak * math.sqrt(abs(p - ATMOSPHERE))
    p_mid = (s.ma + 0.5 * h * flow) * rt / volume
    xr = s.x / a.stroke + e.xr_offset
    k = a.stiffness * e.spring
    air, flows = 1.0 - 2.0 * a.air_opens, 1.0 - 2.0 * a.flow_closes
    relaxed = a.stroke + a.preload if a.air_opens > 0.0 else -a.preload
    force = (
        a.mass * a.gravity
        + air * e.area * (p_mid - ATMOSPHERE)
        - flows * plug_force(a.recovery, xr, dp, a.plug_diameter)
        - k * (s.x - relaxed)
    )
    stiffness = (
        k
        + e.area * e.area * p_mid / volume
        + flows * plug_stiffness(a.recovery, xr, dp, a.plug_diameter, a.stroke)
    )
    v, z = _half_step(s.v, s.z, 0.5 * h, a.mass, force, stiffness, e.friction, a)
    x = s.x + h * v  # twice the half step: y+ = 2 y_half - y
    v, z = 2.0 * v - s.v, 2.0 * z - s.z
    if x <= 0.0:
        s.x, s.v = 0.0, 0.0  # inelastic stop, bristles frozen
    elif x >= e.stop:
        s.x, s.v = e.stop, 0.0
    else:
        s.x, s.v, s.z = x, v, z
    s.ma = max(s.ma + h * flow, 1e-9)


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
    Advance the plant over a block of ticks and sample its outputs.

    :param state: of shape (1,), of `State`; updated.
    :param constants: `LuGreActuator.record()`.
    :param faults: `fault_table`.
    :param f: work space of shape (20,).
    :param effects: of shape (1,), of `Effects`; updated.
    :param inputs: CV at the positioner, P1 [Pa], P2 [Pa], T1 [degC]; shape (4, ticks).
    :param rate: ticks per second, each of as many substeps as needed.
    :param every: ticks per sample; the first tick of the block is sampled.
    :param out: receives the rows of `measure`; shape (`ROWS`, ceil(ticks / every)).
    """
    s, a, e = state[0], constants[0], effects[0]
    substeps = int(math.ceil(1.0 / (rate * SUBSTEP) - 1e-9))
    h = 1.0 / (rate * substeps)
    longer = a.stroke / NOMINAL
    q = h / a.lag
    decay = math.exp(-q)
    for i in range(inputs.shape[1]):
        update_effects(faults, s.k / rate, f, a, e, True)
        p1, p2 = inputs[1, i] * e.p1, inputs[2, i] * e.p2
        t1 = min(300.0, inputs[3, i] + e.heat) if e.heat > 0.0 else inputs[3, i]
        if t1 != s.t1:
            s.t1, s.pv = t1, vapour_pressure(t1)
        s.x = min(s.x, e.stop)
        if i % every == 0:
            ps = s.ma * a.gas_constant * a.air_temperature / chamber(s.x, a, e) - ATMOSPHERE
            x = s.x / a.stroke
            measure(x + e.xr_offset, x, ps, p1, p2, t1, s.pv, a, e, out[:, i // every])
        dp = max(p1, s.pv) - p2
        for _ in range(substeps):
            update_effects(faults, (s.substep + 0.5) * h, f, a, e, True)
            fed_back = min(max(s.x * e.position, -0.25 * a.stroke), 1.25 * a.stroke)
            fed_back = min(max(fed_back, -0.01 * longer), 0.05 * longer)  # reach of the lever
            s.xb = min(max(s.xb, fed_back - 0.5 * e.feedback), fed_back + 0.5 * e.feedback)
            if s.substep * h >= s.held * a.hold - 1e-9:
                s.e = booster(s, a)
                s.held += 1
            ma, v, x, z = s.ma, s.v, s.x, s.z
            _substep(s, a, e, dp, h)
            if abs(s.v - v) > JERK:
                s.ma, s.v, s.x, s.z = ma, v, x, z
                for _ in range(4):
                    _substep(s, a, e, dp, 0.25 * h)
            s.y1, s.y2 = set_point_filter(s.y1, s.y2, inputs[0, i], q, decay)
            s.substep += 1
        s.k += 1
