# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The positioner of a valve of one's own: how far its booster opens at which error.

Every positioner opens farther for a larger error: a proportional one along a line, a digital one
by steps beyond a dead band. The air that went into the chamber, over what a booster at full
opening would have let through, is fitted by a curve that never falls.
"""

from typing import NamedTuple

import numpy as np

from damadics_fd.commands.commission.forces.breakaway import SHORT
from damadics_fd.commands.commission.forces.lag import Mask
from damadics_fd.commands.commission.signals import GAP, Signals, blocks
from damadics_fd.core.approximator.transmitter import delay_column
from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats
from damadics_fd.core.settings import Settings

ATMOSPHERE, GAS = 101325.0, 287.0 * 293.0  # Pa; R T of air [J/kg]
ERRORS = np.array([1, 2, 3, 4.5, 6, 8, 11, 15, 22, 30, 45, 65, 95, 150, 400]) * 1e-3
LAGS = (0.002, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.18, 0.27, 0.4, 0.6, 0.9, 1.4, 2.0)  # s
RATES, BANDS = (0.08, 0.15, 0.3, 0.6, 1.2), (0.04, 0.1, 0.25)  # 1/s; strokes
CLEARLY = 0.8  # of what is left without an integral
ROUNDS, SWEEPS = 3, 300
HUNTING = 0.03  # of the stroke, about the set-point
ENOUGH = 200  # blocks after steps of the command, that are judged alone
STEP = 0.05  # of the stroke; smaller steps of the command do not count
LOOK = 3.0  # s after a step
STEEP = 1.5  # the flow's departure from the root law over the supply pressure, at most


class Positioner(NamedTuple):
    """What stands between command and chamber."""

    lag: float  # each of the two of the set-point filter [s]
    flow: float  # factor at full opening [kg/(s sqrt(Pa))]
    errors: Floats  # set-point less position, rising, 0 in the middle
    openings: Floats  # shares of the flow: > 0 fills, < 0 vents
    reset_rate: float  # of what it integrates of the error [1/s]; 0: a proportional one
    reset_band: float  # error beyond which it integrates nothing, and begins anew
    fill_slope: float  # growth of the flow beside the root law, over the supply pressure
    vent_slope: float
    left: float  # of the air's movement in strokes: the share that is not explained


class Path(NamedTuple):
    """What is searched for."""

    lag: float
    rate: float
    band: float


def find_positioner(signals: Signals, s: Settings) -> Positioner:
    """
    Fit opening over error, delay and flow law to the air that went into the chamber.

    :param signals: the samples.
    :param s: settings with supply_pressure, chamber_volume, area, stroke and air_to.
    :return: the positioner.
    """
    dt = np.diff(signals.t, prepend=-np.inf)
    dt[dt > GAP] = np.inf
    cv = delay_column(signals.cv, dt, s.ps_lag) if s.ps_lag > 0.0 else signals.cv
    b = blocks(signals, SHORT, s.ps_lag)
    x, ps = (np.interp(signals.t, b.t, column) for column in (b.x, b.ps))
    air = (ATMOSPHERE + b.ps) * (s.open_volume + s.signed_area * s.stroke * b.x) / GAS
    near = np.diff(b.index) == 1
    put = np.diff(air)[near]
    block = np.searchsorted(b.index, np.floor(signals.t / SHORT + 1e-6).astype(np.int64))
    block = np.minimum(block, len(b.index) - 1)
    count = np.maximum(np.bincount(block, minlength=len(b.index)), 1)
    drives = np.sqrt(np.maximum(np.stack([s.supply_pressure - ps, ps]), 0.0))
    share = ps / s.supply_pressure - 0.5

    def moved(column: Floats) -> Floats:
        """Return the air that a flow puts into the chamber from block to block."""
        mean = np.bincount(block, column, len(b.index)) / count
        whole: Floats = (0.5 * SHORT * (mean[1:] + mean[:-1]))[near]
        return whole

    def steps_at(path: Path) -> tuple[Floats, Floats]:
        error = s.air_sign * (delay_column(delay_column(cv, dt, path.lag), dt, path.lag) - x)
        if path.rate > 0.0:
            error += integral(error, dt, path.rate, path.band)
        edges = np.concatenate([[0.0], ERRORS])
        low, wide = edges[:-1, None], np.diff(edges)[:, None]
        up = np.clip((error[None, :] - low) / wide, 0.0, 1.0)
        down = np.clip((-error[None, :] - low) / wide, 0.0, 1.0)
        return up, down

    def fit(path: Path, slopes: tuple[float, float]) -> tuple[Floats, Floats, Floats]:
        up, down = steps_at(path)
        flows = drives * (1.0 + np.array(slopes)[:, None] * share)
        columns = [moved(step * flows[0]) for step in up]
        columns += [moved(-step * flows[1]) for step in down]
        A = np.stack(columns, axis=1)
        rises = rising(A.T @ A, A.T @ put)
        n = len(ERRORS)
        law = np.stack(
            [
                moved(sign * (rises[part] @ step) * drive * power)
                for sign, part, step, drive in (
                    (1.0, slice(0, n), up, drives[0]),
                    (-1.0, slice(n, None), down, drives[1]),
                )
                for power in (np.ones_like(share), share)
            ],
            axis=1,
        )
        return rises, put - A @ rises, law

    def loss(path: Path) -> float:
        return float(np.sum(fit(path, (0.0, 0.0))[1] ** 2))

    path = min((Path(lag, 0.0, 0.0) for lag in LAGS), key=loss)
    k = LAGS.index(path.lag)
    around = np.geomspace(LAGS[max(k - 1, 0)], LAGS[min(k + 1, len(LAGS) - 1)], 9)
    path = min((Path(float(lag), 0.0, 0.0) for lag in around), key=loss)
    resets = (Path(path.lag, rate, band) for rate in RATES for band in BANDS)
    reset = min(resets, key=loss)
    if loss(reset) < CLEARLY * loss(path):
        path = reset
    slopes = (0.0, 0.0)
    rises, left, law = fit(path, slopes)
    for _ in range(ROUNDS):
        c = np.linalg.lstsq(law, put, rcond=None)[0]
        steep = np.clip(c[1::2] / np.maximum(c[::2], 1e-9), 0.0, STEEP)
        slopes = (float(steep[0]), float(steep[1]))
        rises, left, law = fit(path, slopes)
    n = len(ERRORS)
    filling, venting = np.cumsum(rises[:n]), np.cumsum(rises[n:])
    top = max(float(filling[-1]), float(venting[-1]), 1e-15)
    errors = np.concatenate([-ERRORS[::-1], [0.0], ERRORS])
    openings = np.concatenate([-venting[::-1], [0.0], filling]) / top
    told = strokes(b.cv, b.x)[near]
    use = told if np.sum(told) >= ENOUGH else np.ones(len(put), bool)
    share_left = float(np.sum(left[use] ** 2)) / max(float(np.sum(put[use] ** 2)), 1e-300)
    return Positioner(path.lag, top, errors, openings, *path[1:], *slopes, share_left)


def strokes(cv: Floats, x: Floats) -> Mask:
    """
    Tell where the air of a stroke moves, from each block to the next.

    A stem that sticks hunts about its set-point, where noise decides: a stroke tells.

    :param cv: command, means of blocks.
    :param x: position, likewise.
    :return: one less.
    """
    steps = np.abs(np.diff(cv)) > STEP
    after = np.convolve(steps, np.ones(round(LOOK / SHORT)))[: len(steps)] > 0.5
    told: Mask = after & (np.abs(cv - x)[1:] > HUNTING)
    return told


@jit
def integral(error: Floats, steps: Floats, rate: float, band: float) -> Floats:
    """
    Integrate an error as a positioner does: near the set-point, within bounds.

    :param error: set-point less position.
    :param steps: time since the sample before [s]; infinite where it starts afresh.
    :param rate: [1/s].
    :param band: error beyond which it begins anew; half of it bounds the integral.
    :return: what is added to the error.
    """
    sums = np.zeros(len(error))
    held = 0.0
    for i in range(len(error)):
        if abs(error[i]) > band or steps[i] > GAP:
            held = 0.0
        else:
            held = min(max(held + rate * error[i] * steps[i], -0.5 * band), 0.5 * band)
        sums[i] = held
    return sums


def rising(H: Floats, g: Floats) -> Floats:
    """
    Solve least squares for rises that are not negative, by coordinates.

    :param H: normal matrix, (n, n).
    :param g: right-hand side.
    :return: the rises.
    """
    rises = np.zeros(len(g))
    diagonal = np.diag(H) * (1.0 + 1e-6) + 1e-12 * float(np.max(np.diag(H)))
    for _ in range(SWEEPS):
        for k in range(len(g)):
            rises[k] = max(rises[k] + (g[k] - H[k] @ rises) / diagonal[k], 0.0)
    return rises
