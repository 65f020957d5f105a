# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Sliding told from sticking and slipping, by the shape of the motion within a block.

A stem that sticks and slips moves by stairs, often many in a second. Over a block it bears a
force between dry and static friction: taken for sliding, it puts up the friction of the valve,
and with it turns the spring, for it seldom sticks alike both ways and everywhere.
"""

import math

from damadics_fd.core.jit import jit
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.state import Blocks

# stairs stand out beyond the noise, and by this much of the way
STAIRS, BEYOND_NOISE = 0.12, 4.0
STICKING = 0.15  # by which a stem that sticks and slips rubs more than a sliding one
STICKY_DOUBT = 9.0  # such a block counts a tenth


@jit
def follow_roughness(s: Blocks, c: SignatureSettings) -> None:
    """
    Shift the roughness of the finished block into the history, and follow what is noise.

    :param s: state record: br and noise are written.
    :param c: settings record.
    """
    rough = roughness(s, c)
    if s.noise <= 0.0:
        s.noise = rough
    s.noise *= 0.97 if rough < s.noise else 1.01  # at rest where a quarter is below
    s.br[0] = s.br[1]
    s.br[1] = s.br[2]
    s.br[2] = max(rough, c.carried * s.br[1])


@jit
def undelayed(s: Blocks, c: SignatureSettings, offset: float, x: float) -> float:
    """
    Return the position before `transmitter.delay`, which would smooth its stairs.

    :param s: state record: the sample before is read and replaced.
    :param c: settings record with ps_lag [s].
    :param offset: [s] time since the start.
    :param x: position / stroke, as late as the chamber pressure.
    :return: position / stroke; after a gap of one block the late one.
    """
    dt = offset - s.late_t
    raw = x
    if 0.0 < dt < c.block:
        raw = s.late_x - (x - s.late_x) / math.expm1(-dt / c.ps_lag)
    s.late_x = x
    s.late_t = offset
    return raw


@jit
def roughness(s: Blocks, c: SignatureSettings) -> float:
    """
    Tell how far the motion within the finished block is from a straight one.

    :param s: state record; its sums are read.
    :param c: settings record.
    :return: variance of the position about its line, noise included.
    """
    x = (s.sr if c.ps_lag > 0.0 else s.sx) / s.n
    t = s.st / s.n - s.index * c.block
    spread = s.stt / s.n - t * t
    both = s.srt / s.n - x * t
    return max(s.srr / s.n - x * x - both * both / max(spread, 1e-12), 0.0)


@jit
def sticks(s: Blocks, c: SignatureSettings, v: float) -> bool:
    """
    Tell whether the stem sticks and slips about the middle block.

    A block may lie within one slip, so that its neighbours tell as well.

    :param s: state record.
    :param c: settings record.
    :param v: [1/s] velocity of the block.
    :return: True where it moves by stairs.
    """
    way = STAIRS * v * c.block
    rough: float = max(s.br[0], max(s.br[1], s.br[2]))
    return rough > max(BEYOND_NOISE * s.noise, s.noise + way * way)
