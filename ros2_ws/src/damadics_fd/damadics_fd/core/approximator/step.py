# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The estimator's step: check, filter, observe, learn; compiled."""

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core import quality
from damadics_fd.core.approximator import learning, network, observer, transmitter, velocity
from damadics_fd.core.approximator.spikes import is_spike
from damadics_fd.core.approximator.state import Estimate, State
from damadics_fd.core.jit import jit, layer
from damadics_fd.core.modes import MONITOR, PAPER, PHASE_PAPER
from damadics_fd.core.quality import Quality
from damadics_fd.core.record import Floats, Ints, Rows
from damadics_fd.core.settings import Settings
from damadics_fd.core.valve import force

SUBSTEPS = 1000  # at most, in one gap
LARGEST_PART = 1.5  # of a sample period, and of 1/k2: the printed observer is unstable from 2.8 on


@jit
def between(before: float, now: float, i: int, parts: int) -> float:
    """
    Return a signal at the end of a part of the step, on a straight line.

    :param before: the signal at the start of the step.
    :param now: the signal at its end.
    :param i: number of the part, from 1.
    :param parts: number of all parts.
    :return: the signal.
    """
    if i >= parts:
        return now
    part = 0.5 if parts == 2 else i / parts  # a division saved nearly always
    return before + part * (now - before)


@layer
def advance(
    s: State,
    c: Settings,
    phase: int,
    dt: float,
    terms: tuple[float, float, float],
    x1_0: float,
    x2_0: float,
    u_0: float,
    x1: float,
    x2: float,
    u: float,
) -> None:
    """
    Advance observer and, where the phase allows it, adaptation by one step.

    :param s: state record.
    :param c: settings record.
    :param phase: phase of the estimator.
    :param dt: time step [s].
    :param terms: sigmoids of the velocity at the end of the step.
    :param x1_0: position at the start of the step, filtered [1].
    :param x2_0: velocity there [1/s].
    :param u_0: input there, filtered [1].
    :param x1: position at the end of the step, filtered [1].
    :param x2: velocity there [1/s].
    :param u: input there, filtered [1].
    """
    if phase == PHASE_PAPER:
        observer.observe_printed(s, c, dt, terms, x1_0, x2_0, u_0, x1, x2, u)
    else:
        observer.observe(s, c, dt, terms, x1, x2, u)
    learning.adapt(s, c, phase, dt, x1, x2, u)


@jit
def step(
    q: Quality,
    s: State,
    c: Settings,
    e: Estimate,
    stamp: int,
    cv: float,
    x1: float,
    p1: float,
    p2: float,
    t1: float,
    flow: float,
    ps: float,
) -> int:
    """
    Take one sample.

    :param q: quality record.
    :param s: state record; untouched where the sample is refused.
    :param c: settings record.
    :param e: estimate record, written where the sample is accepted.
    :param stamp: stamp [ns].
    :param cv: control value [1].
    :param x1: stem position [1].
    :param p1: pressure before the valve [Pa].
    :param p2: pressure behind the valve [Pa].
    :param t1: temperature of the medium [degC].
    :param flow: flow [kg/s].
    :param ps: chamber pressure, gauge [Pa].
    :return: quality.ACCEPTED or the reason of refusal.
    """
    reason = quality.check_values(c, cv, x1, p1, p2, t1, flow, ps)
    if reason == quality.ACCEPTED:
        reason = quality.check_stamp(q, c, stamp)
    if (
        reason == quality.ACCEPTED
        and c.mode_code == MONITOR
        and is_spike(q, c, stamp, x1, p1, p2, ps)
    ):
        reason = quality.SPIKE
    first = q.counts[quality.ACCEPTED] == 0
    dt, afresh = quality.admit(q, c, stamp, reason)
    if reason != quality.ACCEPTED:
        return reason

    if c.ps_lag > 0.0:
        x1, p1, p2 = transmitter.delay(s, c, afresh, dt, x1, p1, p2)
    y = x1 + c.spring_origin
    if afresh:
        velocity.restart(s, y)
        observer.restart(s, y)
        if first:
            s.place = x1
        if s.armed or not first:
            s.held_until = s.elapsed + int(c.hold * 1e9)
    else:
        s.elapsed += int(dt * 1e9 + 0.5)
    x1_before, x2_before, u_before = s.x1, s.x2, s.u
    smooth = velocity.filter_position(s, c, dt, y)
    u = cv
    if c.mode_code == MONITOR:
        u = force.force_input(c, smooth - c.spring_origin, p1, p2, ps)
    if afresh:
        velocity.restart_input(s, u)
    velocity.filter_input(s, c, dt, u)

    if afresh:  # there is no step before the first sample
        x1_before, x2_before, u_before = s.x1, s.x2, s.u
        dt = 0.0 if c.mode_code == PAPER else dt

    phase = learning.phase_of(s, c)
    periods = dt * c.sample_rate
    if c.mode_code == PAPER:
        periods = max(periods, dt * c.k2)
    parts, length = 1, dt
    if periods >= 2.0 * LARGEST_PART:
        parts = min(int(periods / LARGEST_PART) + 1, SUBSTEPS)
        length = dt / parts
    elif periods >= LARGEST_PART:
        parts, length = 2, 0.5 * dt
    x1_0, x2_0, u_0 = x1_before, x2_before, u_before
    # the sigmoids one part ahead: they take as long as the rest of a part, and wait for nothing
    ahead = network.sigmoids(between(x2_before, s.x2, 1, parts))
    for i in range(1, parts + 1):  # a gap is bridged on straight lines between filtered signals
        terms = ahead
        x1_1, x2_1, u_1 = s.x1, s.x2, s.u
        if i < parts:
            x1_1 = between(x1_before, s.x1, i, parts)
            x2_1 = between(x2_before, s.x2, i, parts)
            u_1 = between(u_before, s.u, i, parts)
            ahead = network.sigmoids(between(x2_before, s.x2, i + 1, parts))
        advance(s, c, phase, length, terms, x1_0, x2_0, u_0, x1_1, x2_1, u_1)
        x1_0, x2_0, u_0 = x1_1, x2_1, u_1

    learning.follow(s, c, phase, dt)

    e.stamp = stamp
    e.x2 = s.x2
    e.x1_hat = s.xh1
    e.x2_hat = s.xh2
    e.xi1 = s.xi1
    e.xi2 = s.xi2
    e.phi = s.phi
    e.alpha1 = s.ah1
    e.alpha4 = s.ah4
    e.alpha5 = s.ah5
    e.x1 = x1
    e.u = u
    e.ps = ps
    e.dp = p1 - p2
    e.progress = learning.progress_of(s, c)
    e.phase = phase
    s.phase = phase
    return reason


@jit
def update(
    q: Rows[Quality],
    s: Rows[State],
    c: Rows[Settings],
    e: Rows[Estimate],
    stamp: int,
    cv: float,
    x1: float,
    p1: float,
    p2: float,
    t1: float,
    flow: float,
    ps: float,
) -> int:
    """
    Take one sample; `step` for arrays of length 1, to be called from Python.

    :param q: quality state.
    :param s: estimator state.
    :param c: settings.
    :param e: estimate.
    :param stamp: the rest is the sample as in `step`.
    :return: quality.ACCEPTED or the reason of refusal.
    """
    return step(q[0], s[0], c[0], e[0], stamp, cv, x1, p1, p2, t1, flow, ps)


@jit
def estimate_column(
    q: Rows[Quality],
    s: Rows[State],
    c: Rows[Settings],
    reason: NDArray[np.uint8],
    e: Rows[Estimate],
    stamp: Ints,
    cv: Floats,
    x1: Floats,
    p1: Floats,
    p2: Floats,
    t1: Floats,
    flow: Floats,
    ps: Floats,
) -> None:
    """
    Take a column of samples.

    :param q: quality state.
    :param s: estimator state.
    :param c: settings.
    :param reason: written: ACCEPTED or the reason of refusal.
    :param e: estimates, written; rows of refused samples stay as they are.
    :param stamp: the rest are columns of the signals as in `step`.
    """
    for i in range(len(stamp)):
        reason[i] = step(
            q[0],
            s[0],
            c[0],
            e[i],
            stamp[i],
            cv[i],
            x1[i],
            p1[i],
            p2[i],
            t1[i],
            flow[i],
            ps[i],
        )


@jit
def start(s: Rows[State], c: Rows[Settings]) -> None:
    """
    Set an estimator state to "nothing learned".

    :param s: estimator state.
    :param c: settings.
    """
    learning.forget(s[0], c[0])


@jit
def take_up(s: Rows[State]) -> None:
    """
    Go to MONITOR with what the state has learned, as soon as the filters have settled.

    :param s: estimator state.
    """
    learning.arm(s[0])


@jit
def progress(s: Rows[State], c: Rows[Settings]) -> float:
    """
    Return the share of the learning that is done.

    :param s: estimator state.
    :param c: settings.
    :return: 0..1.
    """
    return learning.progress_of(s[0], c[0])
