# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Learned linear predictors of a pressure: one to filter it by, one to test it against."""

import math
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats, Record

TAPS = 20
SHORT_TAPS = 12
SHORT_RECORD = 1000
GATE = 7.0  # multiples of the predictor's sigma beyond which the measurement is believed


class PressureFilter(Record):
    """What a pressure is filtered and tested by."""

    a: Annotated[Floats, TAPS]  # predictor, sum a_i = 1
    c: float  # weight of the measurement
    sigma: float  # of the prediction error
    mean: float
    b: Annotated[Floats, TAPS]  # predictor of the deviation from the mean
    b0: float


PRESSURE = PressureFilter.dtype()


@jit
def predict_pressure(filt: PressureFilter, past: np.ndarray) -> float:
    """Return sum a_i P'(k-i); `past` holds the newest raw sample first."""
    total = 0.0
    for i in range(TAPS):
        total += filt.a[i] * past[i]
    return total


@jit
def is_far(filt: PressureFilter, past: np.ndarray, measured: float) -> bool:
    """Tell whether P'(k) is farther from its prediction than the noise takes it."""
    far: bool = abs(measured - predict_pressure(filt, past)) > GATE * filt.sigma
    return far


@jit
def innovation(filt: PressureFilter, past: np.ndarray, measured: float) -> float:
    """
    Return P'(k) less its prediction about the learned mean.

    A wave that the mean does not know is predicted away, a shift of the mean stays.
    """
    total = measured - filt.mean - filt.b0
    for i in range(TAPS):
        total -= filt.b[i] * (past[i] - filt.mean)
    return total


@jit
def fuse_pressure(filt: PressureFilter, past: np.ndarray, measured: float) -> float:
    """Return P^(k) = c P'(k) + (1-c) pr(k), or P'(k) itself where it jumped."""
    predicted = predict_pressure(filt, past)
    if is_far(filt, past, measured):
        return measured
    return filt.c * measured + (1.0 - filt.c) * predicted


@jit
def push(past: np.ndarray, value: float) -> None:
    """Put the newest value in front of the ring of past samples."""
    for i in range(TAPS - 1, 0, -1):
        past[i] = past[i - 1]
    past[0] = value


def learn_pressure(pressure: NDArray[np.float64], sigma: float, filt: PressureFilter) -> None:
    """
    Fit both predictors by ridge least squares, the fusion weight from the first one's error.

    :param pressure: fault-free pressure, share of full scale, shape (n,).
    :param sigma: standard deviation of the sensor noise, share of full scale.
    :param filt: record of `PressureFilter`, written in place.
    """
    n = pressure.size
    taps = TAPS if n >= SHORT_RECORD else SHORT_TAPS
    lagged = np.column_stack([pressure[taps - i : n - i] for i in range(1, taps + 1)])
    newest = lagged[:, :1]
    design = lagged[:, 1:] - newest
    target = pressure[taps:] - newest[:, 0]
    ridge = 0.05 * target.size * sigma**2 * np.eye(taps - 1)
    weights = np.linalg.solve(design.T @ design + ridge, design.T @ target)
    error = target - design @ weights
    variance = max(float(error.var()) - sigma**2, 0.02 * sigma**2)
    a = np.zeros(TAPS)
    a[1:taps] = weights
    a[0] = 1.0 - weights.sum()
    filt.a[:] = a
    filt.c = variance / (variance + sigma**2)
    filt.sigma = error.std()
    mean = pressure.mean()
    design = np.column_stack([lagged - mean, np.ones(target.size)])
    weights = _as_many_as_earn_it(design, pressure[taps:] - mean, sigma, n < SHORT_RECORD)
    filt.mean = mean
    filt.b[: weights.size - 1] = weights[:-1]
    filt.b0 = weights[-1]


def _as_many_as_earn_it(design: Floats, target: Floats, sigma: float, short: bool) -> Floats:
    """
    Fit taps and a constant; of a short record so many of the newest taps as Schwarz's BIC allows.

    Taps that were fitted to nothing but noise make an innovation of which each is like the last,
    and the sums of that are larger than they were while learning.

    :param design: lagged values, the newest first, and a column of ones.
    :return: weights, the constant last.
    """
    most = design.shape[1] - 1
    best: Floats = np.zeros(1)
    least = math.inf
    for taps in range(most + 1) if short else (most,):
        part = np.column_stack([design[:, :taps], design[:, -1]])
        ridge = 0.05 * target.size * sigma**2 * np.diag([*np.ones(taps), 0.0])
        weights = np.linalg.solve(part.T @ part + ridge, part.T @ target)
        error = float(((target - part @ weights) ** 2).mean())
        bic = target.size * math.log(max(error, 1e-300)) + taps * math.log(target.size)
        if bic < least:
            best, least = weights.astype(np.float64), bic
    return best
