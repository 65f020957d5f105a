# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Multivariate detectors on lagged signals: PCA with T2 and Q, isolation forest."""

from abc import abstractmethod

import numpy as np

from damadics_evaluate.columns import Floats
from damadics_evaluate.detectors.base import CV, P1, P2, T1, Detector, F, X, require

SIGNALS = (CV, X, P1, P2, T1, F)
LAGS = 3


def features(samples: Floats) -> Floats:
    """Return the six signals and their last two samples, one row per sample."""
    signals = np.nan_to_num(samples[:, SIGNALS])
    lagged = [
        np.vstack((np.repeat(signals[:1], i, axis=0), signals[: len(signals) - i]))
        for i in range(LAGS)
    ]
    return np.hstack(lagged)


class Scaled(Detector):
    """Features scaled to zero mean and unit variance of the fault-free hour."""

    def fit(self, hour: Floats) -> None:
        """Learn scale and model."""
        rows = features(self.learning_rows(hour))
        self._mean, self._scale = rows.mean(axis=0), np.maximum(rows.std(axis=0), 1e-9)
        self._learn((rows - self._mean) / self._scale)

    def statistic(self, samples: Floats) -> Floats:
        """Return the anomaly score, 0 before the tests are on."""
        on = self.active(samples)
        out = np.zeros(len(samples))
        out[on] = self._score((features(samples)[on] - self._mean) / self._scale)
        return out

    @abstractmethod
    def _learn(self, rows: Floats) -> None:
        """Learn the model from scaled rows."""

    @abstractmethod
    def _score(self, rows: Floats) -> Floats:
        """Return the score of scaled rows."""


class PrincipalComponents(Scaled):
    """Hotelling's T2 in the kept subspace and Q outside it, each over its 99.9 % quantile."""

    name, title = 'pca', 'PCA T2 and Q (scikit-learn)'

    def __init__(self, explained: float = 0.95) -> None:
        self.explained = explained

    def _learn(self, rows: Floats) -> None:
        decomposition = require('sklearn.decomposition', self.name)
        self._pca = decomposition.PCA(n_components=self.explained, svd_solver='full').fit(rows)
        self._unit = np.ones(2)
        self._unit = np.quantile(self._both(rows), 0.999, axis=0)

    def _both(self, rows: Floats) -> Floats:
        scores = self._pca.transform(rows)
        t2 = (scores**2 / self._pca.explained_variance_).sum(axis=1)
        q = ((rows - self._pca.inverse_transform(scores)) ** 2).sum(axis=1)
        return np.column_stack((t2, q)) / self._unit

    def _score(self, rows: Floats) -> Floats:
        return np.asarray(self._both(rows).max(axis=1))


class IsolationForest(Scaled):
    """Isolation forest; the statistic is minus its score."""

    name, title = 'iforest', 'isolation forest (scikit-learn)'

    def __init__(self, trees: int = 50, seed: int = 0) -> None:
        self.trees = trees
        self.seed = seed

    def _learn(self, rows: Floats) -> None:
        ensemble = require('sklearn.ensemble', self.name)
        self._forest = ensemble.IsolationForest(
            n_estimators=self.trees, random_state=self.seed
        ).fit(rows)

    def _score(self, rows: Floats) -> Floats:
        return np.asarray(-self._forest.score_samples(rows))
