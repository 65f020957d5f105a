# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The flow as a meter shows it, which lags behind; a wrong sample leaves no trace in it."""

import math

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.judging.gap import GAP_PERIODS
from damadics_fd.core.scada.judging.spikes import wrong_before
from damadics_fd.core.scada.state import METER, MonitorState, Reference

SLOW_METER_S = 5.0  # a record in which the flow hardly moves does not tell the meter's lag
METER_LAGS = 3.0  # after a gap, until a flow meter shows the flow


@jit
def follow_meter(s: MonitorState, ref: Reference, t: float, f: float) -> None:
    """
    Bring what the meter shows to t.

    :param f: flow through the valve by its law. Where X or a pressure has come back from one
        wrong sample or two, the flow of these is forgotten.
    """
    law = ref.flow_law
    wrong = wrong_before(s, ref)
    lagged, slow, before = s.f_lagged[wrong], s.f_slow[wrong], s.t_lagged[wrong]
    if t - s.t_lagged[0] > GAP_PERIODS * ref.period:  # the meter may show what was before
        lagged = slow = math.nan
        s.t_flow = max(s.t_flow, t + METER_LAGS * law.lag_s)
    for i in range(METER - 1, 0, -1):
        s.f_lagged[i] = s.f_lagged[i - 1]
        s.f_slow[i] = s.f_slow[i - 1]
        s.t_lagged[i] = s.t_lagged[i - 1]
    s.f_lagged[0] = behind(lagged, f, t - before, law.lag_s)
    s.f_slow[0] = behind(slow, f, t - before, max(law.lag_s, SLOW_METER_S))
    s.t_lagged[0] = t


@jit
def behind(shown: float, f: float, dt: float, lag_s: float) -> float:
    """Return what a meter with a first-order lag shows, dt after it showed `shown`."""
    if math.isnan(shown) or not lag_s > 0.0:
        return f
    return shown + (1.0 - math.exp(-dt / lag_s)) * (f - shown)
