# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The flow through anyone's valve: a monotone characteristic of knots times the sizing equation.

log F = c(X) + s(P1, P2, T1): c runs by straight lines through knots, s is half the log of dP rho
for a liquid (IEC 60534-2-1, choked by P1 - p_v) and of x rho_1 Y^2 for a gas or steam. What the
record does not say about c comes from a prior that any control valve obeys, so the law knows how
little it knows away from where it was learned (`flow_doubt`).
"""

import math
from typing import Annotated

from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats, Record
from damadics_fd.core.scada.laws.actuator import P_RANGE, T_RANGE
from damadics_fd.core.valve.flow import density, vapour_pressure

KNOTS = 11
STEP = 1.0 / (KNOTS - 1)
LIQUID, GAS = range(2)
LEAST_DROP = 1e-4  # of the inlet pressure: below it there is nothing to divide by
CRITICAL = 0.7  # x_T, ratio of the pressure drop at which a globe valve chokes on gas
RECOVERY = 0.81  # F_L^2 of a globe valve
END = 0.985  # of the meter's range: it shows no more
AT_END, LEAST_END = 4.0, 0.9  # deviations of its noise below that, but not below this share


class FlowLaw(Record):
    """What is known of the flow through a valve, and how well."""

    medium: int
    c: Annotated[Floats, KNOTS]  # log of the capacity at X = 0, 0.1 .. 1
    size0: float  # mean of the sizing term
    lag_s: float  # of the flow meter
    noise: float  # of F, absolute, scaled
    spread: float  # of log F beyond it
    range: float  # end of the meter's range, scaled; 0 unknown
    v: Annotated[Floats, KNOTS + 1, KNOTS + 1]  # covariance of c and of the exponent's error


FLOW_LAW = FlowLaw.dtype()


@jit
def sizing(medium: int, p1: float, p2: float, t1: float) -> float:
    """
    Return the logarithm of the sizing equation's pressure term; -inf without a forward drop.

    :param medium: LIQUID or GAS (or steam).
    :param p1: inlet pressure, share of 4 MPa; p2 outlet.
    :param t1: temperature, share of 200 degC; NaN: 20 degC.
    """
    inlet = p1 * P_RANGE
    drop = inlet - p2 * P_RANGE
    if not drop > LEAST_DROP * inlet or not inlet > 0.0:
        return -math.inf
    celsius = 20.0 if math.isnan(t1) else t1 * T_RANGE
    if medium == GAS:
        x = min(drop / inlet, CRITICAL)
        y = 1.0 - x / (3.0 * CRITICAL)
        return 0.5 * math.log(x * y * y * inlet * inlet / max(celsius + 273.15, 100.0))
    vapour = vapour_pressure(max(celsius, -70.0))
    allowed = max(RECOVERY * (inlet - 0.95 * vapour), LEAST_DROP * inlet)
    return 0.5 * math.log(min(drop, allowed) * density(celsius, inlet))


@jit
def near_end(top: float, noise: float) -> float:
    """
    Return the flow from which a meter may be at its end, where any flow shows as this one.

    >>> near_end(1.0, 0.0), near_end(1.0, 0.01), near_end(1.0, 0.1)
    (0.985, 0.96, 0.9)
    """
    return max(min(END * top, top - AT_END * noise), LEAST_END * top)


@jit
def characteristic(law: FlowLaw, x: float) -> float:
    """Return c(X) by straight lines between the knots, held beyond both ends."""
    place = min(max(x, 0.0), 1.0) / STEP
    i = min(int(place), KNOTS - 2)
    share = place - i
    value: float = (1.0 - share) * law.c[i] + share * law.c[i + 1]
    return value


@jit
def slope(law: FlowLaw, x: float) -> float:
    """Return dc/dX at X."""
    i = min(int(min(max(x, 0.0), 1.0) / STEP), KNOTS - 2)
    value: float = (law.c[i + 1] - law.c[i]) / STEP
    return value


@jit
def flow_doubt(law: FlowLaw, x: float, size: float) -> float:
    """Return the standard deviation of the law's own log F at a position and a sizing term."""
    place = min(max(x, 0.0), 1.0) / STEP
    i = min(int(place), KNOTS - 2)
    b = place - i
    a = 1.0 - b
    d = size - law.size0
    v = law.v
    total = a * a * v[i, i] + 2.0 * a * b * v[i, i + 1] + b * b * v[i + 1, i + 1]
    total += 2.0 * d * (a * v[i, KNOTS] + b * v[i + 1, KNOTS]) + d * d * v[KNOTS, KNOTS]
    return math.sqrt(max(total, 0.0))
