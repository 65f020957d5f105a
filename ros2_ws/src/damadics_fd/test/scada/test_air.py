# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A monitor of the stated actuator that begins when its plant has long been running."""

import dataclasses
import math

import pytest
from damadics_fd.core.scada.learning import learn
from damadics_fd.core.scada.monitor import ScadaMonitor

from .driven import SETTINGS, driven

LATE = dataclasses.replace(SETTINGS, t_on_s=200.0)


@pytest.fixture(scope='module')
def reference():
    """Learn the stated actuator as it is when it has just been put to work."""
    return learn(driven(270, seed=1), SETTINGS)


@pytest.mark.parametrize('air', [1.1, 1.25])
def test_a_plant_that_has_been_running_for_long_is_no_fault(reference, air):
    monitor = ScadaMonitor(LATE, reference)
    trace = monitor.run_samples(driven(900, seed=21, air=air))
    assert not trace['alarm'].any()
    assert 'slower than learned' in monitor.drifts()[0]
    assert math.exp(float(monitor.state.air)) == pytest.approx(air, abs=0.05)


def test_a_little_air_is_found_when_there_is_more_to_look_at(reference):
    monitor = ScadaMonitor(LATE, reference)
    monitor.run_samples(driven(2300, seed=21, air=1.05))
    assert math.exp(float(monitor.state.air)) == pytest.approx(1.05, abs=0.01)
    assert monitor.state.air_doubt < 1.0


@pytest.mark.parametrize('seed', [22, 31, 36, 42])
def test_what_was_found_is_not_forgotten_where_later_motion_tells_little(reference, seed):
    monitor = ScadaMonitor(LATE, reference)
    trace = monitor.run_samples(driven(2300, seed, air=1.05))
    assert not trace['alarm'].any()
    assert math.exp(float(monitor.state.air)) == pytest.approx(1.05, abs=0.015)


def test_air_that_was_found_leaves_what_a_short_record_may_not_have_shown(reference):
    monitor = ScadaMonitor(LATE, reference)
    assert not monitor.run_samples(driven(900, 45, air=1.08))['alarm'].any()
    assert math.exp(float(monitor.state.air)) == pytest.approx(1.08, abs=0.015)


def test_what_later_motion_does_not_confirm_is_given_up_in_the_end(reference):
    rows = driven(2300, 21, swing=0.02)
    monitor = ScadaMonitor(LATE, reference)
    monitor.run_samples(rows[:800])
    assert int(monitor.state.air_looks) == 2
    monitor.state.air, monitor.state.air_nats = 0.02, 6.0
    monitor.run_samples(rows[800:2000])
    assert float(monitor.state.air) == 0.02
    monitor.run_samples(rows[2000:])
    assert int(monitor.state.air_looks) == 3
    assert float(monitor.state.air) == 0.0


def test_a_plant_that_has_been_running_is_learned_as_it_is(reference):
    running = learn(driven(270, seed=1, air=1.1), SETTINGS)
    assert 0.0 <= reference['air'][0] < 0.01
    assert math.exp(float(running['air'][0])) == pytest.approx(1.1, abs=0.015)
    assert running['s1'][0] == pytest.approx(reference['s1'][0], rel=0.05)
    monitor = ScadaMonitor(LATE, running)
    assert not monitor.run_samples(driven(900, seed=21, air=1.1))['alarm'].any()
    assert float(monitor.state.air) == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize('seed', [1, 2, 3])
def test_a_stem_that_hardly_moves_tells_no_air(seed):
    assert learn(driven(270, seed, swing=0.08), SETTINGS)['air'][0] == 0.0


@pytest.mark.parametrize('seed', [1, 2, 3])
def test_slow_motion_tells_little_air_and_never_less_than_none(seed):
    slow = learn(driven(270, seed, swing=0.3), SETTINGS)
    assert 0.0 <= slow['air'][0] < 0.03


def test_there_is_never_less_air_than_none(reference):
    monitor = ScadaMonitor(LATE, reference)
    monitor.run_samples(driven(900, seed=21, air=0.9))
    assert float(reference['air'][0]) + float(monitor.state.air) >= 0.0


def test_what_was_found_is_kept_over_a_gap(reference):
    rows = driven(900, seed=22, air=1.25)
    monitor = ScadaMonitor(LATE, reference)
    monitor.run_samples(rows[:500])
    looks = int(monitor.state.air_looks)
    assert not monitor.run_samples(rows[620:])['alarm'].any()
    assert int(monitor.state.air_looks) == looks


@pytest.mark.parametrize('fault', [{'f12': 0.6}, {'f13': 0.15}, {'f15': 0.5}])
def test_a_fault_that_was_there_before_the_monitor_is_not_taken_for_it(reference, fault):
    trace = ScadaMonitor(LATE, reference).run_samples(driven(260, 23, 0, **fault))
    assert trace['alarm'][-1]


def test_a_fault_is_found_beside_it(reference):
    trace = ScadaMonitor(LATE, reference).run_samples(driven(420, 24, 380, air=1.25, f11=0.4))
    assert 380 <= trace['t'][trace['alarm']][0] <= 384
