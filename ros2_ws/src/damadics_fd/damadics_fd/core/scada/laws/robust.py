# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Spread and weights that a few wrong samples cannot move, and how many samples count."""

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
MAD = 1.4826  # of a normal distribution
HUBER = 2.5


def spread_of(values: Floats) -> float:
    """
    Return a standard deviation by the median absolute deviation; NaN are left out.

    :param values: any shape; where most of them are equal, as in compressed records, the middle
        90 % tell.
    """
    v = values[np.isfinite(values)]
    if not v.size:
        return math.nan
    v = np.abs(v - np.median(v))
    return float(max(MAD * np.median(v), np.quantile(v, 0.9) / 1.645 * 0.8))


def huber_weights(left: Floats) -> Floats:
    """Return weights that are 1 near zero and fall as 1/|r| beyond 2.5 sigma."""
    limit = HUBER * spread_of(left) + 1e-12
    weights: Floats = np.minimum(1.0, limit / np.maximum(np.abs(left), 1e-12))
    return weights


def block_spread(values: Floats, length: int) -> float:
    """
    Return sqrt(L) times the robust deviation of the means of blocks of L samples.

    :param values: a residual; L = 1 gives `spread_of`.
    :param length: L.
    """
    n = values.size // length
    if n < 8:
        return spread_of(values)
    means = values[: n * length].reshape(n, length).mean(axis=1)
    return math.sqrt(length) * spread_of(means)


def effective(values: Floats) -> float:
    """Return how many independent samples a correlated residual is worth, at least 5."""
    one = spread_of(values)
    if not one > 0.0:
        return float(values.size)
    length = min(30, max(values.size // 20, 1))
    ratio = max(block_spread(values, length) / one, 1.0)
    return max(values.size / ratio**2, 5.0)


def loss_of(values: Floats) -> float:
    """
    Return a mean square in which no sample counts for more than 10 sigma.

    A model is chosen by it: rare motions count, single wrong samples hardly.
    """
    v = values[np.isfinite(values)]
    limit = 10.0 * spread_of(v) + 1e-9
    return float(np.mean(np.minimum(np.abs(v), limit) ** 2))
