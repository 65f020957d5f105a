# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Hotelling's T2 of the one-step errors of a learned NARX model of X' and F'."""

import numpy as np

from damadics_evaluate.columns import Floats
from damadics_evaluate.detectors.base import CV, P1, P2, Detector, F, X

RIDGE = 1e-6  # of the regressors, which have unit variance


class NarxHotelling(Detector):
    """
    A polynomial NARX model (second degree) predicts X' and F' from what came before.

    Regressors: X'(k-1), X'(k-2), F'(k-1), CV(k..k-3), P1'(k), P2'(k), their squares and products
    in pairs (Leontaritis and Billings 1985); the statistic is Hotelling's T2 of the errors,
    averaged over a window.

    :param window: samples.
    """

    name, title = 'narx', 'Hotelling on a learned NARX'

    def __init__(self, window: int = 10) -> None:
        self.window = window

    def fit(self, hour: Floats) -> None:
        """Learn the weights by ridge regression and the covariance of the errors."""
        rows = np.nan_to_num(self.learning_rows(hour))
        plain = _regressors(rows)
        self._mean, self._scale = plain.mean(axis=0), np.maximum(plain.std(axis=0), 1e-6)
        design = self._design(plain)
        normal = design.T @ design + RIDGE * len(design) * np.eye(design.shape[1])
        self._weights = np.linalg.solve(normal, design.T @ rows[:, (X, F)])
        error = rows[:, (X, F)] - design @ self._weights
        self._offset = error.mean(axis=0)
        covariance = np.cov(error, rowvar=False) + 1e-12 * np.eye(2)
        self._precision = np.linalg.inv(covariance)

    def _design(self, plain: Floats) -> Floats:
        z = np.clip((plain - self._mean) / self._scale, -6.0, 6.0)
        i, j = np.triu_indices(z.shape[1])
        return np.column_stack([np.ones(len(z)), z, z[:, i] * z[:, j]])

    def statistic(self, samples: Floats) -> Floats:
        """Return the windowed mean of T2, 0 before the tests are on."""
        rows = np.nan_to_num(samples)
        error = rows[:, (X, F)] - self._design(_regressors(rows)) @ self._weights - self._offset
        t2 = np.einsum('ij,jk,ik->i', error, self._precision, error)
        total = np.concatenate(([0.0], np.cumsum(t2)))
        n = np.arange(1, len(t2) + 1)
        first = np.maximum(n - self.window, 0)
        return np.where(self.active(samples), (total[n] - total[first]) / (n - first), 0.0)


def _regressors(rows: Floats) -> Floats:
    def lagged(column: int, k: int) -> Floats:
        values = rows[:, column]
        return values if not k else np.concatenate((np.full(k, values[0]), values[:-k]))

    past = [lagged(X, 1), lagged(X, 2), lagged(F, 1)]
    return np.column_stack([*past, *(lagged(CV, k) for k in range(4)), rows[:, P1], rows[:, P2]])
