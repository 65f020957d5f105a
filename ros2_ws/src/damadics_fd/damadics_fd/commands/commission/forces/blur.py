# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
What noise of the position does to strokes that are fitted through a lag.

Noise enters the fitted force by the spring and, where it is steeper, by the plug force table, and
by the velocity. A lag smooths it, so that of two lags the longer one leaves less for the noise
alone. What it leaves of it is known beforehand and is taken off.
"""

from typing import NamedTuple

import numpy as np

from damadics_fd.commands.commission.signals import Blocks
from damadics_fd.core.record import Floats

STILL, MOVING, CHANGING = range(3)  # a column goes with position, velocity or acceleration
MOST = 0.9  # of the square of what is fitted, that noise may be


class Slopes(NamedTuple):
    """How the columns of strokes follow the position."""

    kind: tuple[int, ...]  # of each column
    by_kind: Floats  # (strokes, length, columns): derivative by what the kind names


def position_noise(b: Blocks) -> float:
    """
    Return what noise leaves in the position of a block.

    :param b: blocks of the whole recording; most of them rest or move steadily.
    :return: variance, in strokes squared.
    """
    whole = b.index[3:] - b.index[:-3] == 3
    thirds = np.abs(np.diff(b.x, 3))[whole]
    if not len(thirds):
        return 0.0
    # the third difference of white noise has 20 times its variance
    return float((1.4826 * np.median(thirds)) ** 2 / 20.0)


def lag_response(width: float, T: float, length: int) -> Floats:
    """
    Return what a lag makes of one block that stands out by 1.

    :param width: of a block [s].
    :param T: lag [s].
    :param length: blocks.
    :return: the response, beginning with that block.
    """
    found = np.zeros(length)
    found[0] = 1.0
    if T > 0.0:
        a = float(np.exp(-width / T))
        keep = (1.0 - a) * T / width
        found[0] = 1.0 - keep
        found[1:] = (a * found[0] + keep - a) * a ** np.arange(length - 1)
    return found


def noise_normal(slopes: Slopes, weight: Floats, fade: Floats, width: float, T: float) -> Floats:
    """
    Return what white noise of variance 1 adds to the normal matrix of strokes with a free start.

    :param slopes: of the columns.
    :param weight: of the blocks, (strokes, length).
    :param fade: how the free start fades, (length,).
    :param width: of a block [s].
    :param T: lag [s].
    :return: expected addition, (columns, columns).
    """
    length = weight.shape[1]
    h = np.concatenate([np.zeros(2), lag_response(width, T, length), np.zeros(1)])
    late, now, soon = h[:-2], h[1:-1], h[2:]  # of the block before, this one, the one after
    kernels = (now, (soon - late) / (2.0 * width), (soon - 2.0 * now + late) / width**2)
    after = np.subtract.outer(np.arange(length), np.arange(length)) + 1  # row after column
    reached = after >= 0
    if T > 0.0:
        reached[0] = False  # the start is free: its own noise is not in it
    response = [np.where(reached, k[np.maximum(after, 0)], 0.0) for k in kernels]
    norm = np.maximum(weight @ (fade * fade), 1e-300)[:, None]
    start = [(weight * fade) @ r for r in response]
    kinds = np.asarray(slopes.kind)
    total = np.zeros((len(kinds), len(kinds)))
    for a in range(len(kernels)):
        for b in range(a, len(kernels)):
            power = weight @ (response[a] * response[b]) - start[a] * start[b] / norm
            left = (power[:, :, None] * slopes.by_kind[:, :, kinds == a]).reshape(power.size, -1)
            part = left.T @ slopes.by_kind[:, :, kinds == b].reshape(power.size, -1)
            total[np.ix_(kinds == a, kinds == b)] = part
            total[np.ix_(kinds == b, kinds == a)] = part.T
    return total


def believable(normal: Floats, noise: Floats) -> Floats:
    """
    Return the share of a normal matrix that noise put there, so that enough of it is left.

    :param normal: positive definite, (columns, columns).
    :param noise: what it expects to be noise, likewise, not larger than it but by chance.
    :return: `noise`, or so much of it as leaves a tenth in every direction.
    """
    half = np.linalg.inv(np.linalg.cholesky(normal))
    share = float(np.linalg.eigvalsh(half @ noise @ half.T)[-1])
    found: Floats = noise * min(1.0, MOST / max(share, 1e-300))
    return found
