# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Samples of a control room as mode scada takes them: scaled to 0..1, checked."""

import math
from collections.abc import Mapping

import numpy as np

from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats
from damadics_fd.core.scada.laws.actuator import F_RANGE, P_RANGE, T_RANGE, TPH_PER_KGS
from damadics_fd.core.scada.state import MonitorState

T, CV, X, PRESSURE_1, PRESSURE_2, TEMPERATURE, FLOW = range(7)  # columns
FARTHEST = 5.0  # times 4 MPa: no control valve works above
OUTSIDE = 0.25  # share of full scale a measurement may lie outside its range


def scada_samples(columns: Mapping[str, np.ndarray]) -> Floats:
    """
    Return the columns of a recording as rows t, CV, X', P1', P2', T1', F', scaled to 0..1.

    :param columns: `stamp` (ns) and cv, x1; p1, p2 (Pa), t1 (degC), flow (kg/s) where measured.
    :return: array of shape (n, 7); NaN where not measured.
    """
    n = len(columns['stamp'])
    missing = np.full(n, np.nan)
    return np.column_stack(
        [
            columns['stamp'] / 1e9,
            columns['cv'],
            columns['x1'],
            columns.get('p1', missing) / P_RANGE,
            columns.get('p2', missing) / P_RANGE,
            columns.get('t1', missing) / T_RANGE,
            columns.get('flow', missing) * (TPH_PER_KGS / F_RANGE),
        ]
    ).astype(np.float64)


@jit
def usable(sample: np.ndarray, s: MonitorState) -> bool:
    """Tell whether a sample may enter: in time order, finite, near its ranges."""
    if not math.isfinite(sample[0]) or (s.samples > 0 and sample[0] <= s.t_raw):
        return False
    for i in range(1, 3):
        if not -OUTSIDE <= sample[i] <= 1.0 + OUTSIDE:  # NaN: refused
            return False
    for i in range(3, 5):
        if not math.isnan(sample[i]) and not -OUTSIDE <= sample[i] <= FARTHEST:
            return False
    return not math.isinf(sample[5]) and not math.isinf(sample[6])
