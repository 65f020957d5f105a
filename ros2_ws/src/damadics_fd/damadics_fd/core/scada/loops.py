# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The monitor's loops over rows of samples: collect, learn from them, judge; compiled."""

import numpy as np

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.judging.predict import predict
from damadics_fd.core.scada.judging.residuals import residuals
from damadics_fd.core.scada.samples import usable
from damadics_fd.core.scada.step import accepts, step

TRACE = np.dtype(
    (
        np.record,
        [
            ('t', np.float64),
            ('r1', np.float64),
            ('r2', np.float64),
            ('ratio', np.float64),
            ('worst', np.int64),
            ('alarm', np.bool_),
        ],
    )
)


@jit
def run_column(
    state: np.ndarray,
    settings: np.ndarray,
    reference: np.ndarray,
    samples: np.ndarray,
    trace: np.ndarray,
) -> int:
    """
    Take rows of samples of a valve that was learned.

    :param state: array of length 1, as are settings and reference.
    :param samples: rows as `scada_samples` returns them.
    :param trace: rows of `TRACE`, written.
    :return: rows written.
    """
    s = state[0]
    count = 0
    for i in range(samples.shape[0]):
        row = samples[i]
        if not usable(row, s) or not accepts(s, settings[0], row[0]):
            continue
        step(s, settings[0], reference[0], row[0], row[1], row[2], row[3], row[4], row[5], row[6])
        out = trace[count]
        out.t = s.t
        out.r1 = s.residual[0]
        out.r2 = s.residual[1]
        out.ratio = s.ratio
        out.worst = s.worst
        out.alarm = s.alarm
        count += 1
    return count


@jit
def collect(
    state: np.ndarray,
    settings: np.ndarray,
    samples: np.ndarray,
    start: int,
    buffer: np.ndarray,
    filled: int,
    until: float,
) -> tuple[int, int]:
    """
    Keep the samples of a valve that is being learned.

    :param samples: rows; start: the first of them to take.
    :param buffer: rows, written from `filled` on.
    :param until: age of the last sample to take, s.
    :return: the next sample to take, rows filled.
    """
    s = state[0]
    i = start
    while i < samples.shape[0] and filled < buffer.shape[0]:
        row = samples[i]
        i += 1
        if not usable(row, s) or not accepts(s, settings[0], row[0]):
            continue
        if s.samples == 0:
            s.t_first = row[0]
        s.samples += 1
        s.t = row[0]
        buffer[filled] = row
        filled += 1
        if row[0] - s.t_first >= until:
            break
    return i, filled


@jit
def bring_up(
    state: np.ndarray, settings: np.ndarray, reference: np.ndarray, samples: np.ndarray
) -> None:
    """Bring the models to the end of the record that was learned from."""
    s = state[0]
    for i in range(samples.shape[0]):
        r = samples[i]
        predict(s, settings[0], reference[0], r[0], r[1], r[2], r[3], r[4], r[5], r[6])
        residuals(s, reference[0], r[2], r[3], r[4], r[5], r[6])
        s.t_raw = r[0]
