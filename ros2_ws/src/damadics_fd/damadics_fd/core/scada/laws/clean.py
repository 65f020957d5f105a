# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Prepare a record for learning: single wrong samples, gaps, period."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.scada.laws.robust import Floats, spread_of
from damadics_fd.core.scada.samples import CV, FLOW

ISOLATED = 8.0  # sigma of the change from sample to sample
ALIKE = 0.2  # share of the period
MOST, MANY = 0.9, 0.7  # of the samples a whole number of periods apart, one period apart
LEAST_PART = 20  # samples between two gaps
CV_SPIKE = 0.02  # of the stroke: smaller ones of CV move a model of the stem by too little


def spike_sizes(samples: Floats) -> Floats:
    """Return for CV, X', P1', P2', F' from which size on a change that comes back is a spike."""
    sizes = np.zeros(5)
    for i, column in enumerate((1, 2, 3, 4, 6)):
        v = samples[:, column]
        off = v[1:-1] - 0.5 * (v[:-2] + v[2:])
        sizes[i] = ISOLATED * spread_of(off) if np.isfinite(off).sum() > 5 else 0.0
    return sizes


def despiked(samples: Floats) -> Floats:
    """
    Return the record with every single-sample spike replaced by its neighbours' mean.

    A command that was another for one sample only may have been true: a record loses nothing by
    it, while a wrong one throws the model of the stem for many.

    :param samples: rows t, CV, X', P1', P2', T1', F'.
    """
    out = samples.copy()
    if len(samples) < 5:
        return out
    for column in range(CV, FLOW + 1):
        v = samples[:, column]
        if not np.isfinite(v).any():
            continue
        middle = 0.5 * (v[:-2] + v[2:])
        off = v[1:-1] - middle
        steady = np.abs(v[2:] - v[:-2])
        least = max(ISOLATED * spread_of(off), CV_SPIKE if column == CV else 0.0)
        if not least > 0.0:
            continue
        bad = (np.abs(off) > least) & (steady < 0.5 * np.abs(off))
        out[1:-1, column] = np.where(bad, middle, v[1:-1])
    return out


def longest_repeat(samples: Floats) -> int:
    """
    Return how often in a row the same CV, X', P1', P2', F' came again.

    >>> longest_repeat(np.array([[0, 1, 2, 3, 4, 5, 6], [1, 1, 2, 3, 4, 5, 6.0]]))
    1
    """
    values = np.nan_to_num(samples[:, (1, 2, 3, 4, 6)], nan=-1.0)
    changes = np.flatnonzero((np.diff(values, axis=0) != 0.0).any(axis=1))
    return int(np.diff(np.r_[-1, changes, len(samples) - 1]).max()) - 1


def period_of(t: Floats) -> float:
    """Return the usual time between samples, s."""
    return float(np.median(np.diff(t))) if len(t) > 1 else 1.0


def is_regular(t: Floats) -> bool:
    """
    Tell whether samples come at one period; a historian may leave some out.

    One that keeps what changes alone leaves out most in quiet hours: that is no period.

    >>> is_regular(np.array([0, 1, 2, 3, 4, 6, 7, 8.0]))
    True
    >>> is_regular(np.array([0, 1, 2, 4, 7, 8.0]))
    False
    """
    if len(t) < 2:
        return False
    periods = np.diff(t) / period_of(t)
    left_out = np.maximum(np.round(periods), 1.0) - 1.0
    at_it = np.abs(periods - left_out - 1.0) < ALIKE
    return bool(at_it.mean() > MOST and (at_it & (left_out == 0.0)).mean() > MANY)


def worthwhile(t: Floats, gap: float) -> NDArray[np.bool_]:
    """Tell which samples lie in parts between gaps, s, that are worth learning from."""
    parts = np.split(np.arange(len(t)), np.flatnonzero(np.diff(t) > gap) + 1)
    return np.concatenate([np.full(len(part), len(part) >= LEAST_PART) for part in parts])


def split(samples: Floats, gap: float) -> Iterator[Floats]:
    """Yield the parts of a record between gaps, s."""
    cuts = np.flatnonzero(np.diff(samples[:, 0]) > gap) + 1
    yield from np.split(samples, cuts)
