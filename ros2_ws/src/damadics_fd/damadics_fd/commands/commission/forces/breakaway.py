# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The force at which a stem leaves its place: static friction, and what is none.

A stem that goes on in the direction it came from bears its static friction. One that turns back
has the hysteresis of the diaphragm on its side first: it leaves at twice the hysteresis less.
While it moves, hysteresis cannot be told from dry friction.
"""

from typing import NamedTuple

import numpy as np

from damadics_fd.commands.commission.forces.lag import Mask, plug_per_pascal
from damadics_fd.commands.commission.signals import Blocks, Signals, blocks
from damadics_fd.core.record import Floats
from damadics_fd.core.settings import Settings

SHORT = 0.05  # s
AWAY = 4.0  # deviations of the noise by which a stem has left its place
TRAVEL, BACK = 0.02, 0.001  # strokes of travel that give a direction, and what undoes them
REACH = 60.0  # s that are looked back for it
STARTS = 8  # each way, that are needed
CLEARLY = 3.0  # deviations from which a hysteresis is one
BRISTLES = 1e-4  # m; a stem gives by less, elastically, before it breaks away
LASTS = 0.18  # share of a hysteresis that is left beyond it: a diaphragm needs a longer way
LEAST = 0.1  # of the friction: less is within what the model of friction leaves open
UNSURE, MODEL = 0.15, 0.02  # deviation as a share of the hysteresis, and of the friction


class Breakaway(NamedTuple):
    """What a stem bears when it begins to move."""

    force: float  # [N] static friction; 0 where no stroke began in mid-stroke
    hysteresis: float  # [N] of the diaphragm; 0 where none is seen
    hysteresis_std: float  # [N]


def breakaway(signals: Signals, s: Settings, friction: float) -> Breakaway:
    """
    Return the friction that the stem overcomes when it begins to move.

    While it stands the force rises by itself; a line through the last tenth of a second tells
    what it was when the stem left its place. That was before it is seen beyond the noise: by then
    spring and diaphragm have given already.

    :param signals: the samples.
    :param s: settings with what commission found.
    :param friction: dry friction of the moving stem, hysteresis included [N].
    :return: what was found.
    """
    b = blocks(signals, SHORT)
    x, dp = signals.x, signals.dp
    noise = 1.4826 * float(np.median(np.abs(np.diff(x, 3)))) / np.sqrt(20.0)
    elastic = max(AWAY * noise, BRISTLES / s.stroke)
    starts = []
    whole = b.index[2:] - b.index[:-2] == 2
    for k in np.flatnonzero(b.standing[:-2] & b.moving[2:] & whole):
        first, last = np.searchsorted(signals.t, b.t[k] + np.array([-3.5, 5.5]) * SHORT)
        t, xs = signals.t[first:last], x[first:last]
        still = (t < b.t[k]) & (t >= b.t[k] - 1.5 * SHORT)
        if still.sum() < 4:
            continue
        place, sign = float(np.mean(xs[still])), float(np.sign(b.v[k + 2]))
        gone = (xs - place) * sign
        left, free = (
            int(np.argmax(_twice(gone > far) & (t >= b.t[k]))) for far in (AWAY * noise, elastic)
        )
        steady = np.polyval(np.polyfit(t - t[0], dp[first:last], 1), t - t[0])  # not its noise
        plug = float(plug_per_pascal(s, np.array([place]))[0]) * steady
        air = s.signed_area * signals.ps[first:last] * sign
        held = s.mass * s.gravity - (plug if s.flow_to == 'open' else -plug)
        held = (held - s.stiffness * s.stroke * (place + s.spring_origin)) * sign
        if left == 0:
            continue
        early = t < t[left] + SHORT
        onset = _force_at(departure(t[early], gone[early]), t, held, air, s.ps_lag)
        beyond = _force_at(float(t[free]), t, held, air, s.ps_lag) if free else float('nan')
        if np.isfinite(onset):
            starts.append((onset, beyond, came_from(b, int(k), place) * sign))
    if not starts:
        return Breakaway(0.0, 0.0, 0.0)
    onsets, beyonds, ways = np.array(starts).T
    going_on = onsets[ways > 0.0]
    static = float(np.median(going_on if len(going_on) >= STARTS else onsets))
    return Breakaway(max(static, 0.0), *hysteresis(onsets, beyonds, ways, friction))


def departure(t: Floats, gone: Floats) -> float:
    """
    Return when a stem left its place: before it is seen beyond the noise.

    :param t: [s].
    :param gone: way from the place, in the direction of the stroke.
    :return: the corner of a line that rests and then rises, which leaves least.
    """
    since = np.maximum(t - t[:, None], 0.0)[:-2]
    explained = np.maximum(since @ gone, 0.0) ** 2 / np.sum(since**2, axis=1)
    return float(t[int(np.argmax(explained))])


def _twice(away: Mask) -> Mask:
    both: Mask = away & np.append(away[1:], False)
    return both


def _force_at(at: float, t: Floats, held: Floats, air: Floats, lag: float) -> float:
    """
    Return the force at an instant, by lines through the tenth of a second before it.

    What a transmitter of first order shows lags its input by its own rate times the lag.
    """
    before = (t < at - 0.1 * SHORT) & (t >= at - 2.0 * SHORT)
    if before.sum() < 4:
        return float('nan')
    since = t[before] - at
    held_at = np.polyfit(since, held[before], 1)[1]
    air_rate, air_at = np.polyfit(since, air[before], 1)
    return float(held_at + air_at + lag * air_rate)


def came_from(b: Blocks, k: int, place: float) -> float:
    """
    Tell in which direction the stem came to a place.

    :param b: blocks of the recording.
    :param k: index of the one in which it stands there.
    :param place: position / stroke.
    :return: 1 closing, -1 opening, 0 where it went to and fro.
    """
    past = b.x[max(k - round(REACH / b.width), 0) : k] - place
    far = np.flatnonzero(np.abs(past) > TRAVEL)
    if not len(far):
        return 0.0
    way = -float(np.sign(past[far[-1]]))
    beyond = float(np.max(past[far[-1] :] * way))
    return way if beyond < BACK else 0.0


def hysteresis(onset: Floats, beyond: Floats, way: Floats, friction: float) -> tuple[float, float]:
    """
    Tell the hysteresis of the diaphragm from the forces at which strokes begin.

    A stem that turns back gives elastically as well, in the contact itself. That is over when it
    has broken away, while the diaphragm still has a way to go.

    :param onset: forces at which strokes begin [N]; NaN where not known.
    :param beyond: forces when the stem has gone further than its contact gives [N].
    :param way: 1 where a stroke goes on in the direction the stem came from, -1 where it turns
        back, 0 where that is not known.
    :param friction: dry friction of the moving stem, hysteresis included [N].
    :return: hysteresis and its deviation [N]; 0, 0 where none is seen.
    """
    found, std = _lag_behind(onset, way)
    if not (found >= LEAST * friction and found >= CLEARLY * std):
        return 0.0, 0.0
    left, left_std = _lag_behind(beyond, way)
    if left < max(LASTS * found, 2.0 * left_std):
        return 0.0, 0.0
    found = min(found, friction)
    return found, float(np.sqrt(std**2 + (UNSURE * found) ** 2 + (MODEL * friction) ** 2))


def _lag_behind(force: Floats, way: Floats) -> tuple[float, float]:
    """Return half of what strokes that turn back need less, and its deviation [N]."""
    middle, variance = [], 0.0
    for direction in (1.0, -1.0):
        forces = force[np.isfinite(force) & (way == direction)]
        if len(forces) < STARTS:
            return float('nan'), float('nan')
        median = float(np.median(forces))
        spread = 1.86 * float(np.median(np.abs(forces - median)))
        middle.append(median)
        variance += spread**2 / len(forces)
    return 0.5 * (middle[0] - middle[1]), 0.5 * float(np.sqrt(variance))
