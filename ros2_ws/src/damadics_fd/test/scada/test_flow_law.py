# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a flow law identified from a quarter of an hour claims to know."""

import math
from dataclasses import replace

import numpy as np
import pytest
from damadics_fd.core.scada.laws.fit_flow import fit_flow
from damadics_fd.core.scada.laws.flow_law import characteristic, flow_doubt
from damadics_fd.core.scada.laws.plausible import LearningError
from damadics_fd.core.scada.learning import learn
from damadics_fd.core.scada.monitor import ScadaMonitor
from damadics_fd.core.scada.state import NOMINAL

from .driven import NOISE as STEM_NOISE
from .driven import SETTINGS, driven

QUARTER = 900
X, F = 2, 6  # places among the signals
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


NOISE = 0.007  # of a meter that is at its end below 0.45 of the stroke


def at_the_end(seed):
    """Return t, X', X, F' of a valve whose noisy meter is at its end for half of the time."""
    rng = np.random.default_rng(seed)
    t = np.arange(7200.0)
    x = 0.45 + 0.2 * np.sin(2.0 * np.pi * t / 400.0)
    shown = np.minimum(np.exp(-6.0 * (x - 0.45)), 1.0)
    flow = np.clip(shown + NOISE * rng.normal(size=len(t)), 0.0, 1.0)
    return t, x + NOISE * rng.normal(size=len(t)), x, flow


@pytest.mark.parametrize('seed', range(4))
def test_noise_below_the_end_of_a_meter_is_not_the_flow(seed):
    t, measured, x, flow = at_the_end(seed)
    fit = fit_flow(t, measured, x, np.zeros(len(t)), flow, 1.0)
    assert fit is not None
    law = fit.law[0]
    for place in (0.3, 0.4):
        below = -6.0 * (place - 0.45) - characteristic(law, place)
        assert below < SIGMAS * flow_doubt(law, place, float(law['size0']))


def closing(seconds: int, seed: int) -> np.ndarray:
    """Return rows of a valve that is closed for five minutes of ten."""
    rows = driven(seconds, seed, centre=0.7, swing=0.2, jump=-0.7, every=300)
    rows[:, X:] = np.clip(rows[:, X:], 0.0, 1.0)
    return rows


@pytest.mark.parametrize('seed', range(3))
def test_a_closed_valve_is_no_evidence_and_a_leak_is(seed):
    """X' ends at 1 and F' at 0, their noise does not."""
    known = learn(closing(1200, seed), replace(SETTINGS, learn_s=1200.0))
    rows = closing(3600, seed + 10)
    monitor = ScadaMonitor(SETTINGS, known)
    assert not monitor.run_samples(rows)['alarm'].any()
    monitor.reset()
    monitor.run_samples(rows[:550])
    assert monitor.state.masked
    rows[3000:, F] += 0.06
    monitor.reset()
    trace = monitor.run_samples(rows)
    assert 3000.0 < trace['t'][trace['alarm']][0] < 3005.0


def test_a_stem_that_is_never_between_its_stops_for_long_is_refused():
    with pytest.raises(LearningError, match='end of its stroke'):
        learn(driven(600, seed=1, centre=0.85, swing=1.2), replace(SETTINGS, learn_s=600.0))


@pytest.mark.parametrize('seed', [1, 2, 3])
def test_a_stem_is_not_learned_to_be_quieter_for_the_time_at_its_stop(seed):
    batches = driven(1800, seed=seed, centre=0.9, swing=0.3, jump=-0.4, every=150)
    known = learn(batches, replace(SETTINGS, learn_s=1800.0))
    assert known['s1'][0] == pytest.approx(STEM_NOISE, rel=0.1)
