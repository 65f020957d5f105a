# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Linear regression of the force balance: its columns, its priors, least squares."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from damadics_fd.commands.commission.forces.lag import STRIBECK, Mask, plug_per_pascal
from damadics_fd.commands.commission.signals import Blocks, calm
from damadics_fd.core.record import Floats
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.sliding import STICKING

VISCOUS_STD = 0.3  # how well a data sheet's viscous friction is known, as a share
MILD = 0.15  # viscous share of friction at the usual speed, give or take as much
K, ONE, V, S, SLOW, LATE, TABLE = range(7)


@dataclass(frozen=True)
class Fit:
    """Hold one least-squares fit."""

    theta: Floats
    covariance: Floats
    sigma: float
    objective: float
    left: Floats


def blur_of(b: Blocks, use: Mask, s: Settings) -> float:
    """
    Return what noise of x1 does to the velocity of a block.

    :param b: blocks.
    :param use: those that are fitted.
    :param s: settings with the stroke.
    :return: variance [m2/s2].
    """
    thirds = np.abs(np.diff(b.x, 3))[use[:-3] & use[3:] & (b.index[3:] - b.index[:-3] == 3)]
    noise = 1.4826 * float(np.median(thirds)) / np.sqrt(20.0) if len(thirds) else 0.0
    return float(2.0 * (s.stroke * noise / (2.0 * b.width)) ** 2)


def regressor(b: Blocks, s: Settings) -> tuple[Floats, Floats, Floats]:
    """
    Return what the balance of blocks is made of.

    :param b: blocks.
    :param s: settings.
    :return: force with the plug force of the settings taken off [N]; columns of K, b, c, Fc,
        Stribeck friction and lag of P1 - P2, shape (n, 6); hat functions times plug force.
    """
    air = 1.0 if s.air_to == 'close' else -1.0
    flow = 1.0 if s.flow_to == 'open' else -1.0
    gain = flow * plug_per_pascal(s, b.x)
    plug = gain * b.dp
    v = np.nan_to_num(b.v)
    sign, sticky = np.sign(v), b.sticky
    slow = np.where(sticky, 1.0, np.exp(-((v / STRIBECK) ** 2)))
    columns = np.stack(
        [
            s.stroke * b.x,
            np.ones(len(v)),
            s.stroke * v,
            np.where(sticky, 1.0 + STICKING, 1.0) * sign,
            sign * slow,
            gain * b.rate_dp,
        ],
        axis=1,
    )
    hats = np.clip(1.0 - np.abs(b.x[:, None] * 10.0 - np.arange(11)), 0.0, 1.0)
    force = s.mass * s.gravity + air * s.area * b.ps - plug
    return force, columns, (gain * calm(b))[:, None] * hats


def solve(
    A: Floats,
    y: Floats,
    precision: Floats,
    mean: Floats,
    floor: float,
    weights: Floats,
    blur: float = 0.0,
) -> Fit:
    """
    Fit by least squares with a prior; outliers count less.

    :param A: columns, shape (n, p).
    :param y: [N], shape (n,).
    :param precision: inverse covariance of the prior, shape (p, p).
    :param mean: of the prior, shape (p,).
    :param floor: least standard deviation of the noise [N].
    :param weights: weight of each row, shape (n,).
    :param blur: variance of the noise in the column of the velocity, which would pull the
        viscous friction to zero.
    :return: the fit.
    """
    sigma, weight = max(float(np.std(y)), floor), weights
    theta: Floats = mean
    H, left = precision, y
    for _ in range(6):
        H = (A * weight[:, None]).T @ A / sigma**2
        known = 1.0 / max(float(np.linalg.pinv(H)[V, V]), 1e-300)
        H[V, V] -= min(blur * float(weight.sum()) / sigma**2, 0.999 * known)
        H += precision
        right = (A * weight[:, None]).T @ y / sigma**2 + precision @ mean
        theta = np.asarray(np.linalg.solve(H, right), float)
        left = y - A @ theta
        spread = max(1.4826 * float(np.median(np.abs(left[weights > 0.3 * weights.max()]))), floor)
        weight = weights * np.minimum(1.0, 3.0 * spread / np.maximum(np.abs(left), 1e-12))
        sigma = max(float(np.sqrt(np.sum(weight * left**2) / np.sum(weight))), floor)
    change = theta - mean
    objective = float(np.sum(weight * left**2)) / sigma**2 + float(change @ precision @ change)
    objective += 2.0 * len(y) * float(np.log(sigma))
    return Fit(theta, np.asarray(np.linalg.inv(H), float), sigma, objective, left)


def prior_of(sheet: Settings, given: Collection[str], size: int) -> tuple[Floats, Floats]:
    """
    Return a prior: weak for spring and dry friction, mild for the viscous one.

    :param sheet: what the data sheet says.
    :param given: names of the settings that the user stated.
    :param size: number of columns p.
    :return: precision, shape (p, p), and mean, shape (p,).
    """
    KL = sheet.stiffness * sheet.stroke
    std = np.array([1e3 * sheet.stiffness, 1e3 * KL, 1e9, 1e9, 0.02 * KL, 0.05])
    mean = np.zeros(size)
    if 'alpha1' in given:
        mean[V] = sheet.alpha1 * sheet.mass
        std[V] = VISCOUS_STD * max(mean[V], 1.0)
    precision = np.zeros((size, size))
    precision[:6, :6] = np.diag(1.0 / std**2)
    return precision, mean


def add_viscous_prior(
    precision: Floats, mean: Floats, A: Floats, y: Floats, v: Floats, given: Collection[str]
) -> None:
    """
    Lean, where one speed cannot tell dry from viscous friction, on a mild viscous share.

    :param precision: of the prior, shape (p, p), changed.
    :param mean: of the prior, shape (p,), changed.
    :param A: columns, shape (n, p).
    :param y: [N], shape (n,).
    :param v: [strokes/s], shape (n,).
    :param given: names of the settings that the user stated.
    """
    if 'alpha1' in given:
        return
    few = np.delete(A, [V, SLOW], axis=1)
    theta = np.linalg.lstsq(few, y, rcond=None)[0]
    speed = float(np.median(np.abs(A[:, V])))
    total = abs(float(theta[S - 1])) + 1e-9  # the column of Fc has moved up by one
    mean[V] = MILD * total / max(speed, 1e-9)
    precision[V, V] = (max(speed, 1e-9) / (MILD * total)) ** 2
