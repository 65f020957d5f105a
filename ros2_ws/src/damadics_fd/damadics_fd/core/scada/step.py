# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled step of the SCADA-rate monitor: one sample into two residuals and the tests."""

import math
from typing import Any

import numpy as np

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.actuator import nominal_flow
from damadics_fd.core.scada.cusum import FRICTION_TEST, P1, P2, R1, R2, T1, TESTS
from damadics_fd.core.scada.model import advance_stem, copy_stem, start_stem
from damadics_fd.core.scada.pressure import (
    TAPS,
    fuse_pressure,
    innovation,
    predict_pressure,
    push,
)
from damadics_fd.core.scada.state import HISTORY_LENGTH, N_TESTS, N_WEIGHTS

LLR_CLIP = 8.0
TEST_RESIDUAL = np.array([test.residual for test in TESTS])


@jit
def restart(s: Any, cfg: Any, t: float, cv: float, p1: float, p2: float) -> None:
    """Start the models and the pressure filter at this sample."""
    start_stem(s.stem[0], cfg.act, t)
    copy_stem(s.stem[0], s.stem[1])
    s.fault[1].f4 = cfg.wide_play - cfg.act.stem_play
    s.filled = 0
    s.steady = 0
    for i in range(4):
        s.cv[i] = cv
    s.dp[0] = p1 - p2
    s.dp[1] = p1 - p2
    s.xm[:] = 0.0
    s.xd = 0.0
    for i in range(TAPS):
        s.past[0, i] = p1
        s.past[1, i] = p2
    s.p_hat[0] = p1
    s.p_hat[1] = p2


@jit
def predict(
    s: Any,
    cfg: Any,
    ref: Any,
    t: float,
    cv: float,
    x: float,
    p1: float,
    p2: float,
    t1: float,
    flow: float,
) -> None:
    """
    Bring filter, models and regressors to the sample at t (sheet steps 1, 2, 4).

    :param s: record of `MONITOR`.
    :param cfg: record of `SETTINGS`.
    :param ref: record of `REFERENCE`.
    :param t: time, s; the other inputs are scaled to 0..1, NaN for t1, flow where not measured.
    """
    if s.samples == 0:
        s.t_first = t
        s.t_test = t + cfg.t_on_s
        restart(s, cfg, t, cv, p1, p2)
    elif t - s.t > cfg.gap_s:
        s.t_test = max(s.t_test, t + cfg.settle_s)
        restart(s, cfg, t, cv, p1, p2)
    entry = s.history[s.samples % HISTORY_LENGTH]
    copy_stem(s.stem[0], entry.stem)
    t0 = s.t if s.filled > 0 else t
    s.samples += 1
    s.t = t
    if s.filled >= TAPS:
        s.p_hat[0] = fuse_pressure(ref.pressure[0], s.past[0], p1)
        s.p_hat[1] = fuse_pressure(ref.pressure[1], s.past[1], p2)
    else:
        s.p_hat[0] = p1
        s.p_hat[1] = p2
    s.steady = s.steady + 1 if t - t0 < 1.5 * cfg.period_s else 1
    s.innovation[:] = math.nan
    if s.steady > TAPS:
        s.innovation[0] = innovation(ref.pressure[0], s.past[0], p1)
        s.innovation[1] = innovation(ref.pressure[1], s.past[1], p2)
    push(s.past[0], p1)
    push(s.past[1], p2)
    z2 = s.dp[1]
    z1 = s.dp[0]
    z0 = s.p_hat[0] - s.p_hat[1]
    s.dp[1] = z1
    s.dp[0] = z0
    for i in range(3, 0, -1):
        s.cv[i] = s.cv[i - 1]
    s.cv[0] = cv
    s.xm[2] = s.xm[1]
    s.xm[1] = s.xm[0]
    if abs(cv - s.cv[1]) > ref.cv_jump:
        s.t_stem = t + cfg.settle_s
    slope0 = 0.0
    slope1 = 0.0
    if s.filled > 0:
        dt = t - t0
        regular = s.filled >= 2 and dt < 1.5 * cfg.period_s
        if regular:
            following = predict_pressure(ref.pressure[0], s.past[0])
            following -= predict_pressure(ref.pressure[1], s.past[1])
            slope0 = (z0 - z2) / (2.0 * dt)
            slope1 = (following - z1) / (2.0 * dt)
        else:
            slope0 = (z0 - z1) / dt
            slope1 = slope0
        cv1 = s.cv[1] if ref.hold else cv
        s.xm[0] = advance_stem(
            s.stem[0], cfg.act, s.fault[0], t0, t, s.cv[1], cv1, z1, z0, slope0, slope1
        )
        s.xd = advance_stem(
            s.stem[1], cfg.act, s.fault[1], t0, t, s.cv[1], cv1, z1, z0, slope0, slope1
        )
        entry.cv = cv1
    else:
        entry.cv = cv
    s.filled += 1
    xm = s.xm[0]
    s.phi[0] = 1.0
    s.phi[1] = xm - 0.5
    s.phi[2] = 30.0 * (cv - s.cv[1])
    for i in range(4):
        s.phi[3 + i] = s.cv[i] - xm
    s.phi[7] = s.xm[1] - xm
    s.phi[8] = s.xm[2] - xm
    s.phi[9] = z0 - ref.dp_mean
    s.phi[10] = z1 - ref.dp_mean
    predict_flow(s, cfg, ref, x, t1, flow)
    entry.t0 = t0
    entry.t = t
    entry.cv0 = s.cv[1]
    entry.dp0 = z1
    entry.dp = z0
    entry.slope0 = slope0
    entry.slope = slope1
    entry.x = x
    entry.p1 = s.p_hat[0]
    entry.p2 = s.p_hat[1]
    entry.t1 = t1
    entry.flow = flow
    entry.f = s.f
    entry.sq = s.sq
    entry.masked = s.masked
    entry.xm = xm


@jit
def predict_flow(s: Any, cfg: Any, ref: Any, x: float, t1: float, flow: float) -> None:
    """Predict F' from the valve equation, with the sigma that follows from the sensors' noise."""
    s.f = math.nan
    s.sq = 1.0
    s.masked = True
    if math.isnan(t1) or math.isnan(flow):
        return
    p1 = s.p_hat[0]
    p2 = s.p_hat[1]
    s.f = nominal_flow(cfg.act, x, p1, p2, t1)
    fx = (
        nominal_flow(cfg.act, x + 0.002, p1, p2, t1) - nominal_flow(cfg.act, x - 0.002, p1, p2, t1)
    ) / 0.004
    fp = s.f / (2.0 * max(p1 - p2, 0.02))
    c = ref.pressure[0].c + ref.pressure[1].c
    s.sq = cfg.sigma * math.sqrt(1.0 + fx * fx + fp * fp * c)
    # the mask follows the model: one on the noisy f itself would select f's errors
    s.masked = (
        s.f > cfg.flow_high
        and flow > cfg.flow_high
        and nominal_flow(cfg.act, s.xm[0], p1, p2, t1) > cfg.model_high
    )


@jit
def residuals(s: Any, ref: Any, x: float, t1: float, flow: float) -> None:
    """Form r1 = X' - model, r2 = (F' - valve equation) / sigma and what the inputs show."""
    correction = 0.0
    for i in range(N_WEIGHTS):
        correction += ref.w[i] * s.phi[i]
    s.residual[R1] = x - s.xm[0] - correction
    s.residual[R2] = (flow - ref.g0 - ref.g1 * s.f) / s.sq  # NaN where not measured
    if s.masked and not math.isnan(s.f):
        s.residual[R2] = 0.0
    s.residual[P1] = s.innovation[0]
    s.residual[P2] = s.innovation[1]
    s.residual[T1] = t1
    entry = s.history[(s.samples - 1) % HISTORY_LENGTH]
    entry.correction = correction
    entry.r1 = s.residual[R1]
    entry.r2 = s.residual[R2]


@jit
def decide(s: Any, ref: Any) -> None:
    """Feed every test; the first statistic to reach its limit raises the alarm, which latches."""
    s.ratio = 0.0
    if s.t < s.t_test:
        s.g[:] = 0.0
        s.zero[:] = s.t
        s.llr = 0.0
        s.llr_zero = s.t
        s.ratios[:] = 0.0
        return
    onset = s.t
    for i in range(N_TESTS):
        value = s.residual[TEST_RESIDUAL[i]]
        if math.isnan(value) or not ref.sd[i] > 0.0:
            continue
        if s.masked and TEST_RESIDUAL[i] == R2:
            continue
        if s.t < s.t_stem and TEST_RESIDUAL[i] == R1:
            s.g[i, :] = 0.0
            s.zero[i, :] = s.t
            s.ratios[i] = 0.0
            continue
        z = (value - ref.mu[i]) / ref.sd[i]
        z = min(max(z, -ref.clip[i]), ref.clip[i])
        for side in range(2):
            g = s.g[i, side] + (z if side == 0 else -z) - ref.k[i]
            if g <= 0.0:
                g = 0.0
                s.zero[i, side] = s.t
            s.g[i, side] = g
        side = 0 if s.g[i, 0] >= s.g[i, 1] else 1
        s.ratios[i] = s.g[i, side] / ref.h[i]
        if s.ratios[i] > s.ratio:
            s.ratio = s.ratios[i]
            s.worst = i
            onset = s.zero[i, side]
    z1 = s.residual[R1] / ref.s1
    z1d = (s.residual[R1] + s.xm[0] - s.xd) / ref.s1
    gain = (z1 * z1 - z1d * z1d) / (2.0 * ref.kap2)
    s.llr += min(max(gain, -LLR_CLIP), LLR_CLIP)
    if s.llr <= 0.0 or s.t < s.t_stem:
        s.llr = 0.0
        s.llr_zero = s.t
    s.ratios[FRICTION_TEST] = s.llr / ref.llr_limit
    if s.ratios[FRICTION_TEST] > s.ratio:
        s.ratio = s.ratios[FRICTION_TEST]
        s.worst = FRICTION_TEST
        onset = s.llr_zero
    for i in range(N_TESTS + 1):
        s.peaks[i] = max(s.peaks[i], s.ratios[i])
    if s.ratio >= 1.0 and not s.alarm:
        s.alarm = True
        s.t_alarm = s.t
        s.t_onset = onset
        s.test = s.worst


@jit
def accepts(s: Any, cfg: Any, t: float) -> bool:
    """Tell whether a sample at t is due, thinning faster input to the monitor's period."""
    interval = t - s.t_raw
    s.t_raw = t
    due: bool = s.samples == 0 or t - s.t >= (cfg.period_s - 0.5 * min(interval, cfg.period_s))
    return due


@jit
def step(
    s: Any,
    cfg: Any,
    ref: Any,
    t: float,
    cv: float,
    x: float,
    p1: float,
    p2: float,
    t1: float,
    flow: float,
) -> None:
    """Take one accepted sample, scaled to 0..1, through prediction, residuals and tests."""
    predict(s, cfg, ref, t, cv, x, p1, p2, t1, flow)
    residuals(s, ref, x, t1, flow)
    decide(s, ref)
