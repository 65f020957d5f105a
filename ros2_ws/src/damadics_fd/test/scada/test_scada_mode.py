# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Mode scada behind the contract of estimator, detector and pipeline."""

import dataclasses
import json
import math

import numpy as np
import pytest
from damadics_fd.core.approximator.estimator import Estimator
from damadics_fd.core.decision.alarm import CHANGED
from damadics_fd.core.estimating import estimator_for
from damadics_fd.core.modes import PHASE_LEARN_PHI, PHASE_MONITOR
from damadics_fd.core.monitor import Chain, run
from damadics_fd.core.quality import Refused
from damadics_fd.core.scada.estimator import ScadaEstimator
from damadics_fd.core.settings import Settings

plant = pytest.importorskip('damadics_plant')
SETTINGS = Settings.for_mode('scada')
NAMES = ('stamp', 'cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps')


@pytest.fixture(scope='module')
def columns():
    faulty = plant.simulate('f11@0.5', rate=1.0, duration=1100.0, noise=True, seed=4)
    return {name: np.asarray(faulty[name]) for name in NAMES}


@pytest.fixture(scope='module')
def result(columns):
    return run(columns, SETTINGS)


def test_the_alarm_goes_through_the_detector(result):
    assert [round(d.stamp * 1e-9) - 900 in (0, 1, 2) for d in result.detections] == [True]
    assert result.estimates['phase'][500] == PHASE_LEARN_PHI
    assert result.estimates['phase'][-1] == PHASE_MONITOR
    assert result.decisions['threshold'][-1] == 1.0
    assert result.decisions['fault'][-1]
    assert not result.decisions['fault'][:900].any()
    assert 'f11 servomotor spring' in result.estimator.status


def test_events_tell_the_test_the_onset_and_later_the_cause(columns, result):
    raised = result.detections[0]
    assert raised.test.startswith('r1/')
    assert f'control-room test {raised.test} at ' in raised.text
    assert 898 <= raised.onset * 1e-9 <= 902
    assert not raised.cause
    named = result.events[-1]
    assert named.transition == CHANGED
    assert named.occurrence == raised.occurrence
    assert named.candidates == ('f11',)
    assert named.cause == 'f11'
    assert 0.3 < named.strength < 0.7
    assert 0.5 < named.confidence <= 1.0
    assert 'f11 servomotor spring' in named.text
    chain = Chain(SETTINGS)
    pieces = [{name: v[i : i + 300] for name, v in columns.items()} for i in range(0, 1100, 300)]
    again = [event for piece in pieces for event in chain.events(piece)]
    assert [(e.transition, e.test, e.cause) for e in again] == [
        (e.transition, e.test, e.cause) for e in result.events
    ]


def test_another_sample_period_than_the_learned_one_is_told(columns, result):
    estimator = estimator_for(SETTINGS)
    estimator.restore(result.estimator.learned())
    rare = {name: values[::5] for name, values in columns.items()}
    assert not run(rare, SETTINGS, estimator=estimator).detections
    assert 'samples come every 5 s, but every 1 s were learned from' in estimator.status
    assert not estimator.monitoring


def test_sample_by_sample_gives_the_same(columns, result):
    estimator = estimator_for(SETTINGS)
    for i, row in enumerate(zip(*(columns[name].tolist() for name in NAMES), strict=True)):
        estimate = estimator.update(*row)
        assert estimate.xi2 == result.estimates['xi2'][i]
        assert estimate.xi1 == result.estimates['xi1'][i]


def test_bad_samples_are_refused_with_a_reason(columns):
    estimator = estimator_for(SETTINGS)
    row = [columns[name][5].item() for name in NAMES]
    assert not isinstance(estimator.update(*row), Refused)
    before = estimator.monitor._state.tobytes()
    for index, value, reason in (
        (0, row[0], 'duplicate'),
        (2, math.nan, 'not_finite'),
        (1, 2.0, 'out_of_range'),
    ):
        bad = list(row)
        bad[0] = row[0] + (index != 0)
        bad[index] = value
        assert estimator.update(*bad).name == reason
        assert estimator.monitor._state.tobytes() == before
    bare = [row[0] + 10**9, *row[1:5], math.nan, math.nan, math.nan]
    assert estimator.update(*bare).stamp == bare[0]  # any but position and control value may lack


class Held:
    """A control value that a controller sets every twenty seconds."""

    def at(self, t):
        return 0.5 + 0.25 * np.sin(2 * np.pi * 0.0021 * (t // 20 * 20))


def test_what_was_learned_under_a_held_cv_survives_a_restart():
    scenario = dataclasses.replace(plant.load_scenario('nominal'), duration=1000.0, cv=Held())
    run_ = plant.simulate(scenario, rate=1.0, noise='cv', seed=4)
    estimator = run({name: np.asarray(run_[name]) for name in NAMES}, SETTINGS).estimator
    assert estimator.monitor.reference['hold'].all()
    fresh = estimator_for(SETTINGS)
    fresh.restore(json.loads(json.dumps(estimator.learned())))
    assert np.array_equal(fresh.monitor.reference, estimator.monitor.reference)


def test_what_was_learned_survives_a_restart(columns, result):
    learned = json.loads(json.dumps(result.estimator.learned()))
    fresh = estimator_for(SETTINGS)
    with pytest.raises(ValueError, match='nothing to save'):
        fresh.learned()
    fresh.restore(learned)
    assert np.array_equal(fresh.monitor.reference, result.estimator.monitor.reference)
    again = run(columns, SETTINGS, estimator=fresh)
    assert again.detections[0].stamp == result.detections[0].stamp
    for broken in ({**learned, 'mu': 1.0}, {**learned, 's1': 0.0}, {'mu': learned['mu']}):
        with pytest.raises(ValueError, match='learned state'):
            fresh.restore(broken)


def test_learning_anew_and_a_clock_set_back(columns):
    estimator = estimator_for(SETTINGS)
    run({name: values[:950] for name, values in columns.items()}, SETTINGS, estimator=estimator)
    assert estimator.monitor.reference is not None
    estimator.monitor.resume()
    assert estimator.monitor.reference is not None
    estimator.relearn()
    assert estimator.monitor.reference is None
    assert estimator.status.startswith('learning')


def test_the_other_modes_keep_their_estimator():
    assert type(estimator_for(Settings.for_mode('monitor'))) is Estimator
    assert isinstance(estimator_for(SETTINGS), ScadaEstimator)
    assert SETTINGS.t_learn == 900.0
    assert Settings.describe('scada')[1]['default'] == 1.0
