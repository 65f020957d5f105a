# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled step of the SCADA-rate monitor: one sample into two residuals and the tests."""

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.judging.air import LOOKS, seek_air
from damadics_fd.core.scada.judging.decide import decide
from damadics_fd.core.scada.judging.predict import predict
from damadics_fd.core.scada.judging.residuals import residuals
from damadics_fd.core.scada.settings import ScadaConfig
from damadics_fd.core.scada.state import MonitorState, Reference


@jit
def accepts(s: MonitorState, cfg: ScadaConfig, t: float) -> bool:
    """Tell whether a sample at t is due, thinning faster input to the monitor's period."""
    interval = t - s.t_raw
    s.t_raw = t
    due: bool = s.samples == 0 or t - s.t >= (cfg.period_s - 0.5 * min(interval, cfg.period_s))
    return due


@jit
def step(
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
    """Take one accepted sample, scaled to 0..1, through prediction, residuals and tests."""
    predict(s, cfg, ref, t, cv, x, p1, p2, t1, flow)
    residuals(s, ref, x, p1, p2, t1, flow)
    decide(s, ref)
    if s.air_looks < len(LOOKS):
        seek_air(s, cfg, ref)
