# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Block means of 0.1 s: hum of 50 Hz and 60 Hz cancels, the rest of the noise becomes white.

The force is computed from the measured pressures and the raw position, so that position and
force of a block share their time; a filtered force lags behind by several block's noise.
"""

import math

from damadics_fd.core.jit import jit, layer
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.sliding import (
    STICKING,
    STICKY_DOUBT,
    follow_roughness,
    sticks,
    undelayed,
)
from damadics_fd.core.signature.state import (
    LAG,
    N_TABLE,
    ONE,
    PB,
    POS,
    POSX,
    SIGN,
    SIGN_T,
    STRIBECK,
    TABLE,
    X1,
    X1_T,
    Blocks,
    G,
    State,
    V,
)
from damadics_fd.core.valve.plug import recovery

SLOPE = 0.015  # [1] the slope of the plug force is taken over +- this part of the stroke
MPA = 1e6
STEADY = 1.0 / 3.0  # of the larger of the steps into and out of a block: less, and it stood
# Dry friction over the noise of a block: what a lag still carries of the stem at rest is unknown
# by this much.
START_DOUBT = 15.0


@jit
def plug_gain(c: SignatureSettings, x: float) -> float:
    """
    Interpolate the plug force per pressure difference.

    :param c: settings record.
    :param x: position / stroke.
    :return: A_plug / (FN Km(x)) in 1/Pa.
    """
    gain: float = c.plug_area / (c.force_scale * recovery(c.plug_km, x))
    return gain


@jit
def interrupt(s: Blocks) -> None:
    """
    Drop the block under construction and those before it.

    :param s: state record.
    """
    s.run = 0
    s.n = 0
    s.index = -1


@jit
def break_run(s: Blocks) -> None:
    """
    Let no block be judged with those before a gap.

    :param s: state record.
    """
    s.run = 0


@jit
def open_block(s: Blocks, index: int) -> None:
    """
    Start a new block.

    :param s: state record.
    :param index: number of the block since the start.
    """
    s.index = index
    s.n = 0
    s.sx = 0.0
    s.su = 0.0
    s.sp = 0.0
    s.sg = 0.0
    s.st = 0.0
    s.sr = 0.0
    s.srr = 0.0
    s.srt = 0.0
    s.stt = 0.0


@layer
def add_sample(
    s: Blocks, c: SignatureSettings, offset: float, x: float, ps: float, dp: float
) -> None:
    """
    Add one sample to the block under construction.

    :param s: state record.
    :param c: settings record.
    :param offset: [s] time since the start.
    :param x: position / stroke, as late as the chamber pressure.
    :param ps: [Pa] chamber pressure, gauge.
    :param dp: [Pa] P1 - P2.
    """
    pb = c.diaphragm_area * ps / c.force_scale
    within = offset - s.index * c.block
    raw = x
    if c.ps_lag > 0.0:
        raw = undelayed(s, c, offset, x)
        s.sr += raw
    s.n += 1
    s.sx += x
    s.sp += pb
    s.su += c.weight_share + pb - dp * plug_gain(c, x)
    s.sg += dp
    s.st += offset
    s.srr += raw * raw
    s.srt += raw * within
    s.stt += within * within


@jit
def close_block(s: Blocks, c: SignatureSettings) -> bool:
    """
    Finish the block under construction and shift it into the history of three.

    :param s: state record.
    :param c: settings record.
    :return: True if three successive blocks are whole, so that the middle one can be judged.
    """
    if s.n < c.min_samples:
        s.run = 0  # a block is judged with its two neighbours: this discards them too
        return False
    for i in range(2):
        s.bx[i] = s.bx[i + 1]
        s.bu[i] = s.bu[i + 1]
        s.bp[i] = s.bp[i + 1]
        s.bdp[i] = s.bdp[i + 1]
        s.bt[i] = s.bt[i + 1]
    s.bx[2] = s.sx / s.n
    s.bu[2] = s.su / s.n
    s.bp[2] = s.sp / s.n
    s.bdp[2] = s.sg / s.n
    s.bt[2] = s.st / s.n
    follow_roughness(s, c)
    s.run += 1
    whole: bool = s.run >= 3
    return whole


@jit
def table_node(x: float) -> tuple[int, float]:
    """
    Find the nodes of the plug force correction around a position.

    :param x: position / stroke.
    :return: lower node and the share of the upper one.
    """
    node = min(max(x, 0.0), 1.0) * (N_TABLE - 1)
    i = min(int(node), N_TABLE - 2)
    return i, node - i


@jit
def table_force(s: State, c: SignatureSettings, x: float, dp: float) -> float:
    """
    Return the learned correction of the plug force.

    :param s: state record.
    :param c: settings record.
    :param x: position / stroke.
    :param dp: [Pa] P1 - P2.
    :return: force / FN.
    """
    i, share = table_node(x)
    correction = (1.0 - share) * s.theta[TABLE + i] + share * s.theta[TABLE + i + 1]
    force: float = correction * dp * plug_gain(c, x)
    return force


@jit
def regressor(s: State, c: SignatureSettings, slow: float, sticky: bool) -> None:
    """
    Fill the regressor of the model and of every hypothesis.

    :param s: state record: x, v and the middle block are read, ph is written.
    :param c: settings record.
    :param slow: share of the Stribeck friction at this speed.
    :param sticky: the stem stuck and slipped within the block.
    """
    x = s.block.x
    dp = s.bdp[1]
    gain = plug_gain(c, x)
    slope = dp * (plug_gain(c, x + SLOPE) - plug_gain(c, x - SLOPE)) / (2.0 * SLOPE)
    ph = s.block.ph
    ph[X1] = x + c.preload
    ph[ONE] = 1.0
    ph[V] = s.block.v
    sign = 1.0 if s.block.v > 0.0 else -1.0
    ph[SIGN] = sign * (1.0 + STICKING) if sticky else sign
    ph[TABLE : TABLE + N_TABLE] = 0.0
    i, share = table_node(x)
    ph[TABLE + i] = (1.0 - share) * dp * gain
    ph[TABLE + i + 1] = share * dp * gain
    ph[LAG] = gain * (s.bdp[2] - s.bdp[0]) / (s.bt[2] - s.bt[0])
    ph[STRIBECK] = sign if sticky else sign * slow
    ph[SIGN_T] = 0.0
    ph[X1_T] = 0.0
    ph[PB] = s.bp[1]
    ph[G] = MPA * gain
    ph[POS] = -(s.theta[X1] + slope)
    ph[POSX] = ph[POS] * x


@jit
def let_grow(s: State, tau: float) -> None:
    """
    Fill the columns of changes that grow.

    :param s: state record; ph is written.
    :param tau: time since the alarm, as `growth_time` counts it.
    """
    ph = s.block.ph
    ph[SIGN_T] = ph[SIGN] * tau
    ph[X1_T] = ph[X1] * tau


@jit
def judge_block(s: State, c: SignatureSettings) -> None:
    """
    Classify the middle block as moving, standing or neither and build its regressor.

    :param s: state record; sets moving, standing, slide, x, u, v, w and, if moving, ph.
    :param c: settings record.
    """
    x = s.bx[1]
    d1 = x - s.bx[0]
    d2 = s.bx[2] - x
    v = (s.bx[2] - s.bx[0]) / (s.bt[2] - s.bt[0])
    low = min(s.bx[0], min(x, s.bx[2]))
    high = max(s.bx[0], max(x, s.bx[2]))
    in_range = c.range_gate < low and high < 1.0 - c.range_gate
    step = 0.5 * c.v_min * c.block
    fast = c.v_min <= abs(v) < c.v_max
    s.block.x = x
    s.block.u = s.bu[1]
    s.block.v = v
    s.block.moving = 0
    s.block.standing = 0
    if s.run <= 3:
        s.slide = 0  # the first block after a gap
    # equal signs drop reversals; the minima drop blocks in which the stem breaks away or stops
    steps = abs(d1), abs(d2)
    steady = d1 * d2 > 0.0 and min(steps) >= max(step, STEADY * max(steps))
    if in_range and fast and steady:
        s.block.moving = 1
        s.slide += 1
        slow = math.exp(-((v / c.v_stribeck) ** 2))
        sticky = sticks(s, c, v)
        doubtful = STICKY_DOUBT if sticky else 0.0
        begun = (START_DOUBT * c.carried**s.slide) ** 2
        s.block.w = 1.0 / (1.0 + max(c.stribeck_weight * slow, doubtful, begun))
        s.block.age = s.block.w if sticky or begun > 1.0 else 1.0
        regressor(s, c, slow, sticky)
        return
    s.slide = 0
    if in_range and abs(v) < c.v_min and max(abs(d1), abs(d2)) < 3.0 * step:
        s.block.standing = 1
