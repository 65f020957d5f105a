# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a flow law identified from a quarter of an hour claims to know."""

import math

import numpy as np
import pytest
from damadics_fd.core.scada.laws.fit_flow import fit_flow
from damadics_fd.core.scada.laws.flow_law import characteristic, flow_doubt
from damadics_fd.core.scada.learning import learn
from damadics_fd.core.scada.monitor import ScadaMonitor
from damadics_fd.core.scada.state import NOMINAL

from .driven import SETTINGS, driven

QUARTER = 900
AT, SLOPE = 0.65, -5.0
SIGMAS = 3.0  # of the law's doubt that are no evidence


def wander(rng, spread, memory):
    """Return a slow random course of a given standard deviation."""
    course = np.zeros(QUARTER)
    for k in range(1, QUARTER):
        kick = spread * math.sqrt(2.0 / memory) * rng.normal()
        course[k] = (1.0 - 1.0 / memory) * course[k - 1] + kick
    return course


@pytest.mark.parametrize('away', [-0.1, 0.1])
def test_slow_changes_of_a_plant_are_no_slope_of_the_characteristic(away):
    """A stem that moves little, a flow that changes by a hundredth or two within minutes."""
    beyond, doubts = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        t = np.arange(float(QUARTER))
        x = AT + wander(rng, 0.03, 100.0)
        size = 3.0 + 0.002 * rng.normal(size=QUARTER)
        swing = wander(rng, 0.015, 200.0)
        flow = 0.5 * np.exp(SLOPE * (x - AT) + swing + 0.004 * rng.normal(size=QUARTER))
        measured = x + 0.0014 * rng.normal(size=QUARTER)
        fit = fit_flow(t, measured, x, size, flow, 1.0)
        assert fit is not None
        law = fit.law[0]
        said = characteristic(law, AT + away) - characteristic(law, AT)
        doubts.append(flow_doubt(law, AT + away, float(law['size0'])))
        beyond.append(abs(said - SLOPE * away) / (SIGMAS * doubts[-1]))
    assert max(beyond) < 1.0
    assert max(doubts) < 0.25, 'a doubt that nothing could contradict'


@pytest.mark.parametrize('seed', range(4))
def test_a_line_learned_near_the_end_of_the_meter_is_unsure_far_below(seed):
    """There the flow is four times less noisy than where gain and offset were learned."""
    reference = learn(driven(500, seed, centre=0.44, swing=0.1), SETTINGS, 500.0)
    assert reference['flow_kind'][0] == NOMINAL
    assert reference['f_mean'][0] > 0.85
    monitor = ScadaMonitor(SETTINGS, reference)
    low = driven(600, seed + 50, centre=0.85, swing=0.3)
    assert not monitor.run_samples(low)['alarm'].any()
