# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""State machine of monitor mode: INIT, LEARN_ALPHA, LEARN_PHI, MONITOR, and HOLD after a gap."""

from damadics_fd.core.approximator import guard, network, observer
from damadics_fd.core.approximator.state import State
from damadics_fd.core.approximator.threshold import threshold
from damadics_fd.core.jit import jit, layer
from damadics_fd.core.modes import (
    PAPER,
    PHASE_HOLD,
    PHASE_INIT,
    PHASE_LEARN_ALPHA,
    PHASE_LEARN_PHI,
    PHASE_MONITOR,
    PHASE_PAPER,
)
from damadics_fd.core.settings import Settings
from damadics_fd.core.valve.plug import recovery

TREND = 0.1  # s; slower parts of the disturbance are no noise
MEDIAN = 2.0  # s in which the median of the noise may grow e times
QUIET = 8.0  # part of the learning of Phi that has to end without a would-be alarm
UNPROVEN = 1.05  # growth of Phi that needs no proof
LEAST_NOISE = 1.0  # 1/s2; far below what moves the lowest threshold


@jit
def forget(s: State, c: Settings) -> None:
    """
    Forget what was learned and the travel seen, not the first block of the settled check.

    :param s: state record.
    :param c: settings record.
    """
    observer.begin(s, c)
    s.armed = False
    s.travel = 0.0
    s.noise = LEAST_NOISE
    s.proven = 0.0
    s.block[:] = 0.0
    s.block_end = 0
    s.drift = 0.0


@jit
def arm(s: State) -> None:
    """
    Monitor from now on with what the state has learned.

    :param s: state record.
    """
    s.armed = True
    s.unsettled = 0
    s.block[:] = 0.0


@jit
def guarded(c: Settings) -> bool:
    """
    Tell whether there is a learning time in which the valve can be compared with itself.

    :param c: settings record.
    :return: True unless the learning of Phi is set to last no time.
    """
    return c.t_learn > c.t_w


@jit
def phase_of(s: State, c: Settings) -> int:
    """
    Return the phase; arm where the time is up, the stem has travelled and the valve is settled.

    :param s: state record.
    :param c: settings record.
    :return: a PHASE constant.
    """
    if c.mode_code == PAPER:
        return PHASE_PAPER
    if s.elapsed < s.held_until:
        return PHASE_HOLD
    if s.armed:
        return PHASE_MONITOR
    t = (s.elapsed - s.start) * 1e-9
    if t < c.t_on:
        return PHASE_INIT
    if t < c.t_w:
        return PHASE_LEARN_ALPHA
    if guarded(c) and not settle(s, c):
        return PHASE_LEARN_ALPHA
    if t < c.t_learn or s.travel < c.travel_min or (guarded(c) and not excited(s, c)):
        return PHASE_LEARN_PHI
    s.b1 += max(0.0, least_bound(s, c) - network.bound(s, 0.0))
    arm(s)
    return PHASE_MONITOR


@jit
def settle(s: State, c: Settings) -> bool:
    """
    Close the block of the settled check when it is full; learn afresh where the valve changed.

    :param s: state record.
    :param c: settings record.
    :return: False where learning starts again.
    """
    length = int((c.t_learn - c.t_w) / 3.0 * 1e9)
    if s.block_end == 0:
        s.block_end = s.start + int(c.t_w * 1e9) + length
    if s.elapsed < s.block_end:
        return True
    s.block_end += length
    if guard.close_block(s, c):
        return True
    refuse(s, c)
    return False


@jit
def refuse(s: State, c: Settings) -> None:
    """
    Learn again from the start, because the valve changes while it is learned.

    :param s: state record.
    :param c: settings record.
    """
    forget(s, c)
    s.unsettled += 1
    s.start = s.elapsed - int(c.t_on * 1e9)


@jit
def progress_of(s: State, c: Settings) -> float:
    """
    Return the share of the learning that is done.

    :param s: state record.
    :param c: settings record.
    :return: 0..1.
    """
    if c.mode_code == PAPER or s.armed:
        return 1.0
    wait = c.t_w / c.t_learn if c.t_learn > 0.0 else 0.0
    done = min(1.0, (s.elapsed - s.start) * 1e-9 / c.t_learn) if c.t_learn > 0.0 else 1.0
    moved = min(1.0, s.travel / c.travel_min) if c.travel_min > 0.0 else 1.0
    return min(done, wait + (1.0 - wait) * moved, 0.99)


@jit
def watch_noise(s: State, c: Settings, dt: float) -> None:
    """
    Follow the median of the fast part of the disturbance (k2 + alpha1) xi2 + Phi sigm(xi2).

    The median, because it does not see the reversals of the friction; times the plug coefficient
    of the place, because the noise is mostly that of the pressures in the plug force.

    :param s: state record after `observer.observe`: noise [1/s2] in and out.
    :param c: settings record.
    :param dt: time step [s].
    """
    d = (c.k2 + s.ah1) * s.xi2 + abs(s.phi) * min(max(s.xi2 / c.delta, -1.0), 1.0)
    s.trend += min(dt / TREND, 1.0) * (d - s.trend)
    grow = 1.0 + min(dt / MEDIAN, 1.0)
    fast = abs(d - s.trend) * recovery(c.plug_table, s.x1 - c.spring_origin)
    s.noise = s.noise * grow if fast > s.noise else max(s.noise / grow, LEAST_NOISE)


@jit
def largest_noise(s: State, c: Settings) -> float:
    """
    Return the standard deviation of the noise where it is largest, near the closed stop.

    :param s: state record.
    :param c: settings record.
    :return: of the disturbance [1/s2].
    """
    return float(1.4826 * s.noise / recovery(c.plug_table, 1.0 - c.gate_high))


@jit
def least_bound(s: State, c: Settings) -> float:
    """
    Return the bound that keeps the noise of the sensors below the threshold.

    Friction that is small beside the noise would leave a Phi that noise passes now and then.

    :param s: state record.
    :param c: settings record.
    :return: least Phi [1/s2].
    """
    return float(c.noise_factor * largest_noise(s, c) / (1.0 + c.kappa))


@jit
def excited(s: State, c: Settings) -> bool:
    """
    Tell whether the stem has moved in such a way that what was learned holds from now on.

    Phi has not grown since the valve was last seen to be the same, so that no fault was learned
    unseen; and what the force balance foresees anywhere in the stroke, in both directions, stays
    below what raises an alarm: motion in one direction lets alpha5 take friction for stiffness.
    Nothing has raised one for a while either.

    :param s: state record: exceeded in and out.
    :param c: settings record.
    :return: False where more motion is needed.
    """
    if guard.unlike(s):
        return False
    learned = network.bound(s, 0.0)
    if s.proven == 0.0 or learned > UNPROVEN * s.proven:
        return False
    phi = max(learned, least_bound(s, c))
    alarm = phi + (c.k2 + s.ah1) * threshold(c, phi, s.ah1)
    force = guard.foreseen(
        s,
        s.ah5 / c.alpha5 - 1.0,
        largest_noise(s, c) / c.alpha5,
        c.spring_origin + c.gate_low,
        c.spring_origin + 1.0 - c.gate_high,
    )
    if c.alpha5 * force > alarm:
        s.exceeded = s.elapsed
    return bool((s.elapsed - s.exceeded) * 1e-9 >= (c.t_learn - c.t_w) / QUIET)


@jit
def gated(c: Settings, x: float) -> bool:
    """
    Tell whether a stop may push the stem or the plug force is too steep to be learned from.

    :param c: settings record.
    :param x: stem position, filtered [1].
    :return: True where nothing is learned.
    """
    return x < c.gate_low or x > 1.0 - c.gate_high


@layer
def adapt(s: State, c: Settings, phase: int, dt: float, x1: float, x2: float, u: float) -> None:
    """
    Adapt by one step what the phase allows.

    :param s: state record after `observer.observe`.
    :param c: settings record.
    :param phase: phase of the estimator.
    :param dt: time step [s].
    :param x1: position, filtered [1].
    :param x2: velocity [1/s].
    :param u: input, filtered [1].
    """
    if phase == PHASE_PAPER:
        observer.adapt_alpha(s, c, dt, x1, u)
        observer.adapt_phi(s, c, dt, x2)
    elif phase in (PHASE_LEARN_ALPHA, PHASE_LEARN_PHI) and not gated(c, x1 - c.spring_origin):
        observer.adapt_alpha(s, c, dt, x1, u)
        if phase == PHASE_LEARN_PHI:
            observer.adapt_phi(s, c, dt, x2)


@layer
def follow(s: State, c: Settings, phase: int, dt: float) -> None:
    """
    Follow the travel of the stem and collect the settled check's block.

    :param s: state record with the filtered signals x1, x2, u.
    :param c: settings record.
    :param phase: phase of the estimator.
    :param dt: time step [s].
    """
    x = s.x1 - c.spring_origin
    step = guard.track(s, x, c.play)
    if abs(x - s.rest) > 2.0 * c.play:
        s.rest = x
        s.rested = s.elapsed
    if phase != PHASE_LEARN_PHI or gated(c, x):
        return
    s.travel += step
    watch_noise(s, c, dt)
    if abs(s.xi2) >= threshold(c, s.phi, s.ah1):
        s.exceeded = s.elapsed
    if s.elapsed - s.moved < guard.FRESH:
        left = s.u - s.x1 - c.alpha1 / c.alpha5 * s.x2
        guard.collect(s, dt / guard.CORRELATION, s.x1, left)
        if guarded(c) and guard.strays(s, c, dt, s.x1, left):
            refuse(s, c)
