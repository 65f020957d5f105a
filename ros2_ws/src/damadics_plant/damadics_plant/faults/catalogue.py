# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The catalogue of the benchmark's faults f1..f19."""

import math
from dataclasses import dataclass

from damadics_plant.faults.time_course import strength_at


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
        return float(
            strength_at(self.strength * self.direction, self.start, self.end, self.development, t)
        )
