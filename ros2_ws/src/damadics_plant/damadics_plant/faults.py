# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The catalogue of the benchmark's faults f1..f19, their time course and what they act on."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from damadics_fd.core.jit import jit

from damadics_plant.physics import Record

FRICTION_GAIN = 20.0
"""Delta F_1 of the LuGre plant at f4 = 1: packing friction of about 20 % of the spring force."""


@dataclass(frozen=True)
class FaultKind:
    """One entry of the catalogue (DABLib tables 3-22; the injection is that of the blocks)."""

    number: int
    name: str
    group: str
    minimum: float
    meaning: str
    injection: str
    lugre_minimum: float | None = None
    """Smallest strength on the LuGre plant where it differs from DABLib's."""

    @property
    def key(self) -> str:
        """
        Name the fault as scenarios do.

        :return: `f1` .. `f19`.
        """
        return f'f{self.number}'


_VALVE, _SERVO = 'control valve', 'servomotor'
_POSITIONER, _EXTERNAL = 'positioner', 'external'

CATALOGUE: dict[str, FaultKind] = {
    kind.key: kind
    for kind in (
        FaultKind(
            1,
            'valve clogging',
            _VALVE,
            0,
            'deposits keep the plug from closing',
            'upper stop H = H0 (1 - f)',
        ),
        FaultKind(
            2,
            'plug or seat sedimentation',
            _VALVE,
            0,
            'deposits on plug and seat: less flow, less travel',
            'H = H0 (1 - 0.2 f), X_r += 0.2 f, K_vr *= 1 - 0.2 f',
        ),
        FaultKind(
            3,
            'plug or seat erosion',
            _VALVE,
            0,
            'worn plug and seat: more flow, more travel',
            'H = H0 (1 + 0.1 f), X_r -= 0.1 f, K_vr *= 1 + 0.1 f',
        ),
        FaultKind(
            4,
            'increased valve or bushing friction',
            _VALVE,
            -1,
            'tight packing; f < 0: less than nominal friction',
            'play D_b = sat_0^X0 [X0 (0.01 + f)]; LuGre: F *= 1 + 20 f (f < 0: 1 + f)',
        ),
        FaultKind(
            5,
            'external leakage',
            _VALVE,
            0,
            'leaky bushing, cover or terminals',
            'F_v *= 1 - 0.05 f',
        ),
        FaultKind(
            6, 'internal leakage', _VALVE, 0, 'the closed valve is not tight', 'K_vr += 0.1 f'
        ),
        FaultKind(
            7,
            'medium evaporation or critical flow',
            _VALVE,
            0,
            'the liquid is too hot for its pressure',
            'T = min(300, T + 200 + 100 f) where f > 0',
        ),
        FaultKind(
            8,
            'twisted piston rod',
            _SERVO,
            0,
            'bent rod: more hysteresis as the valve opens',
            'D_b *= 1 + 0.5 f (1 - X_r); not on the LuGre plant',
        ),
        FaultKind(
            9,
            'servomotor housing or terminals tightness',
            _SERVO,
            0,
            'air leaks from the chamber',
            'leak 0.1 f 2e-6 sqrt(P_s) kg/s',
        ),
        FaultKind(
            10,
            'diaphragm perforation',
            _SERVO,
            0,
            'air leaks through the diaphragm, which loses area',
            'leak as f9, A_e *= 1 - f',
        ),
        FaultKind(
            11,
            'spring fault',
            _SERVO,
            0,
            'the spring gives way',
            'F_s *= 1 - f; LuGre: K *= 1 + f, f in -1..1',
            lugre_minimum=-1,
        ),
        FaultKind(
            12,
            'electro-pneumatic transducer fault',
            _POSITIONER,
            -1,
            'gain error of the E/P transducer',
            'output of the transducer *= 1 - f',
        ),
        FaultKind(
            13,
            'rod displacement sensor fault',
            _POSITIONER,
            -1,
            'gain error of the position sensor',
            "X' and feedback = X (1 + 1.25 f)",
        ),
        FaultKind(
            14,
            'pressure sensor fault',
            _POSITIONER,
            -1,
            'gain error of the chamber pressure sensor',
            "P_s' *= 1 - f",
        ),
        FaultKind(
            15,
            'positioner feedback fault',
            _POSITIONER,
            0,
            'loose lever of the position feedback',
            'play f X0 in the feedback',
        ),
        FaultKind(
            16,
            'positioner supply pressure drop',
            _EXTERNAL,
            0,
            'too little supply air',
            'P_z *= 1 - f, 0 below 120 kPa',
        ),
        FaultKind(
            17,
            'unexpected pressure change across the valve',
            _EXTERNAL,
            -1,
            'pump or downstream fault',
            'f > 0: P2 *= 1 - f; f < 0: P1 *= 1 + f',
        ),
        FaultKind(
            18,
            'fully or partly opened bypass valve',
            _EXTERNAL,
            0,
            'medium passes beside the valve',
            'bypass position X_b = 1 - f',
        ),
        FaultKind(
            19,
            'flow rate sensor fault',
            _EXTERNAL,
            -1,
            'gain error of the flow meter',
            "F' *= 1 - f",
        ),
    )
}


@dataclass(frozen=True)
class Fault:
    """
    One fault with its time course (block FGen).

    f(t) = direction * sat_0^strength(strength / development * (t - start)) while
    start <= t < end; with development 0 it is abrupt. `strength` is the final value;
    `direction` -1 turns it around.

    >>> Fault('f4', 1.0, start=70, development=20).at(80)
    0.5
    """

    fault: str
    strength: float = 1.0
    start: float = 0.0
    development: float = 0.0
    end: float = math.inf
    direction: int = 1

    def __post_init__(self) -> None:
        """
        Check every value against the catalogue.

        :raises ValueError: if a value is not admissible; names it and what is.
        """
        if self.fault not in CATALOGUE:
            raise ValueError(f'fault: {self.fault!r} is not one of f1..f19')
        if self.direction not in (1, -1):
            raise ValueError(f'direction: {self.direction!r} is neither 1 nor -1')
        kind = CATALOGUE[self.fault]
        low = kind.minimum if kind.lugre_minimum is None else kind.lugre_minimum
        if not low <= self.direction * self.strength <= 1:
            raise ValueError(
                f'strength: {self.direction * self.strength:g} is not within {low:g}..1, '
                f'the range of {self.fault} ({kind.name})'
            )
        if not (math.isfinite(self.start) and self.start >= 0):
            raise ValueError(f'from: {self.start!r} is not a time in s >= 0')
        if not (math.isfinite(self.development) and self.development >= 0):
            raise ValueError(f'development: {self.development!r} is not a time in s >= 0')
        if not self.end > self.start:
            raise ValueError(f'to: {self.end!r} is not later than from: {self.start!r}')

    @property
    def number(self) -> int:
        """
        Number the fault.

        :return: 1..19.
        """
        return CATALOGUE[self.fault].number

    def at(self, t: float) -> float:
        """
        Evaluate the strength at a time.

        :param t: time [s].
        :return: f(t), signed.
        """
        return float(strength_at(fault_table([self])[0], t))


FAULT_DTYPE = np.dtype(
    (
        np.record,
        [
            ('number', 'i8'),
            ('strength', 'f8'),
            ('start', 'f8'),
            ('end', 'f8'),
            ('development', 'f8'),
            ('now', 'f8'),  # signed strength that the effects are made from
        ],
    )
)


def fault_table(faults: Sequence[Fault]) -> 'np.ndarray[Any, np.dtype[Any]]':
    """
    Lay faults out for compiled code.

    :param faults: any number of faults.
    :return: structured array of shape (len(faults),).
    """
    rows = np.zeros(len(faults), FAULT_DTYPE)
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


@jit
def strength_at(fault: Record, t: float) -> float:
    """
    Evaluate the time course of a fault.

    :param fault: one row of `fault_table`.
    :param t: time [s].
    :return: signed strength, 0 outside [start, end).
    """
    if t < fault.start or t >= fault.end:
        return 0.0
    if t - fault.start >= fault.development:
        return fault.strength
    return fault.strength * (t - fault.start) / fault.development


EFFECTS_DTYPE = np.dtype(
    (
        np.record,
        [
            (name, 'f8')
            for name in (
                'stop',
                'xr_offset',
                'kv_factor',
                'kv_offset',
                'flow_factor',
                'play',
                'twist',
                'leak',
                'area',
                'spring',
                'friction',
                'opening',
                'position',
                'ps_sensor',
                'feedback',
                'supply',
                'p1',
                'p2',
                'bypass',
                'flow_sensor',
                'heat',
                'number',
                'strength',
            )
        ],
    )
)
"""What the faults change, in the units of the model; filled by `update_effects`."""


@jit
def update_effects(faults: Any, t: float, f: Any, a: Record, e: Record, lugre: bool) -> None:
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
        s = strength_at(faults[i], t)
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
