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

from damadics_fd.commands.commission.lag import Mask, plug_per_pascal
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
LASTS = 0.1  # share of a hysteresis that is left beyond it: a diaphragm needs a longer way
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
    what it was when the stem left its place. By the time that it is seen to have left it, the
    diaphragm has given already: of its hysteresis the force at the onset of the motion tells.

    :param signals: the samples.
    :param s: settings with what commission found.
    :param friction: dry friction of the moving stem, hysteresis included [N].
    :return: what was found.
    """
    b = blocks(signals, SHORT)
    x, dp = signals.x, signals.dp
    noise = 1.4826 * float(np.median(np.abs(np.diff(x, 3)))) / np.sqrt(20.0)
    elastic = max(AWAY * noise, BRISTLES / s.stroke)
    borne, starts = [], []
    whole = b.index[2:] - b.index[:-2] == 2
    for k in np.flatnonzero(b.standing[:-2] & b.moving[2:] & whole):
        first, last = np.searchsorted(signals.t, b.t[k] + np.array([-3.5, 5.5]) * SHORT)
        t, xs = signals.t[first:last], x[first:last]
        still = (t < b.t[k]) & (t >= b.t[k] - 1.5 * SHORT)
        if still.sum() < 4:
            continue
        place, way = float(np.mean(xs[still])), float(np.sign(b.v[k + 2]))
        gone = (xs - place) * way
        left, beyond = (
            int(np.argmax(_twice(gone > far) & (t >= b.t[k]))) for far in (AWAY * noise, elastic)
        )
        plug = float(plug_per_pascal(s, np.array([place]))[0]) * dp[first:last]
        air = s.signed_area * signals.ps[first:last] * way
        held = s.mass * s.gravity - (plug if s.flow_to == 'open' else -plug)
        held = (held - s.stiffness * s.stroke * (place + s.spring_origin)) * way
        near = t >= b.t[k] - 1.5 * SHORT
        seen, rate = _line_before(t[near], held[near], air[near], float(t[left]), s.ps_lag)
        if left == 0 or np.isnan(seen):
            continue
        borne.append((seen, rate))
        early = slice(left, int(np.searchsorted(t, b.t[k] + 2.5 * SHORT)))
        speed = np.polyfit(t[early], gone[early], 1)[0] if len(t[early]) > 2 else 0.0
        onset = float(t[left]) - min(AWAY * noise / max(float(speed), 1e-9), 2.0 * SHORT)
        at_onset, _ = _line_before(t, held, air, onset, s.ps_lag)
        past = _line_before(t, held, air, float(t[beyond]), s.ps_lag)[0] if beyond else np.nan
        starts.append((at_onset, past, came_from(b, int(k), place) * way))
    if not borne:
        return Breakaway(0.0, 0.0, 0.0)
    found = hysteresis(*np.array(starts).T, friction)
    return Breakaway(max(static_friction(*np.array(borne).T), 0.0), *found)


def _twice(away: Mask) -> Mask:
    both: Mask = away & np.append(away[1:], False)
    return both


def _line_before(
    t: Floats, held: Floats, air: Floats, at: float, lag: float
) -> tuple[float, float]:
    """
    Return the force at an instant and its rate, by lines through the tenth before it.

    What a transmitter of first order shows lags its input by its own rate times the lag.
    """
    before = (t < at - 0.1 * SHORT) & (t >= at - 2.0 * SHORT)
    if before.sum() < 4:
        return float('nan'), float('nan')
    since = t[before] - at
    (held_rate, held_at), (air_rate, air_at) = (
        np.polyfit(since, force[before], 1) for force in (held, air)
    )
    return float(held_at + air_at + lag * air_rate), float(held_rate + air_rate)


def static_friction(force: Floats, rate: Floats) -> float:
    """
    Return the force at which a stem leaves its place, however slowly it is pulled.

    The faster the force rises, the more it has risen by the time that the stem is seen to have
    left: the line of Theil and Sen through force over rate tells what it is at a rate of 0.

    :param force: of each start, as its stem was seen to leave [N].
    :param rate: at which it rose [N/s].
    :return: [N].
    """
    i, j = np.triu_indices(len(force), 1)
    apart = np.abs(rate[j] - rate[i]) > 1e-9 * np.max(np.abs(rate), initial=1e-9)
    if not apart.any():
        return float(np.median(force))
    slope = float(np.median((force[j] - force[i])[apart] / (rate[j] - rate[i])[apart]))
    return float(np.median(force - slope * rate))


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
    if _lag_behind(beyond, way)[0] < LASTS * found:
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
