# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
A stem as anyone's positioner moves it: dead time, first-order lag, rate limits, dead band.

The law runs on CV alone and never looks at the measured position, so a stem that stands still or
is off by a little shows for as long as it lasts. A slow copy moves no faster than the law was seen
to move while it was right; a quick one is held back less by the limits of the rates, which
follow from the air supply of the day. Between the two lies what was not learned, and a stem that
is found there is no evidence against the valve.
"""

import math
from typing import Annotated

import numpy as np

from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats, Record

DELAYS = 64  # samples of CV kept for the dead time
FADE_LAGS, FADE_S = 3.0, 5.0  # how long a motion is remembered
TRANSIENT = 0.08  # of the way still to go that a law knows no better
UNSEEN = 0.25  # the same of the way beyond the longest in the record
FAST = 1e3  # a rate that limits nothing, 1/s
QUICKER = 1.5  # multiples of a limit of its rate at which a stem may move on another day
COPIES = 3  # law, slow copy, quick copy


class StemLaw(Record):
    """What is known of a stem: how it follows CV, how far that was seen to hold."""

    hold: bool  # CV is held between samples, as a control system sends it
    dead_s: float  # dead time of CV
    lag_s: float  # first-order lag
    rise: float  # fastest closing, stroke/s
    fall: float  # fastest opening
    slow_rise: float  # fastest closing at which the law was seen to hold
    slow_fall: float
    transient: float  # doubt while it moves, share of the way still to go
    farthest: float  # longest way to go in the record
    band: float  # dead band, share of stroke
    stick: float  # how far off friction holds it at rest; 0: it does not
    gain: float
    offset: float
    centre: float  # mean position learned at
    v_offset: float  # variances of offset and gain
    v_gain: float


STEM_LAW = StemLaw.dtype()


class StemTrack(Record):
    """Remember CV for the dead time, and where law and slow copy are."""

    count: int
    t: Annotated[Floats, DELAYS]
    cv: Annotated[Floats, DELAYS]
    ahead: float  # how far the law has still to go
    was_ahead: float  # the same, or a little while ago
    lagged: Annotated[Floats, COPIES]  # after lag and rate: law, slow copy, quick copy
    held: Annotated[Floats, COPIES]  # after the dead band


STEM_TRACK = StemTrack.dtype()


@jit
def start_track(s: StemTrack, t: float, cv: float) -> None:
    """Start at rest where CV is."""
    s.count = 0
    s.t[:] = t
    s.cv[:] = cv
    s.lagged[:] = cv
    s.held[:] = cv
    s.ahead = 0.0
    s.was_ahead = 0.0


@jit
def delayed(s: StemTrack, time: float) -> float:
    """Return CV at a time, by straight lines between the samples that are kept."""
    newest = s.count % DELAYS
    value: float = s.cv[(newest + 1) % DELAYS]
    for back in range(DELAYS - 1):
        i = (newest - back) % DELAYS
        before = (i - 1) % DELAYS
        if back >= s.count or s.t[before] <= time:
            span = s.t[i] - s.t[before]
            if back >= s.count or span <= 0.0:
                value = s.cv[i]
                break
            share = min(max((time - s.t[before]) / span, 0.0), 1.0)
            value = s.cv[before] + share * (s.cv[i] - s.cv[before])
            break
    return value


@jit
def advance_track(s: StemTrack, law: StemLaw, t: float, cv: float) -> None:
    """
    Take CV at t; `position` then tells where the stem should be.

    :param s: record of `STEM_TRACK`.
    :param law: record of `STEM_LAW`.
    :param t: time, s; cv: 0..1.
    """
    dt = t - s.t[s.count % DELAYS]
    s.count += 1
    i = s.count % DELAYS
    s.t[i] = t
    s.cv[i] = cv
    if dt <= 0.0:
        return
    if law.hold:
        follow_held(s, law, t - law.dead_s, dt)
    else:  # the command in the middle of the interval stands for the interval
        follow(s, law, delayed(s, t - law.dead_s - 0.5 * min(dt, law.lag_s)), dt)
    allow_haste(s, law, min(max(cv, 0.0), 1.0))


@jit
def allow_haste(s: StemTrack, law: StemLaw, command: float) -> None:
    """
    Put the quick copy where CV is while the way there is longer than any in the record.

    Always, where the stem sticks: that looks like a lag, but a stem that slips is at CV at once.
    """
    way = abs(command - s.lagged[0])
    far = way > law.farthest
    if far:  # small motion does not show how a large one is delayed
        s.was_ahead = max(s.was_ahead, way)
    if far or law.stick > 0.0:
        s.lagged[2] = command
        s.held[2] = command


@jit
def follow_held(s: StemTrack, law: StemLaw, end: float, dt: float) -> None:
    """Follow a CV that keeps its value until the next sample, over dt up to `end`."""
    begin = end - dt
    back = 0
    while back < min(s.count, DELAYS - 1) and s.t[(s.count - back) % DELAYS] > begin:
        back += 1
    while back >= 0:
        until = end if back == 0 else min(s.t[(s.count - back + 1) % DELAYS], end)
        if until > begin:
            follow(s, law, s.cv[(s.count - back) % DELAYS], until - begin)
            begin = until
        back -= 1


@jit
def follow(s: StemTrack, law: StemLaw, cv: float, dt: float) -> None:
    """Follow one command for dt."""
    command = min(max(cv, 0.0), 1.0)
    fade = math.exp(-dt / (FADE_LAGS * law.lag_s + FADE_S))
    s.ahead = abs(command - s.lagged[0])
    s.was_ahead = max(s.ahead, s.was_ahead * fade)
    share = 1.0 - math.exp(-dt / law.lag_s) if law.lag_s > 0.0 else 1.0
    half = 0.5 * law.band
    for k in range(COPIES):
        rise = (law.slow_rise if k == 1 else law.rise) * dt
        fall = (law.slow_fall if k == 1 else law.fall) * dt
        if k == 2:
            rise *= QUICKER
            fall *= QUICKER
        move = share * (command - s.lagged[k])
        s.lagged[k] += min(max(move, -fall), rise)
        s.held[k] = min(max(s.held[k], s.lagged[k] - half), s.lagged[k] + half)


@jit
def doubt(s: StemTrack, law: StemLaw, cv: float, dt: float) -> None:
    """
    Spread the copies to both sides of the law; they come back to it with its lag.

    :param cv: by how much CV may have been another during dt.
    """
    share = 1.0 - math.exp(-dt / law.lag_s) if law.lag_s > 0.0 else 1.0
    fastest = QUICKER * max(law.rise, law.fall) * dt
    away = min(share * cv, fastest)
    s.lagged[1] = s.lagged.min() - away
    s.lagged[2] = s.lagged.max() + away
    s.held[1] = s.held.min() - away
    s.held[2] = s.held.max() + away


@jit
def position(s: StemTrack, law: StemLaw, k: int) -> float:
    """Return the position of the law (0), its slow copy (1) or its quick one (2), 0..1."""
    x: float = law.offset + law.gain * s.held[k]
    return min(max(x, 0.0), 1.0)


@jit
def outside(x: float, first: float, second: float, third: float) -> float:
    """
    Return by how much x lies outside what three models span, 0 between them.

    >>> outside(0.5, 0.3, 0.2, 0.6), round(outside(0.7, 0.2, 0.3, 0.6), 3)
    (0.0, 0.1)
    """
    low = min(first, second, third)
    high = max(first, second, third)
    return x - high if x > high else min(x - low, 0.0)


@jit
def shrink(value: float, allowance: float) -> float:
    """
    Return what of a residual lies beyond an allowance.

    >>> shrink(0.5, 0.2), shrink(-0.5, 0.2)
    (0.3, -0.3)
    """
    return math.copysign(max(abs(value) - allowance, 0.0), value)


@jit
def stem_doubt(law: StemLaw, x: float) -> float:
    """Return the standard deviation of the law's mean at x: small where it was learned."""
    away = x - law.centre
    return math.sqrt(law.v_offset + law.v_gain * away * away)


@jit
def transient_doubt(s: StemTrack, law: StemLaw) -> float:
    """Return by how much the law may be wrong because it moves, or moved a little while ago."""
    value: float = TRANSIENT * s.ahead + (law.transient - TRANSIENT) * s.was_ahead
    # small motion shows the sum of dead time, lag and play, not how a large step shares them
    return value + UNSEEN * max(s.was_ahead - law.farthest, 0.0)


@jit
def follow_record(
    law: np.ndarray, track: np.ndarray, t: np.ndarray, cv: np.ndarray, out: np.ndarray
) -> None:
    """
    Run the law and its copies over a record.

    :param out: written, shape (n, 4): all three with gain 1 and offset 0, and the way still to go.
    """
    s = track[0]
    p = law[0]
    start_track(s, t[0], cv[0])
    for i in range(t.size):
        advance_track(s, p, t[i], cv[i])
        for k in range(COPIES):
            out[i, k] = s.held[k]
        out[i, COPIES] = s.was_ahead
