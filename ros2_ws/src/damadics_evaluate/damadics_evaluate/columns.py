# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Two forms of one record: columns in SI by name, and rows scaled to the benchmark's ranges.

Columns are what recordings hold and own detectors get: `stamp` (int64, ns), `cv` and `x1` (0 open
.. 1 closed), `p1`, `p2` (Pa), `t1` (degC), `flow` (kg/s); NaN where not measured. Rows are
t (s), CV, X', P1', P2', T1', F' as the benchmark defines them, one array for the baselines.
"""

from collections.abc import Mapping
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Columns: TypeAlias = dict[str, np.ndarray]

SIGNALS = ('cv', 'x1', 'p1', 'p2', 't1', 'flow')
NANOSECONDS = 1e9
SCALE = {'cv': 1.0, 'x1': 1.0, 'p1': 4e6, 'p2': 4e6, 't1': 200.0, 'flow': 40.0 / 3.6}
"""Full scale of every signal in SI (benchmark definition: 4 MPa, 200 degC, 40 t/h)."""


def rows_of(columns: Mapping[str, np.ndarray]) -> Floats:
    """
    Return columns as scaled rows.

    :param columns: `stamp` and the signals that are measured.
    :return: shape (n, 7); NaN where not measured.
    """
    n = len(columns['stamp'])
    rows = np.full((n, 1 + len(SIGNALS)), np.nan)
    rows[:, 0] = columns['stamp'] / NANOSECONDS
    for i, name in enumerate(SIGNALS, 1):
        if name in columns:
            rows[:, i] = columns[name] / SCALE[name]
    return rows


def columns_of(rows: Floats) -> Columns:
    """
    Return scaled rows as columns.

    :param rows: shape (n, 7).
    :return: `stamp` and all signals.

    >>> columns_of(np.array([[1.0, 0.5, 0.4, 0.5, 0.25, 0.1, 0.5]]))['p1']
    array([2000000.])
    """
    columns: Columns = {'stamp': np.round(rows[:, 0] * NANOSECONDS).astype(np.int64)}
    for i, name in enumerate(SIGNALS, 1):
        columns[name] = rows[:, i] * SCALE[name]
    return columns


def cut(columns: Mapping[str, np.ndarray], start: float, end: float) -> Columns:
    """
    Return the samples of a stretch.

    :param columns: any.
    :param start: first time, s.
    :param end: last time, s; included.
    :return: the same columns, fewer samples.
    """
    stamp = columns['stamp']
    kept = (stamp >= start * NANOSECONDS) & (stamp <= end * NANOSECONDS)
    return {name: values[kept] for name, values in columns.items()}


def stretches(columns: Mapping[str, np.ndarray], gap: float) -> list[slice]:
    """
    Return the parts of a record between which nothing was recorded.

    :param columns: with `stamp`.
    :param gap: longest time between two samples of one part, s.
    :return: slices in order of time.
    """
    stamp = columns['stamp']
    if not len(stamp):
        return []
    breaks = np.flatnonzero(np.diff(stamp) > gap * NANOSECONDS) + 1
    edges = [0, *breaks.tolist(), len(stamp)]
    return [slice(a, b) for a, b in zip(edges[:-1], edges[1:], strict=True)]
