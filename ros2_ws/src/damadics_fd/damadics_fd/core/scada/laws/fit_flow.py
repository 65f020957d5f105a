# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Identify the flow law from fault-free records.

X' carries noise of its own, which would flatten the characteristic (regression dilution). The
position that follows from CV alone does not share that noise: it is the instrument. Away from the
record, a random walk of the slope about what control valves have (a rangeability of 50 is a slope
of -4) says how far the characteristic may be from its extension.
"""

import math
from dataclasses import dataclass

import numpy as np

from damadics_fd.core.scada.laws.flow_law import (
    FLOW_LAW,
    GAS,
    KNOTS,
    LEAST_END,
    LIQUID,
    STEP,
    near_end,
    sizing,
)
from damadics_fd.core.scada.laws.robust import Floats, effective, huber_weights, spread_of

SLOPE, SLOPE_SPREAD = -4.0, 2.0
LAST_SLOPE, LAST_SPREAD = -8.0, 6.0  # between the last two knots the port closes
TURN = 1.5  # change of the slope from knot to knot
EXPONENT = (0.05, 0.3)  # standard deviation of the exponent's error: best and worst known
LAGS = (0.0, 0.7, 1.5, 3.0, 5.0, 8.0, 12.0)
LEAST_FLOW = 0.02  # of the meter's range; below it meters do not measure
BETTER = 0.9
METER = 0.002  # of the range: the least noise of a flow meter
AVERAGED = 5  # samples
# What a plant changes by itself within minutes, share of the flow: it comes with the load, and so
# with the position, and a fit takes it for a slope of the characteristic.
SLOW_CHANGE, SLOW_S = 0.01, 300.0
MOVING = 0.01  # of the stroke between position and its longest lag: there a lag shows
FEWEST_MOVING = 30  # samples
FEWEST = 100  # samples that tell a law


@dataclass(frozen=True)
class FlowFit:
    """
    A flow law and what it leaves.

    :param law: structured array of `FLOW_LAW`, length 1.
    :param left: log F' - law, NaN where not fitted.
    :param used: samples fitted.
    """

    law: np.ndarray
    left: Floats
    used: int


def hats(x: Floats) -> Floats:
    """Return the weights of the knots at positions x, shape (n, KNOTS)."""
    place = np.clip(x, 0.0, 1.0) / STEP
    i = np.minimum(place.astype(int), KNOTS - 2)
    basis = np.zeros((len(x), KNOTS))
    rows = np.arange(len(x))
    basis[rows, i] = 1.0 - (place - i)
    basis[rows, i + 1] = place - i
    return basis


def smooth(values: Floats, t: Floats, lag: float) -> Floats:
    """Return values after a first-order lag; NaN hold the value before."""
    if lag <= 0.0:
        return values
    out = np.empty_like(values)
    last = values[np.isfinite(values)][0] if np.isfinite(values).any() else math.nan
    shares = 1.0 - np.exp(-np.diff(t, prepend=t[0]) / lag)
    for i, (value, share) in enumerate(zip(values.tolist(), shares.tolist(), strict=True)):
        if math.isfinite(value):
            last += share * (value - last)
        out[i] = last
    return out


def prior() -> tuple[Floats, Floats]:
    """Return precision matrix and right-hand side of what is expected of a characteristic."""
    rows, values = [], []
    for j in range(KNOTS - 1):
        last = j == KNOTS - 2
        # towards the seat every characteristic turns to zero: log F gets steep there
        steeper = max(1.0, 0.5 / (1.0 - (j + 0.5) * STEP))
        spread = (LAST_SPREAD if last else SLOPE_SPREAD * steeper) * STEP
        row = np.zeros(KNOTS)
        row[j], row[j + 1] = -1.0 / spread, 1.0 / spread
        rows.append(row)
        values.append((LAST_SLOPE if last else SLOPE) * STEP / spread)
        if j < KNOTS - 3:
            row = np.zeros(KNOTS)
            row[j : j + 3] = np.array([1.0, -2.0, 1.0]) / (TURN * steeper * STEP)
            rows.append(row)
            values.append(0.0)
    a, b = np.array(rows), np.array(values)
    return a.T @ a + 1e-9 * np.eye(KNOTS), a.T @ b


def sizes(medium: int, p1: Floats, p2: Floats, t1: Floats) -> Floats:
    """Return the sizing term of every sample."""
    return np.array([sizing(medium, *row) for row in zip(p1, p2, t1, strict=True)])


def fit_flow(
    t: Floats,
    x: Floats,
    model_x: Floats,
    size: Floats,
    flow: Floats,
    flow_range: float,
    medium: int = LIQUID,
) -> FlowFit | None:
    """
    Identify the law.

    :param t: time, s; the others are aligned with it.
    :param x: measured position, 0..1; model_x the stem law's.
    :param size: sizing term of `sizes`.
    :param flow: measured flow, scaled.
    :param flow_range: end of the meter's range, scaled; 0 where it is not known.
    :param medium: LIQUID or GAS.
    :return: the law; None where too little flow or pressure drop was measured.
    """
    scale = flow_range or float(np.nanquantile(flow, 0.999)) if np.isfinite(flow).any() else 0.0
    if not scale > 0.0:
        return None
    noise = _white(flow, LEAST_END * flow_range if flow_range else math.inf)
    high = near_end(flow_range, noise) if flow_range else math.inf
    good = np.isfinite(flow + size) & (flow > LEAST_FLOW * scale) & (flow < high)
    good &= x < 1.0 - 0.5 * STEP
    if good.sum() < FEWEST:
        return None
    moving = np.abs(x - smooth(x, t, LAGS[-1]))[good] > MOVING
    seen = np.count_nonzero(moving) >= FEWEST_MOVING
    if not seen:
        moving[:] = True
    lags = LAGS if seen else LAGS[:1]
    fits = [_fit(t, x, model_x, size, flow, good, moving, lag) for lag in lags]
    shown = _lag_shown([fit[0] for fit in fits])
    _, c, v, left, spread = fits[shown]
    law = np.zeros(1, FLOW_LAW)
    law['medium'], law['c'], law['lag_s'], law['range'] = medium, c, LAGS[shown], flow_range
    law['size0'] = float(np.mean(size[good]))
    law['noise'] = max(METER * scale, noise)
    law['spread'] = max(spread, 1e-3)
    law['v'][0, :KNOTS, :KNOTS] = v
    law['v'][0, KNOTS, KNOTS] = _exponent_doubt(left, size - law['size0'][0]) ** 2
    return FlowFit(law, left, int(good.sum()))


def _lag_shown(errors: list[float]) -> int:
    """
    Return which lag the meter has: where the error is least, if it grows again beyond it.

    Where longer lags fit ever better, they smooth slow swings of the plant: no lag was seen.

    >>> LAGS[_lag_shown([4.0, 3.8, 3.4, 2.7, 1.6, 0.2, 1.7])]
    8.0
    >>> LAGS[_lag_shown([9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0])]
    0.0
    """
    least = int(np.argmin(errors))
    return least if least < len(errors) - 1 and errors[least] < BETTER * errors[0] else 0


def _fit(
    t: Floats,
    x: Floats,
    model_x: Floats,
    size: Floats,
    flow: Floats,
    good: np.ndarray,
    moving: np.ndarray,
    lag: float,
) -> tuple[float, Floats, Floats, Floats, float]:
    """
    Return the error where the stem moves, and all else for one lag of the meter.

    :return: that robust error, knots, their covariance, the residual, its robust spread.
    """
    a = hats(smooth(x, t, lag))[good]
    z = hats(smooth(model_x, t, lag))[good]
    y = np.log(flow[good]) - smooth(np.where(np.isfinite(size), size, np.nan), t, lag)[good]
    precision, pull = prior()
    weight = np.ones(len(y))
    spread = 0.05
    c = np.zeros(KNOTS)
    left = y
    for _ in range(8):
        normal = z.T @ (a * weight[:, None])
        c = np.linalg.solve(normal + precision * spread**2, z.T @ (weight * y) + pull * spread**2)
        left = y - a @ c
        left = left - np.median(left)
        spread = max(spread_of(left), 1e-4)
        weight = huber_weights(left)
    variance = spread**2 * len(left) / effective(left)
    lasting = SLOW_S / max(float(np.median(np.diff(t))), 1e-3)
    variance += SLOW_CHANGE**2 * min(lasting, len(left))
    normal = z.T @ (z * weight[:, None])  # the noise in X' tells nothing of the slope
    v = np.linalg.inv(normal / variance + precision)
    c = np.minimum.accumulate(c)
    full = np.full(len(x), np.nan)
    full[good] = y - a @ c
    c = c + np.nanmedian(full)
    full -= np.nanmedian(full)
    # a lag also averages noise, which must not count for it: compare what is slower
    slow = np.convolve(full[good], np.ones(AVERAGED) / AVERAGED, 'same')
    return 1.4826 * float(np.median(np.abs(slow[moving]))), c, v, full, spread


def _white(flow: Floats, below: float) -> float:
    """
    Return the standard deviation of the noise in a flow from sample to sample.

    :param below: at its end a meter cuts off half of it: only flows below this count, if enough.
    """
    off = flow[1:-1] - 0.5 * (flow[:-2] + flow[2:])
    far = np.maximum(np.maximum(flow[:-2], flow[1:-1]), flow[2:]) < below
    noise = spread_of(off[far] if np.count_nonzero(far) >= FEWEST else off) / math.sqrt(1.5)
    return noise if math.isfinite(noise) else 0.0


def _exponent_doubt(left: Floats, size: Floats) -> float:
    """Return how far the exponent of the pressure term may be off, by what slow changes leave."""
    length = max(len(left) // 200, 10)
    n = len(left) // length
    ok = np.isfinite(left[: n * length] + size[: n * length]).reshape(n, length)
    counts = ok.sum(axis=1)
    rows = counts > length // 2
    if rows.sum() < 8:
        return EXPONENT[1]
    r = np.where(ok, left[: n * length].reshape(n, length), 0.0).sum(axis=1)[rows] / counts[rows]
    s = np.where(ok, size[: n * length].reshape(n, length), 0.0).sum(axis=1)[rows] / counts[rows]
    s = s - s.mean()
    total = float(s @ s)
    if not total > 0.0:
        return EXPONENT[1]
    slope = float(s @ r) / total
    error = spread_of(r - slope * s) / math.sqrt(total)
    return min(max(abs(slope) + 2.0 * error, EXPONENT[0]), EXPONENT[1])


def better_medium(
    t: Floats,
    x: Floats,
    model_x: Floats,
    pressures: tuple[Floats, Floats, Floats],
    flow: Floats,
    flow_range: float,
    stated: int | None,
) -> FlowFit | None:
    """Return the law of the stated medium; of the one that leaves least where none is stated."""
    media = (LIQUID, GAS) if stated is None else (stated,)
    fits = [
        fit_flow(t, x, model_x, sizes(medium, *pressures), flow, flow_range, medium)
        for medium in media
    ]
    found = [fit for fit in fits if fit is not None]
    if not found:
        return None
    first = found[0]
    second = found[-1]
    return second if second.law['spread'][0] < 0.8 * first.law['spread'][0] else first
