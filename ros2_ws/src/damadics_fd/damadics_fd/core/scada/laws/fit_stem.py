# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Identify the stem law from fault-free records."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from damadics_fd.core.scada.laws.robust import Floats, effective, huber_weights, loss_of, spread_of
from damadics_fd.core.scada.laws.stem_law import (
    COPIES,
    FAST,
    STEM_LAW,
    STEM_TRACK,
    TRANSIENT,
    follow_record,
)
from damadics_fd.core.scada.laws.stick import stick_of

GAIN_SPREAD = 0.03  # a positioner moves the stem by what CV asks, within this
LARGEST, UNKNOWN = 3.0, 0.1  # of its spread, where the gain has this standard error
OFFSET_SPREAD = 0.05
SLOWEST = 1.0 / 120.0  # stroke/s: a positioner that passes no more air than this is rare
TRANSIENT_ROOM = 1.2
LARGE = 10.0  # sigma
ARRIVED = 0.05  # of the stroke still to go, or a little while ago: nearer, the stem is there
SLOW_RATE = 0.02  # stroke/s: so slow a stem is not equally slow at all places
SLOW_TRANSIENT = 0.2  # and this share of the way still to go is not known
LIMITED = 0.7  # of the fastest motion in the record: what the law was seen to hold for
BETTER = 0.98  # a further parameter must cut the error to this share
FINER, ROUNDS = 0.998, 4  # a better value of one that is there, to this; how often
FACTORS = (0.75, 0.87, 1.15, 1.3)
LAGS = (0.0, 0.3, 0.6, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 35.0)
DEADS = (0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 9.0)
RATES = (FAST, 0.5, 0.25, 0.15, 0.1, 0.07, 0.05, 0.035, 0.025, 0.017, 0.012)
BANDS = (0.0, 0.003, 0.006, 0.01, 0.015, 0.025, 0.04, 0.06)


@dataclass(frozen=True)
class Piece:
    """Part of a record without a gap: t (s), CV and X (0..1)."""

    t: Floats
    cv: Floats
    x: Floats


@dataclass(frozen=True)
class StemFit:
    """
    A stem law and what it leaves.

    :param law: structured array of `STEM_LAW`, length 1.
    :param x: position of the law and its copies; shape (n, 3), all pieces in a row.
    :param error: X' - law.
    :param sigma: robust standard deviation of the error.
    :param gain: gain that the record alone shows, without what is expected of a positioner.
    :param gain_error: its standard error; infinite where CV hardly moves.
    :param arrived_error: the same from a stem that has arrived, whatever its rates.
    """

    law: np.ndarray
    x: Floats
    error: Floats
    sigma: float
    gain: float
    gain_error: float
    arrived_error: float


def run_law(law: np.ndarray, pieces: Sequence[Piece]) -> Floats:
    """Return law, its copies (gain 1, offset 0) and the way to go over all pieces, (n, 4)."""
    track = np.zeros(1, STEM_TRACK)
    out = []
    for piece in pieces:
        part = np.empty((len(piece.t), COPIES + 1))
        follow_record(law, track, piece.t, piece.cv, part)
        out.append(part)
    return np.concatenate(out)


def fit_stem(pieces: Sequence[Piece], period: float) -> StemFit:
    """
    Identify the law.

    :param pieces: fault-free.
    :param period: sample period, s.
    :return: the law that leaves least.
    """
    law = np.zeros(1, STEM_LAW)
    law['rise'] = law['fall'] = law['slow_rise'] = law['slow_fall'] = FAST
    law['farthest'] = FAST  # nothing is farther while the law is sought
    law['gain'] = 1.0
    law['lag_s'] = min(max(period, 0.5), 5.0)
    x = np.concatenate([piece.x for piece in pieces])
    unit = max(1.0, period)
    grids = {
        'lag_s': [v * unit for v in LAGS],
        'dead_s': [v * unit for v in DEADS],
        'rise': [v for v in RATES if v * period < 4.0],
        'fall': [v for v in RATES if v * period < 4.0],
        'band': list(BANDS),
    }
    held = law.copy()
    held['hold'] = True
    losses = [_descend(kind, grids, pieces, x) for kind in (law, held)]
    usual = [spread_of(x - run_law(kind, pieces)[:, 0]) for kind in (law, held)]
    # the law that leaves less at most times, unless rare motions say otherwise
    if usual[1] < BETTER * usual[0] and BETTER * losses[1] < losses[0]:
        law = held
    _proven(law, pieces)
    return _finish(law, pieces, x)


def _descend(
    law: np.ndarray, grids: dict[str, list[float]], pieces: Sequence[Piece], x: Floats
) -> float:
    """Search each parameter in turn, write them into the law and return what it leaves."""
    best = _loss(law, pieces, x)
    for turn in range(3):
        before = best
        for name, grid in grids.items():
            best = _search(law, name, grid, best, pieces, x)
        if turn and best > 0.999 * before:
            break
    for _ in range(ROUNDS):
        before = best
        for name in grids:
            value = float(law[name][0])
            if 0.0 < value < FAST:
                near = [value * factor for factor in FACTORS]
                best = _search(law, name, near, best, pieces, x, FINER)
        if best == before:
            break
    return best


def _loss(law: np.ndarray, pieces: Sequence[Piece], x: Floats) -> float:
    """Return a robust variance of what the law leaves, with gain 1 and a free offset."""
    e = x - run_law(law, pieces)[:, 0]
    e -= np.median(e)
    return loss_of(e)


def _search(
    law: np.ndarray,
    name: str,
    grid: Sequence[float],
    best: float,
    pieces: Sequence[Piece],
    x: Floats,
    better: float = BETTER,
) -> float:
    kept = float(law[name][0])
    for value in grid:
        if value == kept:
            continue
        law[name] = value
        found = _loss(law, pieces, x)
        if found < better * best:
            best, kept = found, value
    law[name] = kept
    return best


def _proven(law: np.ndarray, pieces: Sequence[Piece]) -> None:
    """Set the rates of the slow copy: what the law was seen to do, in each direction."""
    track = run_law(law, pieces)[:, 0]
    t = np.concatenate([piece.t for piece in pieces])
    dt = np.diff(t)
    ok = (dt > 0.0) & (dt < 5.0 * np.median(dt))
    rate = np.diff(track)[ok] / dt[ok]
    for name, sign in (('rise', 1.0), ('fall', -1.0)):
        moved = np.sort(np.maximum(sign * rate, 0.0))
        seen = float(moved[-max(3, len(moved) // 1000)]) if len(moved) > 10 else 0.0
        limit = float(law[name][0])
        slow = LIMITED * min(seen, limit)
        law[f'slow_{name}'] = max(slow, min(SLOWEST, limit))


def _transient(law: np.ndarray, beyond: Floats, ahead: Floats, sigma: float) -> float:
    """Return by which share of the way still to go a stem was beyond law and copies."""
    large = ahead > LARGE * sigma
    if large.sum() < 10:
        return TRANSIENT
    share = (np.abs(beyond[large]) - 3.0 * sigma) / ahead[large]
    slow = min(float(law['rise'][0]), float(law['fall'][0])) < SLOW_RATE
    return max(
        SLOW_TRANSIENT if slow else TRANSIENT, TRANSIENT_ROOM * float(np.quantile(share, 0.995))
    )


def _finish(law: np.ndarray, pieces: Sequence[Piece], x: Floats) -> StemFit:
    track = run_law(law, pieces)
    u = track[:, 0]
    centre = float(np.mean(u))
    design = np.column_stack([np.ones(len(u)), u - centre])
    target = x - u
    weight = np.ones(len(u))
    free = np.zeros(2)
    for _ in range(10):
        normal = design.T @ (design * weight[:, None])
        right = design.T @ (weight * target)
        free = np.asarray(np.linalg.lstsq(normal, right, rcond=None)[0], np.float64)
        left = target - design @ free
        weight = huber_weights(left)
    sigma = max(spread_of(left), 1e-5)
    n = effective(left)
    share = n / len(u)
    variance = sigma**2 / share
    sums = design.T @ (design * weight[:, None])
    error = math.sqrt(variance / sums[1, 1]) if sums[1, 1] > 0.0 else math.inf
    arrived = _arrived_error(u, weight * (track[:, COPIES] < ARRIVED), variance)
    prior = np.diag([1.0 / OFFSET_SPREAD**2, 1.0 / GAIN_SPREAD**2]) * variance
    theta = np.linalg.solve(sums + prior, design.T @ (weight * target))
    if arrived > UNKNOWN:  # a stem on its way does not show its gain
        theta[1] = np.clip(theta[1], -LARGEST * GAIN_SPREAD, LARGEST * GAIN_SPREAD)
    covariance = np.linalg.inv(sums + prior) * variance
    law['gain'] = 1.0 + theta[1]
    law['offset'] = theta[0] - theta[1] * centre
    law['centre'] = float(law['offset'][0]) + float(law['gain'][0]) * centre
    law['v_offset'], law['v_gain'] = covariance[0, 0], covariance[1, 1]
    position = np.clip(law['offset'] + law['gain'] * track[:, :COPIES], 0.0, 1.0)
    left = x - position[:, 0]
    beyond = x - np.clip(x, position.min(axis=1), position.max(axis=1))
    law['transient'] = _transient(law, beyond, track[:, COPIES], sigma)
    cv = np.concatenate([piece.cv for piece in pieces])
    way = np.maximum(track[:, COPIES], np.abs(cv - u))
    law['farthest'] = np.sort(way)[-max(3, len(way) // 1000)]
    command = law['offset'] + law['gain'] * cv
    law['stick'] = stick_of(x, command, position[:, 0], float(law['band'][0]))
    return StemFit(law, position, left, spread_of(left), 1.0 + float(free[1]), error, arrived)


def _arrived_error(u: Floats, weight: Floats, variance: float) -> float:
    """Return the standard error of a gain that only a stem that has arrived tells."""
    total = float(weight.sum())
    if total <= 0.0:
        return math.inf
    about = float((weight * (u - float((weight * u).sum()) / total) ** 2).sum())
    return math.sqrt(variance / about) if about > 0.0 else math.inf
