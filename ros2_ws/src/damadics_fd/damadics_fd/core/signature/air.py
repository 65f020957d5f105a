# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Air supply: the top rate at which the chamber fills and vents, against the learned one.

A positioner far from its set-point opens fully, so the best strokes show the capacity of the
air supply whatever the valve does. With less supply pressure the chamber fills slower and vents
as before; a leak of the chamber fills it slower and vents it faster.
"""

import math

import numpy as np

from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.state import FILL, STROKES, VENT, Air, State

P_ATM = 101325.0  # [Pa]
ALIKE = 0.9  # [1] strokes at full opening differ by 4 % at most, those of ramps by 10 to 40 %
ELSEWHERE = 0.4  # of the pressure of one stroke of the spring
P_FLOOR = 5e3  # [Pa] less driving pressure than this says nothing
CHOKED = 0.3  # ratio of pressures below which the flow is sonic, ISO 6358
SONIC = 0.85  # weight of the second of both laws of the flow
AS_BEFORE = 0.05  # change of the top venting rate that is none
MIN_STROKE = 0.15  # [1] a shorter stroke may not reach its top rate; holding against P1 does not


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
def end_stroke(s: Air, c: SignatureSettings, learn: bool) -> bool:
    """
    Take the second best rate of a stroke into the reference or the latest strokes.

    Both are the second best of the strokes; a stroke at another chamber pressure is left out.

    :param s: state record.
    :param c: settings record.
    :param learn: True while what is seen may become the reference.
    :return: True if the present rates are new.
    """
    way = s.air_way
    if abs(s.air_moved) < MIN_STROKE:
        return False
    if s.air_learned[way] < STROKES:
        if learn:
            s.air_ring[way, s.air_learned[way]] = s.air_second
            s.air_ring_ps[way, s.air_learned[way]] = s.air_ps
            s.air_learned[way] += 1
            refer(s, c, way)
        return False
    if s.air_ref_ps[way] > 0.0 and abs(s.air_ps - s.air_ref_ps[way]) > ELSEWHERE * swing(c):
        return False  # another process pressure, another driving pressure: it does not compare
    slot = s.air_count[way] % STROKES
    s.air_ring[way, slot] = s.air_second * elsewhere(c, way, s.air_ps, s.air_ref_ps[way])
    s.air_ring_ps[way, slot] = s.air_ps
    s.air_count[way] += 1
    if s.air_count[way] < STROKES:
        return False
    usual = second_best(s.air_ring[way], STROKES)
    s.air_rate[way] = s.air_ring[way, usual] / s.air_ref[way]
    s.air_rate_ps[way] = s.air_ring_ps[way, usual]
    return True


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
    middle = s.air_ring_ps[way, :n].mean()
    rates = np.empty(n)
    for i in range(n):
        rates[i] = s.air_ring[way, i] * elsewhere(c, way, s.air_ring_ps[way, i], middle)
    s.air_ref[way] = rates[second_best(rates, n)]
    s.air_ref_ps[way] = middle


@jit
def elsewhere(c: SignatureSettings, way: int, ps: float, at: float) -> float:
    """
    Restate a rate per root of the driving pressure at another chamber pressure.

    A sonic flow does not follow that root: half-way between the two laws, see `supply_change`.

    :param c: settings record.
    :param way: FILL or VENT.
    :param ps: [Pa] chamber pressure at which the rate was taken.
    :param at: [Pa] chamber pressure to compare at; 0 where it is not known.
    :return: factor on the rate.
    """
    if at <= 0.0:
        return 1.0
    supply = P_ATM + c.supply_pressure
    if way == FILL:
        here, there = flow_square(supply, P_ATM + ps), flow_square(supply, P_ATM + at)
        drive_here, drive_there = c.supply_pressure - ps, c.supply_pressure - at
    else:
        here, there = flow_square(P_ATM + ps, P_ATM), flow_square(P_ATM + at, P_ATM)
        drive_here, drive_there = ps, at
    factor: float = (there * drive_here / (here * drive_there)) ** 0.25
    return factor


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
def supply_lost(s: Air, c: SignatureSettings) -> bool:
    """
    Tell whether the chamber fills slower than learned while it vents as before.

    :param s: state record.
    :param c: settings record.
    :return: True if it does, by a loss of pressure larger than the settings allow.
    """
    enough = s.air_count[FILL] >= STROKES and s.air_count[VENT] >= STROKES
    if not enough or abs(s.air_rate[VENT] - 1.0) >= AS_BEFORE:
        return False
    lost: bool = supply_change(s, c) < -c.material_supply * c.supply_pressure
    return lost


@jit
def strokes_agree(s: Air) -> bool:
    """
    Tell whether the latest strokes filled the chamber alike, as they do at full opening.

    :param s: state record; the ring of filling rates is full.
    :return: False where the positioner followed slow ramps, which never open it.
    """
    low = high = s.air_ring[FILL, 0]
    for i in range(1, STROKES):
        low = min(low, s.air_ring[FILL, i])
        high = max(high, s.air_ring[FILL, i])
    agree: bool = low > ALIKE * high
    return agree


@jit
def supply_change(s: Air, c: SignatureSettings) -> float:
    """
    Estimate the change of the supply pressure from the filling rate.

    Where the passages of a positioner are sonic the flow follows the supply alone, where they
    are not the root of the pressure difference; ISO 6358 lies between, and which of them are is
    not known: a mean of both laws.

    :param s: state record.
    :param c: settings record.
    :return: [Pa], negative for a loss.
    """
    change: float = (1.0 - SONIC) * by_root(s, c) + SONIC * by_sonic(s, c)
    return change


@jit
def by_root(s: Air, c: SignatureSettings) -> float:
    """
    Estimate the change of the supply pressure, the flow being as the root of the difference.

    :param s: state record.
    :param c: settings record.
    :return: [Pa], negative for a loss.
    """
    ps = s.air_rate_ps[FILL]
    rate = s.air_rate[FILL] / elsewhere(c, FILL, ps, s.air_ref_ps[FILL])  # as it was taken
    change: float = (rate * rate - 1.0) * (c.supply_pressure - ps)
    return change


@jit
def by_sonic(s: Air, c: SignatureSettings) -> float:
    """
    Estimate the change of the supply pressure, the flow being that of ISO 6358.

    :param s: state record.
    :param c: settings record.
    :return: [Pa], negative for a loss.
    """
    ps = s.air_rate_ps[FILL]
    rate = s.air_rate[FILL] * elsewhere(c, FILL, ps, s.air_ref_ps[FILL])
    whole = P_ATM + c.supply_pressure
    change: float = supply_of(rate * rate * flow_square(whole, P_ATM + ps), P_ATM + ps) - whole
    return change


@jit
def flow_square(up: float, down: float) -> float:
    """
    Return the square of the mass flow per conductance after ISO 6358.

    :param up: [Pa] absolute pressure before the restriction.
    :param down: [Pa] behind it.
    :return: [Pa2].
    """
    beyond = max(down - CHOKED * up, 0.0) / (1.0 - CHOKED)
    return up * up - beyond * beyond


@jit
def supply_of(square: float, down: float) -> float:
    """
    Invert `flow_square`.

    :param square: [Pa2] of the flow.
    :param down: [Pa] absolute pressure behind the restriction.
    :return: [Pa] absolute pressure before it.
    """
    up = math.sqrt(square)
    if down <= CHOKED * up:
        return up
    room = (1.0 - CHOKED) ** 2
    a = room - CHOKED * CHOKED
    b = CHOKED * down
    return (math.sqrt(b * b + a * (down * down + square * room)) - b) / a


@jit
def restart_air(s: Air) -> None:
    """
    Judge the rates on strokes to come only.

    :param s: state record.
    """
    for way in range(2):
        s.air_count[way] = 0
        s.air_rate[way] = math.nan


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
    restart_air(s)
