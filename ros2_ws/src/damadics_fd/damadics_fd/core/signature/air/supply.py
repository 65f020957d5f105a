# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Supply pressure from the rate at which a chamber fills, by the law of the flow.

Where the passages of a positioner are sonic the flow follows the supply alone, where they are
not the root of the pressure difference; ISO 6358 lies between. Which of them a positioner
has, its own strokes tell: taken at different chamber pressures, a minute apart, their rates per
root of the driving pressure are the same by the second law and differ as known by the first.
"""

import math

from damadics_fd.core.jit import jit
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.state import FILL, STROKES, VENT, Air

P_ATM = 101325.0  # [Pa]
CHOKED = 0.3  # ratio of pressures below which the flow is sonic, ISO 6358
SONIC, HALF = 0.85, 0.5  # where the law is not known: weight of ISO 6358, and its share in a rate
APART = 120 * 1_000_000_000  # [ns] strokes further apart may have another supply
NEAR = 0.07  # [1] by which the laws differ: else a loss of supply could pass for one of them
STRAY = 0.02  # [1] beyond what either law explains: no full opening, or another supply
PAIRS = 0  # where pairs of strokes are counted
LEAST_PAIRS, FULL_PAIRS = 6, 60.0  # from when they tell the law, and are enough
LAW_STD = 0.15  # standard deviation of the share from which the law is known
SLOW = 1.7  # of a loss at once: a slow one, as by a supply that swings, is larger
AS_BEFORE = 0.05  # change of the top venting rate that is none


@jit
def note_law(s: Air, c: SignatureSettings, way: int, t: int) -> None:
    """
    Compare the stroke that has ended with the one before it: what the law of the flow is.

    :param s: state record: sums of the law.
    :param c: settings record.
    :param way: FILL or VENT.
    :param t: [ns] its time.
    """
    g, y = iso_over_root(c, way, s.air_ps), math.log(s.air_second)
    gap = t - s.air_last_t[way]
    if s.air_last_t[way] > 0 and 0 < gap < APART and s.air_law[way, PAIRS] < FULL_PAIRS:
        dg, dy = g - s.air_last[way, 0], y - s.air_last[way, 1]
        if abs(dg) < NEAR and min(0.0, dg) - STRAY < dy < max(0.0, dg) + STRAY:
            s.air_law[way, PAIRS] += 1.0
            s.air_law[way, 1] += dg * dg
            s.air_law[way, 2] += dg * dy
            s.air_law[way, 3] += dy * dy
    s.air_last_t[way] = t
    s.air_last[way, 0] = g
    s.air_last[way, 1] = y


@jit
def forget_law(s: Air) -> None:
    """
    Learn the law of the flow anew, and forget where the supply was.

    :param s: state record.
    """
    for way in range(2):
        s.air_last_t[way] = 0
        s.air_law[way, :] = 0.0
    s.air_above = 0.0


@jit
def law_of(s: Air, way: int) -> float:
    """
    Return how much of the flow follows ISO 6358 and not the root of the pressure difference.

    :param s: state record.
    :param way: FILL or VENT.
    :return: share 0..1; negative where too few strokes have told.
    """
    n, gg, gy, yy = s.air_law[way, 0], s.air_law[way, 1], s.air_law[way, 2], s.air_law[way, 3]
    if n < LEAST_PAIRS or gg <= 0.0:
        return -1.0
    share = gy / gg
    if max(yy - share * gy, 0.0) > LAW_STD * LAW_STD * n * gg:
        return -1.0
    return float(min(max(share, 0.0), 1.0))


@jit
def iso_over_root(c: SignatureSettings, way: int, ps: float) -> float:
    """
    Return the logarithm of the flow by ISO 6358 over that by the root, but for a constant.

    :param c: settings record.
    :param way: FILL or VENT.
    :param ps: [Pa] chamber pressure.
    :return: [1].
    """
    if way == FILL:
        square = flow_square(P_ATM + c.supply_pressure, P_ATM + ps)
        return 0.5 * math.log(square / (c.supply_pressure - ps))
    return 0.5 * math.log(flow_square(P_ATM + ps, P_ATM) / ps)


@jit
def elsewhere(s: Air, c: SignatureSettings, way: int, ps: float, at: float) -> float:
    """
    Restate a rate per root of the driving pressure at another chamber pressure.

    :param s: state record.
    :param c: settings record.
    :param way: FILL or VENT.
    :param ps: [Pa] chamber pressure at which the rate was taken.
    :param at: [Pa] chamber pressure to compare at; 0 where it is not known.
    :return: factor on the rate.
    """
    if at <= 0.0:
        return 1.0
    law = law_of(s, way)
    share = law if law >= 0.0 else HALF
    return math.exp(share * (iso_over_root(c, way, at) - iso_over_root(c, way, ps)))


@jit
def change_of(s: Air, c: SignatureSettings, rate: float, ps: float) -> float:
    """
    Return the change of the supply pressure that a filling rate shows.

    :param s: state record.
    :param c: settings record.
    :param rate: [1] of the learned one, both at its chamber pressure.
    :param ps: [Pa] chamber pressure at which it was taken.
    :return: [Pa], negative for a loss.
    """
    law = law_of(s, FILL)
    sonic = law if law >= 0.0 else SONIC
    change: float = (1.0 - sonic) * by_root(s, c, rate, ps) + sonic * by_sonic(s, c, rate, ps)
    return change


@jit
def by_root(s: Air, c: SignatureSettings, rate: float, ps: float) -> float:
    """
    Estimate the change of the supply pressure, the flow being as the root of the difference.

    :param s: state record.
    :param c: settings record.
    :param rate: [1] of the learned one.
    :param ps: [Pa] chamber pressure at which it was taken.
    :return: [Pa], negative for a loss.
    """
    taken = rate / elsewhere(s, c, FILL, ps, s.air_ref_ps[FILL])
    change: float = (taken * taken - 1.0) * (c.supply_pressure - ps)
    return change


@jit
def by_sonic(s: Air, c: SignatureSettings, rate: float, ps: float) -> float:
    """
    Estimate the change of the supply pressure, the flow being that of ISO 6358.

    :param s: state record.
    :param c: settings record.
    :param rate: [1] of the learned one.
    :param ps: [Pa] chamber pressure at which it was taken.
    :return: [Pa], negative for a loss.
    """
    at = s.air_ref_ps[FILL]
    if at > 0.0:
        whole_law = iso_over_root(c, FILL, at) - iso_over_root(c, FILL, ps)
        rate *= math.exp(whole_law) / elsewhere(s, c, FILL, ps, at)
    whole = P_ATM + c.supply_pressure
    change: float = supply_of(rate * rate * flow_square(whole, P_ATM + ps), P_ATM + ps) - whole
    return change


@jit
def supply_change(s: Air, c: SignatureSettings) -> float:
    """
    Return the change of the supply pressure that the latest strokes show.

    :param s: state record.
    :param c: settings record.
    :return: [Pa], negative for a loss.
    """
    return change_of(s, c, s.air_rate[FILL], s.air_rate_ps[FILL])


@jit
def note_level(s: Air, c: SignatureSettings, rate: float, ps: float) -> None:
    """
    Remember how the supply was before the latest strokes: from there a loss at once counts.

    :param s: state record.
    :param c: settings record.
    :param rate: [1] of the learned filling rate; NaN where the strokes before are long ago.
    :param ps: [Pa] chamber pressure at which it was taken.
    """
    s.air_above = 0.0
    if not math.isnan(rate):
        slow = (SLOW - 1.0) * c.material_supply * c.supply_pressure
        s.air_above = max(0.0, change_of(s, c, rate, ps) + slow)


@jit
def supply_lost(s: Air, c: SignatureSettings) -> bool:
    """
    Tell whether the chamber fills slower than learned while it vents as before.

    A supply may swing by a tenth, learned at its crest: so a loss counts from where the supply
    was some minutes ago, and must be larger where it came slowly.

    :param s: state record.
    :param c: settings record.
    :return: True if it does, by a loss of pressure larger than the settings allow.
    """
    enough = s.air_count[FILL] >= STROKES and s.air_count[VENT] >= STROKES
    if not enough or abs(s.air_rate[VENT] - 1.0) >= AS_BEFORE:
        return False
    least = SLOW * c.material_supply * c.supply_pressure
    lost: bool = supply_change(s, c) < s.air_above - least
    return lost


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
