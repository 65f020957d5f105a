# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bring pressure filter, stem models and flow law to the time of a sample."""

import math

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.judging.fuse import filter_pressures
from damadics_fd.core.scada.judging.gap import (
    GAP_PERIODS,
    MOST_THROWN,
    SETTLING_PERIODS,
    begin_again,
    bridge,
    miss,
    missing,
    restart,
)
from damadics_fd.core.scada.judging.meter import METER_LAGS, follow_meter
from damadics_fd.core.scada.judging.pressure import predict_pressure
from damadics_fd.core.scada.judging.spikes import cv_came_back, cv_jumped
from damadics_fd.core.scada.laws.actuator import nominal_flow
from damadics_fd.core.scada.laws.flow_law import characteristic, sizing
from damadics_fd.core.scada.laws.stem_law import advance_track, position
from damadics_fd.core.scada.model import advance_two, copy_stem
from damadics_fd.core.scada.settings import ScadaConfig
from damadics_fd.core.scada.state import HISTORY_LENGTH, LAW, MonitorState, Reference

OTHER_PERIOD = 1.6  # factor between two sample periods that are not the same
STRANGE = 20  # samples in a row
COPIES = 2  # rows in a row that may be copies
AWAY_PERIODS = 1.5  # that a wrong CV may stay away
AT_END = 3.0  # standard deviations of the noise from the end of a range
BLIND = 2  # samples without a pressure that the stated stem is carried over


@jit
def watch_period(s: MonitorState, cfg: ScadaConfig, ref: Reference, t: float) -> None:
    """Make no test while samples come at another period than the one that was learned."""
    if s.samples == 0 or not ref.regular:
        return
    share = (t - s.t) / max(cfg.period_s, ref.period)
    s.strange = s.strange + 1 if share > OTHER_PERIOD or share * OTHER_PERIOD < 1.0 else 0
    if s.strange >= STRANGE:
        s.t_test = max(s.t_test, t + ref.period)


@jit
def count_repeats(s: MonitorState, cv: float, x: float, p1: float, p2: float, flow: float) -> None:
    """Count samples in a row whose values are all those of the sample before."""
    now = (cv, x, p1, p2, flow)
    same = True
    for i in range(5):
        value = now[i]
        before = s.last[0, i]
        if value != before and not (math.isnan(value) and math.isnan(before)):
            same = False
        s.last[3, i] = s.last[2, i]
        s.last[2, i] = s.last[1, i]
        s.last[1, i] = before
        s.last[0, i] = value
    s.repeats = s.repeats + 1 if same else 0


@jit
def repeated(s: MonitorState) -> bool:
    """
    Tell whether a sample is a copy of the one before, as historians make where one is late.

    More than a few in a row are a valve at rest or a compressed record, not copies.
    """
    return 0 < s.repeats <= COPIES


@jit
def stands_still(s: MonitorState, ref: Reference) -> bool:
    """Tell whether the record shows the same row for longer than it did while learning."""
    return s.repeats > max(COPIES, ref.longest_repeat)


@jit
def predict(
    s: MonitorState,
    cfg: ScadaConfig,
    ref: Reference,
    t: float,
    cv: float,
    x: float,
    p1: float,
    p2: float,
    t1: float,
    flow: float,
) -> None:
    """
    Bring filter, models and regressors to the sample at t.

    :param s: record of `MonitorState`.
    :param cfg: record of `SETTINGS`.
    :param ref: record of `REFERENCE`.
    :param t: time, s; the other inputs are scaled to 0..1, NaN for t1, flow where not measured.
    """
    if s.samples == 0:
        s.t_first = t
        s.t_test = t + cfg.t_on_s
        s.t_lagged[:] = t
        s.level[:] = math.nan
        restart(s, cfg, ref, t, cv, x, p1, p2)
    elif t - s.t > max(cfg.gap_s, GAP_PERIODS * ref.period):
        begin_again(s, cfg, ref, t)
        restart(s, cfg, ref, t, cv, x, p1, p2)
    gap = ref.regular and missing(ref, (t - s.t) / max(cfg.period_s, ref.period))
    watch_period(s, cfg, ref, t)
    stood_still = stands_still(s, ref)
    entry = s.history[s.samples % HISTORY_LENGTH]
    t0 = s.t if s.filled > 0 else t
    s.samples += 1
    s.t = t
    count_repeats(s, cv, x, p1, p2, flow)
    if stood_still and s.repeats == 0:
        bridge(s, ref, t)
        s.t_flow = max(s.t_flow, t + METER_LAGS * max(ref.flow_law.lag_s, ref.period))
    if cv_came_back(s, ref):
        bridge(s, ref, t)
        s.thrown = 0 if ref.stem_kind == LAW else MOST_THROWN
    elif cv_jumped(s, ref):
        s.t_stem = max(s.t_stem, t + AWAY_PERIODS * ref.period)
    if not repeated(s) and not stands_still(s, ref):
        advance_track(s.track, ref.stem_law, t, cv)
    if gap and s.filled > 0:
        miss(s, ref, cv, t - t0)
    law = ref.stem_kind == LAW
    if not law:
        copy_stem(s.stem[0], entry.stem)
    period = max(cfg.period_s, ref.period)
    s.steady = s.steady + 1 if t - t0 < 1.5 * period else 1
    filter_pressures(s, ref, p1, p2)
    z2 = s.dp[1]
    z1 = s.dp[0]
    z0 = s.p_hat[0] - s.p_hat[1]
    s.blind = s.blind + 1 if math.isnan(z0) else 0
    if s.blind > 0:
        z0 = z1
    if s.blind > BLIND and not law:
        s.t_stem = max(s.t_stem, t + SETTLING_PERIODS * ref.period)
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
    entry.cv = cv
    if law:
        s.xm[0] = position(s.track, ref.stem_law, 0)
        s.xs = position(s.track, ref.stem_law, 1)
        s.xq = position(s.track, ref.stem_law, 2)
        s.xd = s.xm[0]
    elif s.filled > 0:
        dt = t - t0
        regular = s.filled >= 2 and dt < 1.5 * period
        if s.blind > 0:
            pass  # the drop stays what it was
        elif regular:
            following = predict_pressure(ref.pressure[0], s.past[0])
            following -= predict_pressure(ref.pressure[1], s.past[1])
            slope0 = (z0 - z2) / (2.0 * dt)
            slope1 = (following - z1) / (2.0 * dt)
        else:
            slope0 = (z0 - z1) / dt
            slope1 = slope0
        cv1 = s.cv[1] if ref.hold else cv
        s.xm[0], s.xd = advance_two(
            s.stem[0],
            s.stem[1],
            cfg.act,
            s.fault[0],
            s.fault[1],
            t0,
            t,
            s.cv[1],
            cv1,
            z1,
            z0,
            slope0,
            slope1,
        )
        s.xs = s.xm[0]
        s.xq = s.xm[0]
        entry.cv = cv1
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
    if ref.flow_kind == LAW:
        predict_by_law(s, ref, t, x, p1, p2, t1, flow)
    else:
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
def predict_flow(
    s: MonitorState, cfg: ScadaConfig, ref: Reference, x: float, t1: float, flow: float
) -> None:
    """Predict F' from the valve equation, with the sigma that follows from the sensors' noise."""
    s.f = math.nan
    s.f_model = math.nan
    s.sq = 1.0
    s.masked = True
    p1 = s.p_hat[0]
    p2 = s.p_hat[1]
    if math.isnan(p1 + p2 + t1 + flow):
        return
    s.f = nominal_flow(cfg.act, x, p1, p2, t1)
    fx = (
        nominal_flow(cfg.act, x + 0.002, p1, p2, t1) - nominal_flow(cfg.act, x - 0.002, p1, p2, t1)
    ) / 0.004
    fp = s.f / (2.0 * max(p1 - p2, 0.02))
    c = ref.pressure[0].c + ref.pressure[1].c
    s.sq = cfg.sigma * math.sqrt(1.0 + fx * fx + fp * fp * c)
    # the mask follows the model: one on the noisy f itself would select f's errors
    s.f_model = nominal_flow(cfg.act, s.xm[0], p1, p2, t1)
    saturated = s.f > cfg.flow_high and flow > cfg.flow_high and s.f_model > cfg.model_high
    s.masked = saturated or shut(s, cfg, x, t1, flow)


@jit
def shut(s: MonitorState, cfg: ScadaConfig, x: float, t1: float, flow: float) -> bool:
    """
    Tell whether X' and F' are at their other ends, where both say no more than this.

    A flow that noise of X' does not explain there is a leak, and is judged.
    """
    noise = AT_END * cfg.sigma
    if max(x, s.xm[0]) < 1.0 - noise:
        return False
    least = nominal_flow(cfg.act, 1.0 - 2.0 * noise, s.p_hat[0], s.p_hat[1], t1)
    no_more: bool = flow < least + noise
    return no_more


@jit
def predict_by_law(
    s: MonitorState,
    ref: Reference,
    t: float,
    x: float,
    p1: float,
    p2: float,
    t1: float,
    flow: float,
) -> None:
    """Predict F' by the flow law; sigma is that of the meter and of what the record left."""
    law = ref.flow_law
    s.f = math.nan
    s.sq = 1.0
    s.masked = True
    if flow > s.top_flow:
        s.top_flow = flow
        s.top_count = 1
    elif flow == s.top_flow:
        s.top_count += 1
    s.size = sizing(law.medium, p1, p2, t1)
    if math.isnan(x) or math.isnan(s.size) or math.isinf(s.size):
        return
    f = math.exp(characteristic(law, x) + s.size)
    follow_meter(s, ref, t, f)
    if math.isnan(flow):
        return
    s.f = s.f_lagged[0]
    s.sq = math.sqrt(law.noise * law.noise + s.f * s.f * law.spread * law.spread)
    s.masked = False
