# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Straight trend of a slowly changing property, its band, and the time until it meets a limit."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

MIN_POINTS = 5
STRAIGHT = 1.5  # largest chi-square per degree of freedom of a line that still counts as straight


@dataclass(frozen=True)
class TimeToLimit:
    """Hold when a trend meets its limit, in seconds from now; inf where it never does."""

    expected: float
    earliest: float
    latest: float


@dataclass(frozen=True)
class Trend:
    """
    Hold a weighted straight line.

    The covariance contains the scatter around the line where that is larger than the standard
    deviations of the points say.
    """

    origin: float  # [s] time that `level` belongs to
    level: float
    slope: float  # [1/s]
    variance: tuple[float, float, float]  # level, slope, their covariance
    points: int

    def at(self, t: float) -> tuple[float, float]:
        """
        Return the line and its standard deviation.

        :param t: [s] time.
        :return: value, standard deviation.
        """
        d = t - self.origin
        v_level, v_slope, v_both = self.variance
        spread = v_level + 2.0 * d * v_both + d * d * v_slope
        return self.level + self.slope * d, math.sqrt(max(spread, 0.0))

    def time_to(self, limit: float, now: float, sigmas: float = 1.645) -> TimeToLimit:
        """
        Tell how long it takes to a limit.

        :param limit: value not to pass; a negative limit is met from above.
        :param now: [s] present time.
        :param sigmas: width of the band; 1.645 holds 90 % of a normal distribution.
        :return: expected, earliest and latest time; 0 where the limit is passed.

        >>> line = Trend(0.0, 0.0, 1e-4, (0.0, 1e-12, 0.0), 10)
        >>> line.time_to(0.5, now=0.0).expected
        5000.0
        >>> line.time_to(-0.5, now=0.0).expected
        inf
        """
        way = 1.0 if limit >= 0.0 else -1.0
        value, _ = self.at(now)
        left = way * (limit - value)
        speed = way * self.slope
        expected = 0.0 if left <= 0.0 else left / speed if speed > 0.0 else math.inf
        return TimeToLimit(
            expected,
            self._crossing(limit, now, way, sigmas),
            self._crossing(limit, now, way, -sigmas),
        )

    def _crossing(self, limit: float, now: float, way: float, sigmas: float) -> float:
        """Find where line + sigmas * std first meets the limit, by its quadratic equation."""
        value, std = self.at(now)
        left = way * (limit - value)
        if left - sigmas * std <= 0.0:
            return 0.0
        d0 = now - self.origin
        v_level, v_slope, v_both = self.variance
        # (left - speed t)^2 = sigmas^2 (v_level + 2 d v_both + d^2 v_slope), d = d0 + t
        speed, z2 = way * self.slope, sigmas * sigmas
        a = speed * speed - z2 * v_slope
        b = -2.0 * left * speed - 2.0 * z2 * (v_both + d0 * v_slope)
        c = left * left - z2 * (v_level + 2.0 * d0 * v_both + d0 * d0 * v_slope)
        roots = [r.real for r in np.roots([a, b, c]) if abs(r.imag) <= 1e-9 * (1.0 + abs(r))]
        side = 1.0 if sigmas >= 0.0 else -1.0
        fitting = [r for r in roots if r > 0.0 and side * (left - speed * r) >= -1e-9]
        return float(min(fitting)) if fitting else math.inf


def fit_line(t: ArrayLike, value: ArrayLike, std: ArrayLike) -> Trend | None:
    """
    Fit a straight line by weighted least squares.

    :param t: [s] times, shape (n,).
    :param value: values, shape (n,).
    :param std: standard deviations, shape (n,), positive.
    :return: the line; None with fewer than five points or no spread in time.
    """
    x, y, s = (np.asarray(a, np.float64) for a in (t, value, std))
    if len(x) < MIN_POINTS or np.ptp(x) <= 0.0:
        return None
    line, chi2 = _weighted_line(x, y, s)
    inflation = max(1.0, chi2)
    v = line.variance
    return Trend(
        line.origin,
        line.level,
        line.slope,
        (v[0] * inflation, v[1] * inflation, v[2] * inflation),
        line.points,
    )


def fit_recent(t: ArrayLike, value: ArrayLike, std: ArrayLike) -> Trend | None:
    """
    Fit the longest recent stretch that a straight line describes.

    A repair or a change of pace ends the stretch: the record is doubled backwards from its end
    as long as the line fits.

    :param t: [s] increasing times, shape (n,).
    :param value: values, shape (n,).
    :param std: standard deviations, shape (n,), positive.
    :return: the line; None with fewer than five points.
    """
    x, y, s = (np.asarray(a, np.float64) for a in (t, value, std))
    best = fit_line(x[-2 * MIN_POINTS :], y[-2 * MIN_POINTS :], s[-2 * MIN_POINTS :])
    length = 4 * MIN_POINTS
    while best is not None and best.points < len(x):
        tail = slice(max(0, len(x) - length), None)
        _, chi2 = _weighted_line(x[tail], y[tail], s[tail])
        if chi2 > STRAIGHT:
            break
        best = fit_line(x[tail], y[tail], s[tail])
        length *= 2
    return best


def _weighted_line(
    x: NDArray[np.float64], y: NDArray[np.float64], s: NDArray[np.float64]
) -> tuple[Trend, float]:
    w = 1.0 / (s * s)
    total = w.sum()
    origin = float(w @ x / total)  # here level and slope are uncorrelated
    d = x - origin
    level = float(w @ y / total)
    moment = float(w @ (d * d))
    slope = float(w @ (d * y)) / moment
    chi2 = float(w @ (y - level - slope * d) ** 2) / max(len(x) - 2, 1)
    return Trend(origin, level, slope, (1.0 / float(total), 1.0 / moment, 0.0), len(x)), chi2
