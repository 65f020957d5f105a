# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Confidence intervals of shares, rates and medians."""

import math
from collections.abc import Sequence

LEVEL = 0.95
Z = 1.959963984540054  # of the normal distribution, two-sided 95 %


def share_interval(hits: int, of: int) -> tuple[float, float]:
    """
    Return the 95 % interval of a share (Wilson 1927).

    >>> low, high = share_interval(8, 10)
    >>> round(low, 3), round(high, 3)
    (0.49, 0.943)
    """
    if of == 0:
        return 0.0, 1.0
    p = hits / of
    middle = (p + Z**2 / (2 * of)) / (1 + Z**2 / of)
    half = Z * math.sqrt(p * (1 - p) / of + Z**2 / (4 * of**2)) / (1 + Z**2 / of)
    return max(0.0, middle - half), min(1.0, middle + half)


def rate_interval(events: int, exposure: float) -> tuple[float, float]:
    """
    Return the exact 95 % interval of a rate of rare events (Garwood 1936).

    :param events: how many.
    :param exposure: in what time; the rate is per its unit.

    >>> low, high = rate_interval(0, 10.0)
    >>> low, round(high, 3)
    (0.0, 0.369)
    """
    if exposure <= 0.0:
        return 0.0, math.inf
    tail = (1.0 - LEVEL) / 2.0
    low = 0.0 if events == 0 else _solve(lambda m: 1.0 - _poisson(events - 1, m), tail)
    high = _solve(lambda m: -_poisson(events, m), -tail)
    return low / exposure, high / exposure


def _poisson(k: int, mean: float) -> float:
    """Return the probability of at most k events."""
    term = total = math.exp(-mean)
    for i in range(1, k + 1):
        term *= mean / i
        total += term
    return total


def _solve(rising, target: float) -> float:  # type: ignore[no-untyped-def]
    low, high = 0.0, 1.0
    while rising(high) < target:
        high *= 2.0
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rising(middle) < target else (low, middle)
    return high


def median_interval(values: Sequence[float]) -> tuple[float, float]:
    """
    Return the 95 % interval of a median from order statistics; infinity: not found.

    >>> median_interval([1, 2, 3, 4, 5, 6, 7, 8, 9])
    (2, 8)
    """
    ordered = sorted(values)
    n = len(ordered)
    if n == 0:
        return math.nan, math.nan
    inside, k = 0.0, 0
    while k < n // 2 and inside + math.comb(n, k) / 2**n <= (1.0 - LEVEL) / 2.0:
        inside += math.comb(n, k) / 2**n
        k += 1
    if k == 0:
        return -math.inf, math.inf  # too few values for any bound
    return ordered[k - 1], ordered[n - k]
