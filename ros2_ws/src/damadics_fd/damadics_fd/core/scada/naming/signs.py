# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Say in a person's units what the signals show of a fault."""

import math

import numpy as np

from damadics_fd.core.record import Floats
from damadics_fd.core.scada.judging.cusum import P1, P2, PROCESS, R1, R2, T1, TESTS
from damadics_fd.core.scada.laws.actuator import P_RANGE, T_RANGE
from damadics_fd.core.scada.state import LAW, MonitorState, Reference

LATEST = 60  # samples that tell how large it is
KILO = 1e-3
T1_TEST = [test.residual for test in TESTS].index(T1)


def signs(state: MonitorState, ref: Reference, window: np.ndarray) -> str:
    """
    Say what is off and by how much, of the signals that showed the fault.

    :param state: record of the monitor.
    :param ref: record of `REFERENCE`.
    :param window: rows of `HISTORY` since the onset, while the fault shows.
    :return: such as 'stem 3.2 % of the stroke too far closed, flow 25 % too low'; '' for nothing.
    """
    shown = np.isfinite(np.asarray(state.t_shown, np.float64))
    part = window[-LATEST:]
    told = []
    if shown[R1] and (off := 100.0 * _largest(part['r1'])):
        told.append(
            f'stem {abs(off):.2g} % of the stroke too far {"closed" if off > 0 else "open"}'
        )
    if shown[R2] and (share := _flow_share(ref, part)):
        told.append(f'flow {abs(share):.2g} % too {"high" if share > 0 else "low"}')
    if shown[T1]:
        warmer = T_RANGE * (_middle(part['t1']) - float(ref.mu[T1_TEST]))
        told.append(f'T1 {warmer:+.3g} degC')
    if shown[PROCESS] or shown[P1] or shown[P2]:
        for i, name in enumerate(('p1', 'p2')):
            before = float(state.level_before[i])
            change = KILO * P_RANGE * (_middle(part[name]) - before)
            if math.isfinite(change):
                told.append(f'{name.upper()} {change:+.2g} kPa')
    return ', '.join(told)


def _middle(values: Floats) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else math.nan


def _largest(values: Floats) -> float:
    """Return the value that a tenth of the values exceed, with its sign."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return 0.0
    low, high = (float(np.quantile(finite, q)) for q in (0.1, 0.9))
    return high if abs(high) >= abs(low) else low


def _flow_share(ref: Reference, part: np.ndarray) -> float:
    """Return by how much the flow is off, percent of what position and pressures give."""
    expected = part['f'] if ref.flow_kind == LAW else ref.g0 + ref.g1 * part['f']
    good = np.isfinite(expected + part['flow']) & ~part['masked'] & (expected > 0.0)
    if not good.any():
        return 0.0
    return 100.0 * (_middle(part['flow'][good] / expected[good]) - 1.0)
