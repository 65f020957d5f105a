# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Velocity from position: high-pass, steady-state Kalman, super-twisting differentiator.

The first two pass position and input through the same low-pass H and return x1 = H y, u = H u,
x2 = d/dt H y, so that the filter's lag leaves no error in the plant equation (4).
"""

import math

from damadics_fd.core.approximator.state import Velocity
from damadics_fd.core.jit import jit
from damadics_fd.core.settings import Settings

HIGH_PASS, KALMAN, SUPER_TWISTING = range(3)


@jit
def restart(s: Velocity, y: float) -> None:
    """
    Put the filters on a position at rest; `restart_input` does so for the input.

    :param s: state record.
    :param y: position [1].
    """
    s.y = y
    s.y_raw = y
    s.y_lag = y
    s.v = 0.0
    s.uv = 0.0
    s.dt = 0.0


@jit
def restart_input(s: Velocity, u: float) -> None:
    """
    Put the filters of the input on a constant.

    :param s: state record.
    :param u: input [1].
    """
    s.uy = u
    s.u_raw = u


@jit
def tune_kalman(s: Velocity, c: Settings, dt: float) -> None:
    """
    Set the gains of the steady-state Kalman filter for a time step.

    alpha = 1 - zd^2, beta = 1 + zd^2 - 2 zd cos(.7072 wn dt), zd = exp(-.707 wn dt), written
    such that nothing cancels at small dt.

    :param s: state record: gain = alpha, gain_v = beta/dt, lag = (alpha/beta - 1/2) dt out.
    :param c: settings record.
    :param dt: time step [s].
    """
    decay = 0.707 * c.wn * dt
    zd = math.exp(-decay)
    alpha = -math.expm1(-2.0 * decay)
    half = math.sin(0.5 * 0.7072 * c.wn * dt)
    beta = math.expm1(-decay) ** 2 + 4.0 * zd * half * half
    s.dt = dt
    s.gain = alpha
    s.gain_v = beta / dt
    s.lag = (alpha / beta - 0.5) * dt


@jit
def filter_position(s: Velocity, c: Settings, dt: float, y: float) -> float:
    """
    Pass one position through the velocity estimator.

    :param s: state record: x1, x2 [1/s] out.
    :param c: settings record.
    :param dt: time since the last sample [s].
    :param y: position [1].
    :return: the position smoothed without lag on ramps, for the plug force [1].
    """
    smooth = y
    if c.velocity_code == HIGH_PASS:  # s/(tau s + 1), Tustin
        s.v = (2.0 * (y - s.y_raw) + (2.0 * c.tau - dt) * s.v) / (2.0 * c.tau + dt)
        low = y - c.tau * s.v
        s.y_lag += dt * (low + s.y - 2.0 * s.y_lag) / (2.0 * c.tau + dt)
        s.y = low
        s.x1 = low
        smooth = 2.0 * low - s.y_lag  # Brown's double exponential smoothing
    elif c.velocity_code == KALMAN:
        if dt != s.dt:
            tune_kalman(s, c, dt)
        predicted = s.y + dt * s.v
        error = y - predicted
        s.y = predicted + s.gain * error
        s.v += s.gain_v * error
        s.x1 = s.y - s.lag * s.v
        smooth = s.y
    else:
        super_twist(s, c, dt, y)
        s.x1 = y
        smooth = s.y
    s.y_raw = y
    s.x2 = s.v
    if not c.consistent:
        s.x1 = y
    return smooth


@jit
def super_twist(s: Velocity, c: Settings, dt: float, y: float) -> None:
    """
    Advance Levant's super-twisting differentiator by an implicit step (no chatter).

    Gains 1.5 sqrt(L) and 1.1 L; the implicit sign of the error is found in closed form.

    :param s: state record: y, v in and out.
    :param c: settings record.
    :param dt: time step [s].
    :param y: position [1].
    """
    free = s.y - y + dt * s.v
    jump = 1.1 * c.lipschitz * dt  # largest change of the velocity in one step
    rest = abs(free) - dt * jump
    if rest <= 0.0:  # the error can be brought to zero within this step
        s.v -= free / dt
        s.y = y
        return
    sign = 1.0 if free > 0.0 else -1.0
    reach = 0.75 * dt * math.sqrt(c.lipschitz)
    root = math.sqrt(reach * reach + rest) - reach  # sqrt of the remaining error
    s.y = y + sign * root * root
    s.v -= sign * jump


@jit
def filter_input(s: Velocity, c: Settings, dt: float, u: float) -> None:
    """
    Pass the input through the same low-pass as the position.

    :param s: state record: u out; `filter_position` was called for this sample.
    :param c: settings record.
    :param dt: time since the last sample [s].
    :param u: input [1].
    """
    if not c.consistent or c.velocity_code == SUPER_TWISTING:
        s.u = u
    elif c.velocity_code == HIGH_PASS:
        s.uy += dt * (u + s.u_raw - 2.0 * s.uy) / (2.0 * c.tau + dt)
        s.u = s.uy
    else:
        predicted = s.uy + dt * s.uv
        error = u - predicted
        s.uy = predicted + s.gain * error
        s.uv += s.gain_v * error
        s.u = s.uy - s.lag * s.uv
    s.u_raw = u
