# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The seven signals of a control valve: names, units, spans; one sample of them."""

import math
from typing import NamedTuple


class Signal(NamedTuple):
    """Describe one signal, a field of damadics_msgs/Measurement."""

    name: str
    unit: str
    text: str
    span: float  # full scale of the benchmark's transmitter, from 0, in the unit


TABLE = (
    Signal('cv', '1', 'control value: 0 open, 1 closed', 1.0),
    Signal('x1', '1', 'stem position / stroke: 0 open, 1 closed', 1.0),
    Signal('p1', 'Pa', 'pressure before the valve', 4.0e6),
    Signal('p2', 'Pa', 'pressure behind the valve', 4.0e6),
    Signal('t1', 'degC', 'temperature of the medium before the valve', 200.0),
    Signal('flow', 'kg/s', 'flow through the valve', 40.0 / 3.6),
    Signal('ps', 'Pa', 'pressure in the chamber of the servomotor, gauge', 6.0e5),
)
SIGNALS = tuple(signal.name for signal in TABLE)
COLUMNS = ('stamp', *SIGNALS)  # of a recording in memory


class Sample(NamedTuple):
    """One measurement; a signal that is not measured is NaN."""

    stamp: int  # sampling instant [ns]
    cv: float
    x1: float
    p1: float = math.nan
    p2: float = math.nan
    t1: float = math.nan
    flow: float = math.nan
    ps: float = math.nan
