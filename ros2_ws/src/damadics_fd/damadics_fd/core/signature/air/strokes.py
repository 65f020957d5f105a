# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Air supply: the top rate at which the chamber fills and vents, against the learned one.

A positioner far from its set-point opens fully, so the best strokes show the capacity of the
air supply whatever the valve does. With less supply pressure the chamber fills slower and vents
as before; a leak of the chamber fills it slower and vents it faster. What supply pressure a rate
means: see `supply`.
"""

import math

from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats
from damadics_fd.core.signature.air.supply import (
    P_ATM,
    elsewhere,
    forget_law,
    law_of,
    note_law,
    note_level,
)
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.state import FILL, PS, RATE, STROKES, VENT, WHEN, Air, State

ALIKE = 0.9  # [1] strokes at full opening differ by 4 % at most, those of ramps by 10 to 40 %
ELSEWHERE, ANYWHERE = 0.4, 1.0  # of one stroke of the spring: law of the flow not known, known
P_FLOOR = 5e3  # [Pa] less driving pressure than this says nothing
MIN_STROKE = 0.15  # [1] a shorter stroke may not reach its top rate; holding against P1 does not
MINUTES = 900 * 1_000_000_000  # [ns] within which a change of the supply came at once


@jit
def track_air(s: State, c: SignatureSettings, learn: bool) -> bool:
    """
    Follow the filling and venting of the chamber over the newest three blocks.

    :param s: state record.
    :param c: settings record.
    :param learn: True while what is seen may become the reference.
    :return: True if a stroke has ended and the rates are new.
    """
    ps0 = s.bp[0] * c.force_scale / c.diaphragm_area
    ps2 = s.bp[2] * c.force_scale / c.diaphragm_area
    swept = c.diaphragm_area * c.stroke  # negative where the air opens: the chamber is full at 0
    least = c.chamber_volume - min(swept, 0.0)
    air0 = (P_ATM + ps0) * (least + swept * s.bx[0])  # [J] m R T
    air2 = (P_ATM + ps2) * (least + swept * s.bx[2])
    rate = (air2 - air0) / (s.bt[2] - s.bt[0])
    ps = 0.5 * (ps0 + ps2)
    way = FILL if rate > 0.0 else VENT
    drive = c.supply_pressure - ps if way == FILL else ps
    if drive < P_FLOOR:
        return False
    y = abs(rate) / math.sqrt(drive)
    ended = False
    if way != s.air_way:
        ended = end_stroke(s, c, learn)
        s.air_way = way
        s.air_n = 0
        s.air_moved = 0.0
        s.air_top = 0.0
        s.air_second = 0.0
    s.air_n += 1
    s.air_moved += 0.5 * (s.bx[2] - s.bx[0])
    if y > s.air_top:
        s.air_second = s.air_top
        s.air_top = y
        s.air_ps = ps
    else:
        s.air_second = max(s.air_second, y)
    return ended


@jit
def end_stroke(s: State, c: SignatureSettings, learn: bool) -> bool:
    """
    Take the second best rate of a stroke into the reference or the latest strokes.

    A stroke at another chamber pressure is left out. The strokes before the latest are kept too.

    :param s: state record.
    :param c: settings record.
    :param learn: True while there is no alarm, so that what is seen may become the reference.
    :return: True if the present rates are new.
    """
    way = s.air_way
    if abs(s.air_moved) < MIN_STROKE or s.air_second <= 0.0:
        return False
    if learn:
        note_law(s, c, way, s.t)
    if s.air_learned[way] < STROKES:
        if learn:
            keep(s, way, s.air_learned[way])
            s.air_learned[way] += 1
            refer(s, c, way)
        return False
    far = ELSEWHERE if law_of(s, way) < 0.0 else ANYWHERE
    if s.air_ref_ps[way] > 0.0 and abs(s.air_ps - s.air_ref_ps[way]) > far * swing(c):
        return False  # another process pressure, another driving pressure: it does not compare
    slot = s.air_count[way] % STROKES
    for k in range(3):
        s.air_past[way, k, slot] = s.air_ring[way, k, slot]
    keep(s, way, slot)
    s.air_count[way] += 1
    if s.air_count[way] < STROKES:
        return False
    s.air_rate[way], s.air_rate_ps[way] = best_rate(s, c, way, s.air_ring[way])
    if way == FILL and learn and s.air_past[way, WHEN].min() > 0.0:
        before, ps = best_rate(s, c, way, s.air_past[way])
        ago = s.t - s.air_past[way, WHEN].min()
        note_level(s, c, before if 0.0 < ago < MINUTES else math.nan, ps)
    return True


@jit
def keep(s: State, way: int, slot: int) -> None:
    """
    Put the stroke that has ended into the ring of the latest ones.

    :param s: state record.
    :param way: FILL or VENT.
    :param slot: place in the ring.
    """
    s.air_ring[way, RATE, slot] = s.air_second
    s.air_ring[way, PS, slot] = s.air_ps
    s.air_ring[way, WHEN, slot] = s.t


@jit
def refer(s: Air, c: SignatureSettings, way: int) -> None:
    """
    Make the reference of the strokes learned so far, at the middle of their pressures.

    At the pressure of one of them, which may be the highest, too few later strokes would compare.

    :param s: state record.
    :param c: settings record.
    :param way: FILL or VENT.
    """
    n = s.air_learned[way]
    s.air_ref_ps[way] = s.air_ring[way, PS, :n].mean()
    s.air_ref[way] = 1.0
    s.air_ref[way] = best_rate(s, c, way, s.air_ring[way, :, :n])[0]


@jit
def best_rate(s: Air, c: SignatureSettings, way: int, ring: Floats) -> tuple[float, float]:
    """
    Return the second best rate of some strokes and the chamber pressure at which it was taken.

    :param s: state record.
    :param c: settings record.
    :param way: FILL or VENT.
    :param ring: rate, pressure and time of each of them, shape (3, n).
    :return: [1] of the learned rate, at its chamber pressure; [Pa].
    """
    rates = compared(s, c, way, ring)
    best = second_best(rates, len(rates))
    return rates[best] / s.air_ref[way], ring[PS, best]


@jit
def compared(s: Air, c: SignatureSettings, way: int, ring: Floats) -> Floats:
    """
    Restate the rates of some strokes at the chamber pressure of the reference.

    :param s: state record.
    :param c: settings record.
    :param way: FILL or VENT.
    :param ring: rate, pressure and time of each of them, shape (3, n).
    :return: rates.
    """
    rates: Floats = ring[RATE].copy()
    for i in range(len(rates)):
        rates[i] *= elsewhere(s, c, way, ring[PS, i], s.air_ref_ps[way])
    return rates


@jit
def swing(c: SignatureSettings) -> float:
    """
    Return the chamber pressure that moves the spring over one stroke.

    :param c: settings record.
    :return: [Pa].
    """
    return float(abs(c.force_scale / c.diaphragm_area))


@jit
def second_best(values: Floats, n: int) -> int:
    """
    Find the second largest, which neither a spike moves nor strokes too short to open fully.

    :param values: a few.
    :param n: how many of them count, at least 1.
    :return: its index; of a single value that one.
    """
    for i in range(n):
        above = 0
        for j in range(n):
            if values[j] > values[i] or (values[j] == values[i] and j < i):
                above += 1
        if above == min(1, n - 1):
            return i
    return 0


@jit
def strokes_agree(s: Air, c: SignatureSettings) -> bool:
    """
    Tell whether the latest strokes filled the chamber alike, as they do at full opening.

    One of them may have been too short to open the positioner fully.

    :param s: state record; the ring of filling rates is full.
    :param c: settings record.
    :return: False where the positioner followed slow ramps, which never open it.
    """
    rates = compared(s, c, FILL, s.air_ring[FILL])
    rates.sort()
    agree: bool = rates[1] > ALIKE * rates[-1]
    return agree


@jit
def restart_air(s: Air) -> None:
    """
    Judge the rates on strokes to come only; where the supply was before the alarm is remembered.

    :param s: state record.
    """
    for way in range(2):
        s.air_count[way] = 0
        s.air_rate[way] = math.nan
        s.air_ring[way, WHEN, :] = 0.0
        s.air_past[way, WHEN, :] = 0.0


@jit
def forget_air(s: Air) -> None:
    """
    Learn the rates anew.

    :param s: state record.
    """
    s.air_way = FILL
    s.air_n = 0
    for way in range(2):
        s.air_learned[way] = 0
        s.air_ref[way] = 0.0
        s.air_ref_ps[way] = 0.0
    forget_law(s)
    restart_air(s)
