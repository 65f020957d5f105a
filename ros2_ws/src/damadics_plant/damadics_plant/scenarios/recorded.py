# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Signals from recordings: a column of a CSV file or of a topic in an MCAP bag."""

import csv
from pathlib import Path

import numpy as np
from damadics_fd.core.stamps import SECOND, is_date

from damadics_plant.scenarios.sources import Recorded

_TIME = {'t': 1.0, 't_s': 1.0, 'time': 1.0, 'time_s': 1.0, 'stamp': 1e-9}
"""Names of a time column and their unit in s."""


def read_recorded(path: Path, column: str, scale: float = 1.0, hold: bool = False) -> Recorded:
    """
    Read one signal.

    :param path: `.csv` with a header line and a column t, t_s, time, time_s [s] or stamp [ns],
        else an MCAP file or bag directory.
    :param column: header of the column; in a bag a field of /measurement, or /topic.field.
    :param scale: factor to SI.
    :param hold: hold samples instead of interpolating linearly.
    :return: the signal, from time zero for dates; samples that are NaN are left out.
    :raises ValueError: if the file cannot be read or lacks the column; names those it has.
    """
    times, values = (_csv if path.suffix == '.csv' else _bag)(path, column)
    known = np.isfinite(values) & np.isfinite(times)
    times, values = times[known], values[known] * scale
    if not len(times):
        raise ValueError(f'{path}: column {column} has no numbers')
    if np.any(np.diff(times) <= 0):
        raise ValueError(f'{path}: times do not increase')
    if is_date(int(times[0] * SECOND)):
        times = times - times[0]
    return Recorded(times, values, interpolate=not hold)


def _csv(path: Path, column: str) -> tuple[np.ndarray, np.ndarray]:
    try:
        with path.open(encoding='utf-8', newline='') as file:
            header = [name.strip() for name in next(csv.reader(file), [])]
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f'{path}: cannot be read: {error}') from error
    time = next((name for name in header if name in _TIME), None)
    if time is None:
        raise ValueError(f'{path}: has no time column ({", ".join(_TIME)})')
    if column not in header:
        raise ValueError(f'{path}: has no column {column!r}; it has {", ".join(header)}')
    table = np.genfromtxt(
        path,
        delimiter=',',
        skip_header=1,
        ndmin=2,
        usecols=(header.index(time), header.index(column)),
    )
    return table[:, 0] * _TIME[time], table[:, 1]


def _bag(path: Path, column: str) -> tuple[np.ndarray, np.ndarray]:
    from damadics_fd.bag.columns import read_columns
    from damadics_fd.bag.errors import BagError

    topic, _, field = column.rpartition('.')
    try:
        columns = read_columns(path, topic or '/measurement', [field])
    except BagError as error:
        raise ValueError(str(error)) from error
    stamp = columns['stamp' if 'stamp' in columns else 'log_time']
    return stamp * 1e-9, np.asarray(columns[field], float)
