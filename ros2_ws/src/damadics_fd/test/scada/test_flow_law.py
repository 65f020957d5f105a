# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a flow law identified from a quarter of an hour claims to know."""

import math

import numpy as np
import pytest
from damadics_fd.core.scada.laws.fit_flow import fit_flow
from damadics_fd.core.scada.laws.flow_law import characteristic, flow_doubt

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
