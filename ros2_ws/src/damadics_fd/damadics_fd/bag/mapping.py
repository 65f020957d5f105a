# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Where a signal is and how its numbers become SI: `x1=POS[%] invert`, `ps=PS[bar_a]`, `p1=A*2+1`.

The same words serve `--map` of the commands and the configuration of gateways.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.errors import BagError

SIGNALS = ('cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps')
SHARES = ('cv', 'x1')  # 0 = open, 1 = closed
PRESSURES = ('p1', 'p2', 'ps')  # gauge
TIMES = ('t', 'stamp')
ATMOSPHERE = 101_325.0  # [Pa] standard, where the true one is not known
Number = TypeVar('Number', float, NDArray[np.float64])


@dataclass(frozen=True)
class Scale:
    """How numbers become SI: `value * factor + offset`."""

    factor: float = 1.0
    offset: float = 0.0

    def __call__(self, value: Number) -> Number:
        """Convert a number or a column."""
        return value * self.factor + self.offset

    def then(self, following: 'Scale') -> 'Scale':
        """
        Return the scale that does this one first, then the other.

        >>> Scale(0.01).then(Scale(-1.0, 1.0))(30.0)
        0.7
        """
        return Scale(
            self.factor * following.factor, self.offset * following.factor + following.offset
        )


@dataclass(frozen=True)
class Source:
    """
    Where a signal is.

    :param name: `/topic.field`, a column, a tag.
    :param scale: from its numbers to SI.
    :param unit: as written between brackets, '' where there is none.
    :param told: the user said how the numbers become SI, be it `*1`.
    """

    name: str
    scale: Scale = Scale()
    unit: str = ''
    told: bool = field(default=False, compare=False)


Maps = dict[str, Source]  # by signal
_SHARE = {
    '%': Scale(0.01),
    'percent': Scale(0.01),
    'mA': Scale(1 / 16, -4 / 16),  # the live zero of 4-20 mA
    'V': Scale(0.1),  # 0-10 V
    '1': Scale(),
}
_PRESSURE = {
    'Pa': 1.0,
    'hPa': 1e2,
    'mbar': 1e2,
    'kPa': 1e3,
    'bar': 1e5,
    'MPa': 1e6,
    'psi': 6894.757293168,
    'at': 98_066.5,
}
_OTHER = {
    't1': {
        'degC': Scale(),
        '°C': Scale(),
        'C': Scale(),
        'K': Scale(1.0, -273.15),
        'degF': Scale(5 / 9, -160 / 9),
        '°F': Scale(5 / 9, -160 / 9),
    },
    'flow': {
        'kg/s': Scale(),
        't/h': Scale(1 / 3.6),
        'kg/h': Scale(1 / 3600),
        'm3/h': Scale(1 / 3.6),  # as if the medium were water
        'm³/h': Scale(1 / 3.6),
        'l/min': Scale(1 / 60),
        'l/s': Scale(),
    },
    't': {
        'ns': Scale(1e-9),
        'us': Scale(1e-6),
        'ms': Scale(1e-3),
        's': Scale(),
        'min': Scale(60.0),
        'h': Scale(3600.0),
        'd': Scale(86_400.0),
    },
}
_NUMBER = r'[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?'
_SUFFIX = re.compile(
    rf'(?P<name>[^*]+?(?:\[\d+\])?)\s*(?:\[(?P<unit>[^\[\]]*[^\[\]\d][^\[\]]*)\])?\s*'
    rf'(?:\*\s*(?P<factor>{_NUMBER}))?\s*(?P<offset>[-+]\s*{_NUMBER[5:]})?\s*'
    r'(?P<invert>[\s,:]\s*invert)?'
)
_REMEDY = (
    'write SIGNAL=/topic.field or SIGNAL=COLUMN, then [UNIT], *FACTOR+OFFSET and invert as needed;'
    f' SIGNAL is one of {", ".join(SIGNALS)}; in a table also t'
)


def units_of(signal: str) -> dict[str, Scale]:
    """
    Return the units that a signal may come in, each with its scale to SI.

    >>> round(units_of('ps')['bar_a'](2.01325)), units_of('x1')['mA'](12.0)
    (100000, 0.5)
    """
    if signal in SHARES:
        return _SHARE
    if signal in PRESSURES:
        gauge = {
            name + mark: Scale(f) for name, f in _PRESSURE.items() for mark in ('', '_g', '(g)')
        }
        return gauge | {
            name + mark: Scale(factor, -ATMOSPHERE)
            for name, factor in _PRESSURE.items()
            for mark in ('_a', '(a)')
        }
    return _OTHER.get('t' if signal in TIMES else signal, {})


def unit_scale(signal: str, unit: str) -> Scale:
    """
    Return the scale of a unit.

    :raises BagError: where the signal cannot come in it.
    """
    units = units_of(signal)
    folded = {name.lower(): scale for name, scale in units.items()}
    scale = units.get(unit) or folded.get(unit.strip().lower())
    if scale is None:
        raise BagError(
            f'{signal} cannot be in [{unit}]; it may be in {", ".join(units) or "no other unit"}'
        )
    return scale


def parse_source(signal: str, text: str) -> Source:
    """
    Parse what stands behind `SIGNAL=`.

    :param signal: one of `SIGNALS`, or `t`.
    :param text: `SOURCE`, then `[UNIT]`, `*FACTOR`, `+OFFSET`, `invert`, each if needed. A factor
        and an offset apply behind the unit; `invert` is 1 - value and comes last.
    :raises BagError: where it is none of this.

    >>> parse_source('x1', 'POS[%] invert').scale(30.0)
    0.7
    >>> parse_source('t1', 'T[K]'), parse_source('cv', '/sp.data*-0.01+1').scale
    (Source(name='T', scale=Scale(factor=1.0, offset=-273.15), unit='K', told=True), \
Scale(factor=-0.01, offset=1.0))
    """
    match = _SUFFIX.fullmatch(text.strip())
    if not match:
        raise BagError(f'{signal}={text}: {_REMEDY}')
    name, factor, offset = match['name'], match['factor'], match['offset'] or ''
    if offset.startswith('-') and not (factor or match['unit']):
        name, offset = name + offset, ''  # a tag like LV-101
    scale = unit_scale(signal, match['unit']) if match['unit'] else Scale()
    scale = scale.then(Scale(float(factor or 1.0), float(offset.replace(' ', '') or 0.0)))
    if match['invert']:
        if signal not in SHARES:
            raise BagError(f'{signal}={text}: only {" and ".join(SHARES)} can be inverted')
        scale = scale.then(Scale(-1.0, 1.0))
    told = bool(match['unit'] or factor or offset or match['invert'])
    return Source(name.strip(), scale, match['unit'] or '', told)


def parse_maps(texts: Sequence[str]) -> Maps:
    """
    Parse what the user says about where signals are.

    :param texts: each `SIGNAL=SOURCE`, as `parse_source` reads it.
    :return: the source of each signal.
    :raises BagError: where a text is none of these, or two are of one signal or one source.

    >>> parse_maps(['cv=/valve/setpoint.data*0.01'])['cv'].scale.factor
    0.01
    """
    maps: Maps = {}
    for text in texts:
        signal, equals, source = text.partition('=')
        signal = signal.strip()
        if not equals or not source.strip() or signal not in (*SIGNALS, *TIMES):
            raise BagError(f'--map {text}: {_REMEDY}')
        try:
            parsed = parse_source(signal, source)
        except BagError as error:
            raise BagError(f'--map {error.reason}') from None
        for other, known in maps.items():
            if signal == other or {signal, other} == {*TIMES}:
                raise BagError(f'--map {text}: {other} has a source, {known.name!r}: give one')
            if known.name == parsed.name:
                raise BagError(
                    f'--map {text}: {other} is {known.name!r}, too: each has a source of its own'
                )
        maps[signal] = parsed
    return maps
