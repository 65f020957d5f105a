# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Lag of the chamber-pressure transmitter, and which way air and flow push, from strokes.

A stroke is fitted as the output of the lag: the force balance of every block since the stem
began to move, through a first-order lag, whose first value is free. A stem at one speed cannot
tell a lag T from a viscous friction of -K T; the changes of speed within strokes can. The mass of
the stem does then what a lag of sqrt(2 m / K), 10 ms, would do, so that it has its column.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from damadics_fd.commands.commission.forces.blur import (
    CHANGING,
    MOVING,
    STILL,
    Slopes,
    believable,
    lag_response,
    noise_normal,
    position_noise,
)
from damadics_fd.commands.commission.signals import Blocks, steady
from damadics_fd.core.record import Floats
from damadics_fd.core.settings import Settings

Mask = NDArray[np.bool_]
WIDTH = 0.04  # s: two periods of 50 Hz
GRID = (0.0, 0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.14, 0.2, 0.28, 0.4, 0.56, 0.8)  # s
SHORTEST, LONGEST = 5, 120  # blocks of a stroke that are used
STRIBECK = 0.026  # strokes/s, as in the signature
LEAST_GAIN = 16.0  # in chi-square, for which a lag is believed
SIGN_GAIN = 9.0  # and a direction
LEAST_LAG = 0.01  # s; what a model of blocks cannot tell from none
CALM = 9  # blocks over which P1 - P2 is averaged: its noise must not call for a lag
NEAR, CURVED = 0.005, 3  # strokes; degree: how the slope of the force over the position is taken
UNSURE = 0.1  # share of the correction for sensor noise that may be wrong
STATED = 0.3  # share to which a stated viscous friction, or the mass, is known
LEAST_STD = 2e-3  # s; what blocks and model leave open
FREE, NODES = 7, 11  # columns besides the plug force; nodes of its table
INERTIA = 6
SIGNED = (0, 2, 3)  # stiffness, viscous and dry friction push against the air
SURE = 0.045  # strokes/s well above which nothing sticks any more
STICKY = 0.5  # as doubtful as a block that slow
CREEP = 40.0  # times the variance of a block that hardly moves


@dataclass(frozen=True)
class Lag:
    """Hold the lag, the directions, and how sure they are."""

    seconds: float  # 0 where none is believed
    std: float
    air: float  # 1: air closes, -1: it opens
    flow: float  # 1: flow opens, -1: it closes
    air_gain: float  # chi-square by which the other direction is worse
    flow_gain: float


def plug_per_pascal(s: Settings, x: Floats) -> Floats:
    """
    Return the plug force per pressure difference, without sign.

    :param s: settings with plug_diameter and plug_table.
    :param x: position / stroke.
    :return: [m2].
    """
    nodes = np.r_[0.0:0.91:0.1, 0.99, 1.0]
    area: Floats = np.pi * s.plug_diameter**2 / 4.0 / np.interp(x, nodes, s.plug_table)
    return area


def trust(v: Floats, sticky: Mask | bool = False) -> Floats:
    """
    Return the weight of blocks: slow and sticky ones hold jumps between sticking and sliding.

    :param v: [strokes/s].
    :param sticky: blocks in which the stem sticks and slips.
    :return: at most 1.
    """
    slow = np.exp(-((v / SURE) ** 2))
    weight: Floats = 1.0 / (1.0 + CREEP * np.maximum(slow, np.where(sticky, STICKY, 0.0)))
    return weight


def strokes(b: Blocks) -> list[slice]:
    """
    Find the runs of blocks that move one way.

    :param b: blocks.
    :return: one slice for each, without its first block.
    """
    way = np.where(b.moving, np.sign(b.v), 0.0)
    breaks = np.flatnonzero((np.diff(way) != 0.0) | (np.diff(b.index) != 1)) + 1
    edges = [0, *breaks.tolist(), len(way)]
    runs = [slice(a, min(z, a + LONGEST)) for a, z in pairwise(edges) if way[a] != 0.0]
    return [run for run in runs if run.stop - run.start >= SHORTEST]


def find_lag(b: Blocks, s: Settings, viscous: float | None = None) -> Lag:
    """
    Find the lag of ps and the directions of air and flow.

    :param b: blocks of WIDTH, nothing delayed.
    :param s: settings with stroke, area, plug.
    :param viscous: stated viscous friction [N s/m]; None where it is not stated.
    :return: the likeliest.
    """
    runs = strokes(b)
    if len(runs) < 4:
        return Lag(0.0, 0.0, 1.0, 1.0, 0.0, 0.0)
    scan = _Scan(b, s, runs, viscous)
    raw = [min(fit.score for fit in scan.fits(T, 1.0).values()) for T in GRID]
    noise = max(min(raw) / max(scan.rows - 20, 1), 1e-6)
    table = {T: scan.fits(T, noise) for T in GRID}
    least = {air: min(row[air].score for row in table.values()) for air in (1.0, -1.0)}
    air = 1.0 if least[1.0] <= least[-1.0] else -1.0
    score = {T: row[air].score for T, row in table.items()}
    T, std = _refine(score, lambda lag: scan.fits(lag, noise)[air].score)
    corrected = scan.rows * (scan.blurred + scan.floating) * (1.0 - _smoothing(b.width, T)) / noise
    gained = score[0.0] - min(score.values())
    if gained < max(LEAST_GAIN, UNSURE * corrected) or T < LEAST_LAG:
        T = 0.0
    fit = scan.fits(T, noise)[air]
    return Lag(
        T,
        std,
        air,
        1.0 if air * fit.gain >= 0.0 else -1.0,
        least[-air] - least[air],
        (fit.gain / fit.gain_std) ** 2 if fit.gain_std > 0.0 else 0.0,
    )


@dataclass(frozen=True)
class _Fit:
    """Hold chi-square of one direction of the air, and the plug force found with it."""

    score: float
    gain: float
    gain_std: float


class _Scan:
    """Strokes laid out side by side, to be fitted for one lag after the other."""

    def __init__(self, b: Blocks, s: Settings, runs: list[slice], viscous: float | None) -> None:
        known = {INERTIA: s.mass} | ({2: viscous} if viscous is not None else {})
        self.known = {i: (value, (STATED * max(value, 0.1)) ** -2) for i, value in known.items()}
        gain = plug_per_pascal(s, b.x)
        v = np.nan_to_num(b.v)
        dp = np.convolve(np.pad(b.dp, CALM // 2, 'edge'), np.full(CALM, 1.0 / CALM), 'valid')
        if steady(b):  # what is left of its noise would call for no plug force
            dp = np.full(len(dp), float(np.mean(b.dp[b.moving])))
        columns = [
            s.stroke * b.x,
            np.ones(len(v)),
            s.stroke * v,
            np.sign(v),
            np.sign(v) * np.exp(-((v / STRIBECK) ** 2)),
            gain * b.rate_dp,
            s.stroke * _acceleration(b),
        ]
        scale = float(np.ptp(s.area * b.ps)) + 1.0
        self.precision = np.diag(1.0 / np.array([np.inf] * 4 + [0.01 * scale, 0.2, np.inf]) ** 2)
        self.plugged = s.plug_diameter > 0.0 and float(np.mean(np.abs(b.dp))) > 0.0
        if self.plugged:
            columns += list(_plug_columns(s, b.x, dp))
            spread = np.full((NODES, NODES), 1.0) + 0.2**2 * np.eye(NODES)
            full = np.zeros((FREE + NODES, FREE + NODES))
            full[:FREE, :FREE], full[FREE:, FREE:] = self.precision, np.linalg.inv(spread)
            self.precision = full
        for i, (_, sure) in self.known.items():
            self.precision[i, i] += sure
        matrix = np.stack(columns, axis=1)
        steep = np.zeros_like(matrix)
        steep[:, [0, 2, INERTIA]] = s.stroke
        if self.plugged:
            beside = (_plug_columns(s, b.x + side, dp) for side in (NEAR, -NEAR))
            steep[:, FREE:] = np.subtract(*beside).T / (2.0 * NEAR)
        kind = np.full(matrix.shape[1], STILL)
        kind[2], kind[INERTIA] = MOVING, CHANGING
        length = max(run.stop - run.start for run in runs)
        sticky = b.sticky
        self.R, slopes = np.zeros((2, len(runs), length, matrix.shape[1]))
        self.y, self.weight = np.zeros((2, len(runs), length))
        for k, run in enumerate(runs):
            n = run.stop - run.start
            self.R[k, :n], self.y[k, :n] = matrix[run], s.area * b.ps[run]
            slopes[k, :n] = steep[run]
            self.weight[k, :n] = trust(v[run], sticky[run])
        self.rows = int(self.weight.sum()) - len(runs)
        self.width = b.width
        self.slopes, self.jitter = Slopes(tuple(kind.tolist()), slopes), position_noise(b)
        self.blurred = self.jitter * _steepness(b, s, runs)
        self.floating = _plug_noise(b, runs, gain)
        self.kept: dict[float, tuple[Floats, Floats, float, Floats]] = {}

    def fits(self, T: float, noise: float) -> dict[float, _Fit]:
        """
        Fit all strokes with one lag.

        :param T: lag [s].
        :param noise: variance of a block [N2].
        :return: fit by direction of the air: 1 closes, -1 opens.
        """
        if T not in self.kept:
            self.kept[T] = self._normal(T)
        H, g, yy, blur = self.kept[T]
        A = H / noise + self.precision
        A += np.diag(1e-9 * np.diag(A))
        A -= believable(A, blur / noise)
        return {air: self._constrained(A, g / noise, yy / noise, air) for air in (1.0, -1.0)}

    def _normal(self, T: float) -> tuple[Floats, Floats, float, Floats]:
        """Return the normal equations of all strokes, free starts taken out, and noise in them."""
        R, z = self.R, np.zeros_like(self.R)
        fade = (np.arange(R.shape[1]) == 0).astype(float)
        if T > 0.0:
            a = np.exp(-self.width / T)
            keep = (1.0 - a) * T / self.width
            for k in range(1, R.shape[1]):
                step = R[:, k] - R[:, k - 1]
                z[:, k] = a * z[:, k - 1] + (1.0 - a) * R[:, k - 1] + (1.0 - keep) * step
            fade = a ** np.arange(R.shape[1])
        else:
            z[:] = R
        w = self.weight
        norm = np.maximum(w @ (fade * fade), 1e-300)
        z = z - fade[:, None] * (np.einsum('sk,k,skp->sp', w, fade, z) / norm[:, None])[:, None]
        y = self.y - fade * ((w * self.y) @ fade / norm)[:, None]
        zw = (z * w[:, :, None]).reshape(-1, z.shape[2])
        z, y = z.reshape(-1, z.shape[2]), y.ravel()
        yy = float(y @ (w.ravel() * y))
        yy += self.rows * (self.blurred + self.floating * (1.0 - _smoothing(self.width, T)))
        blur = self.jitter * noise_normal(self.slopes, w, fade, self.width, T)
        return zw.T @ z, zw.T @ y, yy, blur

    def _constrained(self, A: Floats, right: Floats, yy: float, air: float) -> _Fit:
        """Fit with a spring and a friction that push the right way."""
        b = right.copy()
        least = 0.0
        for i, (stated, sure) in self.known.items():
            b[i] += sure * air * stated
            least += sure * stated**2
        free = np.ones(len(b), bool)
        theta = np.zeros(len(b))
        for _ in range(len(SIGNED) + 1):
            theta = np.zeros(len(b))
            theta[free] = np.linalg.solve(A[np.ix_(free, free)], b[free])
            wrong = [i for i in SIGNED if free[i] and air * theta[i] < 0.0]
            if not wrong:
                break
            free[min(wrong, key=lambda i: air * theta[i] * np.sqrt(A[i, i]))] = False
        score = least + yy - 2.0 * float(theta @ b) + float(theta @ A @ theta)
        if not self.plugged:
            return _Fit(score, 0.0, 0.0)
        covariance = np.linalg.inv(A[np.ix_(free, free)])[-NODES:, -NODES:]
        return _Fit(score, float(theta[FREE:].mean()), float(np.sqrt(max(covariance.mean(), 0.0))))


def _plug_columns(s: Settings, x: Floats, dp: Floats) -> Floats:
    """Return the plug force by the nodes of its table, shape (nodes, n) [N]."""
    hats = np.clip(1.0 - np.abs(x * 10.0 - np.arange(NODES)[:, None]), 0.0, 1.0)
    found: Floats = plug_per_pascal(s, x) * dp * hats
    return found


def _steepness(b: Blocks, s: Settings, runs: list[slice]) -> float:
    """Return the mean square of the slope of the force over the position [N2]."""
    moved = np.concatenate([b.x[run] for run in runs])
    force = np.concatenate([s.area * b.ps[run] for run in runs])
    slope = np.polyval(np.polyder(np.polyfit(moved, force, CURVED)), moved)
    return float(np.mean(slope**2))


def _plug_noise(b: Blocks, runs: list[slice], gain: Floats) -> float:
    """Return the variance that noise of p1, p2 puts into the force [N2]."""
    if steady(b):
        return 0.0
    thirds = np.concatenate([np.diff(gain[run] * b.dp[run], 3) for run in runs])
    plug = 1.4826 * float(np.median(np.abs(thirds))) / np.sqrt(20.0)
    return float(plug**2 / CALM)


def _acceleration(b: Blocks) -> Floats:
    """Return the acceleration [strokes/s2]; 0 where a neighbour is missing."""
    found = np.zeros(len(b.x))
    whole = b.index[2:] - b.index[:-2] == 2
    found[1:-1] = np.where(whole, np.diff(b.x, 2), 0.0) / b.width**2
    return found


def _smoothing(width: float, T: float) -> float:
    """Return the share of the variance of white noise that passes the lag."""
    return float(np.sum(lag_response(width, T, LONGEST) ** 2))


def _refine(score: dict[float, float], at_lag: Callable[[float], float]) -> tuple[float, float]:
    """Narrow the grid around its least value; where chi-square grows by 1 is the deviation."""
    for _ in range(4):
        grid = sorted(score)
        i = grid.index(min(grid, key=lambda T: score[T]))
        for j in (i - 1, i):
            if 0 <= j < len(grid) - 1:
                middle = 0.5 * (grid[j] + grid[j + 1])
                score[middle] = at_lag(middle)
    grid = sorted(score)
    best = min(grid, key=lambda T: score[T])
    near = [T for T in grid if score[T] <= score[best] + 4.0]
    return best, max((max(near) - min(near)) / 4.0, LEAST_STD)
