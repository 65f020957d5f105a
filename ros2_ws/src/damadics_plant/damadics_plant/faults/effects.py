# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The time course of faults and what they change in the model."""

import math
from collections.abc import Sequence

import numpy as np
from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats, Record, Rows

from damadics_plant.actuator.parameters import Constants
from damadics_plant.faults.catalogue import Fault
from damadics_plant.faults.time_course import strength_at

FRICTION_GAIN = 20.0
"""Delta F_1 of the LuGre plant at f4 = 1: packing friction of about 20 % of the spring force."""


class FaultRow(Record):
    """One fault."""

    number: int
    strength: float
    start: float  # s
    end: float  # s
    development: float  # s
    now: float  # signed strength that the effects are made from


def fault_table(faults: Sequence[Fault]) -> np.ndarray:
    """
    Lay faults out for compiled code.

    :param faults: any number of faults.
    :return: structured array of shape (len(faults),).
    """
    rows = FaultRow.rows(len(faults))
    for i, fault in enumerate(faults):
        rows[i] = (
            fault.number,
            fault.strength * fault.direction,
            fault.start,
            fault.end,
            fault.development,
            math.nan,
        )
    return rows


class Effects(Record):
    """What the faults change, in the units of the model; filled by `update_effects`."""

    stop: float
    xr_offset: float
    kv_factor: float
    kv_offset: float
    flow_factor: float
    play: float
    twist: float
    leak: float
    area: float
    spring: float
    friction: float
    opening: float
    position: float
    ps_sensor: float
    feedback: float
    supply: float
    p1: float
    p2: float
    bypass: float
    flow_sensor: float
    heat: float
    number: float
    strength: float


@jit
def update_effects(
    faults: Rows[FaultRow], t: float, f: Floats, a: Constants, e: Effects, lugre: bool
) -> None:
    """
    Evaluate all faults at a time and translate them into what the model uses (table 2.1).

    :param faults: rows of `fault_table`; `now` is updated.
    :param t: time [s].
    :param f: work space of shape (20,), receives the strengths f[1]..f[19].
    :param a: constants of the actuator.
    :param e: effects, overwritten where a strength has changed or they are all 0.
    :param lugre: whether friction and spring act as in the paper's equations (8), (9).
    """
    changed = e.area == 0.0 and e.flow_factor == 0.0
    for i in range(len(faults)):
        s = strength_at(
            faults[i].strength, faults[i].start, faults[i].end, faults[i].development, t
        )
        if s != faults[i].now:
            faults[i].now = s
            changed = True
    if not changed:
        return
    f[:] = 0.0
    e.number = 0.0
    e.strength = 0.0
    for i in range(len(faults)):
        s = faults[i].now
        if s != 0.0:
            f[faults[i].number] += s
            if e.number == 0.0:
                e.number = faults[i].number
                e.strength = s
    for i in range(len(f)):
        f[i] = min(max(f[i], -1.0), 1.0)
    e.stop = a.stroke * (1 - f[1]) * (1 - 0.2 * f[2]) * (1 + 0.1 * f[3])
    e.xr_offset = 0.2 * f[2] - 0.1 * f[3]
    e.kv_factor = (1 - 0.2 * f[2]) * (1 + 0.1 * f[3])
    e.kv_offset = 0.1 * f[6]
    e.flow_factor = 1 - 0.05 * f[5]
    e.play = min(max(a.stroke * (a.play + f[4]), 0.0), a.stroke)
    e.twist = 0.5 * f[8]
    e.leak = a.leak_flow * (f[9] + f[10])
    e.area = a.area * (1 - f[10])
    if lugre:
        e.spring = 1 + f[11]
        e.friction = 1 + (FRICTION_GAIN * f[4] if f[4] > 0 else f[4])
    else:
        e.spring = 1 - f[11]
        e.friction = 1.0
    e.opening = 1 - f[12]
    e.position = 1 + 1.25 * f[13]
    e.ps_sensor = 1 - f[14]
    e.feedback = f[15] * a.stroke
    e.supply = a.supply * (1 - f[16])
    if e.supply < a.supply_minimum:
        e.supply = 0.0
    e.p2 = 1 - max(f[17], 0.0)
    e.p1 = 1 + min(f[17], 0.0)
    e.bypass = f[18]
    e.flow_sensor = 1 - f[19]
    e.heat = 200 + 100 * f[7] if f[7] > 0 else 0.0
