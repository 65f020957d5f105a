# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Windows of the six signals as features of a classifier."""

import numpy as np

from damadics_evaluate.columns import Floats
from damadics_evaluate.detectors.base import CV, P1, P2, T1, F, X

WINDOW = 60  # samples
STEP = 5  # samples between two windows
TAPS = 6


class Features:
    """
    What a window shows against the fault-free hour: errors of two regressions, levels.

    X' is regressed on CV and its past, F' on position and square root of the pressure drop; of
    each error the window's mean, spread and slope are taken, of every signal its mean and spread.

    :param hour: fault-free rows.
    """

    def __init__(self, hour: Floats) -> None:
        rows = np.nan_to_num(hour)
        self._stem = _fit(_stem_design(rows), rows[:, X])
        self._flow = _fit(_flow_design(rows), rows[:, F])
        plain = self._plain(rows)
        self._mean, self._scale = plain.mean(axis=0), np.maximum(plain.std(axis=0), 1e-6)

    def of(self, samples: Floats) -> Floats:
        """
        Return the features of every window.

        :param samples: rows of a run.
        :return: one row per window; the k-th ends with sample WINDOW - 1 + k STEP.
        """
        plain = self._plain(np.nan_to_num(samples))
        return np.asarray(np.clip((plain - self._mean) / self._scale, -50.0, 50.0))

    def _plain(self, rows: Floats) -> Floats:
        stem = rows[:, X] - _stem_design(rows) @ self._stem
        flow = rows[:, F] - _flow_design(rows) @ self._flow
        signals = [rows[:, c] for c in (CV, X, P1, P2, T1, F)]
        moments = [_mean_and_spread(v) for v in (stem, flow, np.abs(stem), *signals)]
        slopes = [
            _slope(stem, rows[:, CV]),
            _slope(flow, rows[:, X]),
            _slope(rows[:, X], rows[:, CV]),
        ]
        return np.column_stack([*(part for pair in moments for part in pair), *slopes])


def _fit(design: Floats, target: Floats) -> Floats:
    return np.asarray(np.linalg.lstsq(design, target, rcond=None)[0])


def _stem_design(rows: Floats) -> Floats:
    cv = rows[:, CV]
    lags = [np.concatenate((np.full(k, cv[0]), cv[: len(cv) - k])) for k in range(TAPS)]
    return np.column_stack([np.ones(len(cv)), *lags])


def _flow_design(rows: Floats) -> Floats:
    x, drop = rows[:, X], np.sqrt(np.maximum(rows[:, P1] - rows[:, P2], 0.0))
    return np.column_stack([np.ones(len(x)), *(drop * x**k for k in range(5))])


def _windows(values: Floats) -> Floats:
    return np.asarray(np.lib.stride_tricks.sliding_window_view(values, WINDOW)[::STEP])


def _mean_and_spread(values: Floats) -> tuple[Floats, Floats]:
    if len(values) < WINDOW:
        return np.empty(0), np.empty(0)
    parts = _windows(values)
    return parts.mean(axis=1), parts.std(axis=1)


def _slope(values: Floats, on: Floats) -> Floats:
    if len(values) < WINDOW:
        return np.empty(0)
    y, x = _windows(values), _windows(on)
    x = x - x.mean(axis=1, keepdims=True)
    return np.asarray((y * x).sum(axis=1) / ((x**2).sum(axis=1) + 1e-4))
