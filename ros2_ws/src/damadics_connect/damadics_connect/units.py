# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""From the plant's units to those of `Measurement`."""

from typing import NamedTuple

from damadics_connect.settings import Section

ATMOSPHERE = 101_325.0  # Pa
FRACTION = {'1': (1.0, 0.0), '%': (0.01, 0.0), 'mA': (1.0 / 16.0, -0.25)}
PRESSURE = {
    'Pa': (1.0, 0.0),
    'kPa': (1e3, 0.0),
    'MPa': (1e6, 0.0),
    'mbar': (100.0, 0.0),
    'bar': (1e5, 0.0),
    'bar_a': (1e5, -ATMOSPHERE),
    'psi': (6894.757293168, 0.0),
}
UNITS: dict[str, dict[str, tuple[float, float]]] = {
    'cv': FRACTION,
    'x1': FRACTION,
    'p1': PRESSURE,
    'p2': PRESSURE,
    'ps': PRESSURE,
    't1': {'degC': (1.0, 0.0), 'K': (1.0, -273.15), 'degF': (5.0 / 9.0, -160.0 / 9.0)},
    'flow': {'kg/s': (1.0, 0.0), 'kg/h': (1.0 / 3600.0, 0.0), 't/h': (1.0 / 3.6, 0.0)},
}


class Scale(NamedTuple):
    """SI value = factor * plant's value + offset."""

    factor: float = 1.0
    offset: float = 0.0

    def __call__(self, value: float) -> float:
        """Scale one value."""
        return self.factor * value + self.offset


def read_scale(section: Section, signal: str) -> Scale:
    """
    Read how a signal is scaled.

    :param section: with some of `unit`, `factor`, `offset`, `invert`.
    :param signal: field of `Measurement`.
    :return: the scale.
    """
    known = UNITS[signal]
    unit = section.text('unit')
    if unit and unit not in known:
        section.refuse('unit', f'{unit[:20]!r} is no unit of {signal}: {", ".join(known)}')
        unit = ''
    factor, offset = known[unit] if unit else (1.0, 0.0)
    own = section.number('factor', 1.0, -1e12, 1e12)
    factor, offset = factor * own, offset + factor * section.number('offset', 0.0, -1e12, 1e12)
    if section.flag('invert'):
        if known is not FRACTION:
            section.refuse('invert', 'is for cv and x1: 1 minus the value')
        factor, offset = -factor, 1.0 - offset
    if not factor:
        section.refuse('factor', 'is 0: every value would be the same')
    return Scale(factor, offset)
