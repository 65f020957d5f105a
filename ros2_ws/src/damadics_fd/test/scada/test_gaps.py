# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Mode scada over gaps: what is worth anything after them, and what is not."""

import math
from dataclasses import replace

import numpy as np
import pytest
from damadics_fd.core.scada.learning import learn
from damadics_fd.core.scada.monitor import ScadaMonitor

from .driven import SETTINGS, driven, following, late, restless

T, CV, X, P1, P2, T1, F = range(7)
AT = 60  # s


@pytest.fixture(scope='module')
def reference():
    """Learn the stated actuator from four minutes."""
    return learn(driven(270, seed=1), SETTINGS)


@pytest.fixture(scope='module')
def followed():
    """Learn a valve of which CV and position alone are measured."""
    return learn(following(400, seed=2), SETTINGS, math.inf)


@pytest.fixture(scope='module')
def metered():
    """Learn a valve with half of the stated Kv, so that its flow law is identified."""
    rows = driven(270, seed=11)
    rows[:, F] *= 0.5
    return learn(rows, SETTINGS)


def without(rows, start, seconds):
    """Return rows without those of a gap."""
    gone = (rows[:, T] >= start) & (rows[:, T] < start + seconds)
    return rows[~gone]


@pytest.mark.parametrize('missing', [(P1,), (P1, P2), (T1,), (F,)])
@pytest.mark.parametrize('seconds', [1, 40])
def test_values_that_are_missing_for_a_while_raise_nothing(reference, missing, seconds):
    rows = driven(260, seed=3)
    rows[100 : 100 + seconds, missing] = math.nan
    monitor = ScadaMonitor(SETTINGS, reference)
    trace = monitor.run_samples(rows)
    assert not trace['alarm'].any()
    assert np.abs(trace['r1'][150:]).max() < 0.01, 'the model of the stem has come to no harm'


@pytest.mark.parametrize('seconds', [1, 40])
def test_a_fault_is_found_after_values_were_missing(reference, seconds):
    rows = driven(200, 4, 150, f13=0.25)
    rows[100 : 100 + seconds, (P1, P2)] = math.nan
    trace = ScadaMonitor(SETTINGS, reference).run_samples(rows)
    first = trace['t'][trace['alarm']]
    assert 150 <= first[0] <= 154


def test_which_way_the_command_went_in_a_gap_is_not_known(followed):
    rows = following(AT + 60, seed=5)
    rows[:, CV] = rows[:, X] = 0.5
    rows[AT:, CV] = 0.75  # it jumped with the last sample of the gap
    rows[AT + 2 :, X] = 0.75
    monitor = ScadaMonitor(SETTINGS, followed)
    monitor.run_samples(following(AT, seed=6))
    rows[:, T] += AT
    assert not monitor.run_samples(without(rows, AT + AT - 20, 20))['alarm'].any()


def test_a_stem_that_sticks_in_a_gap_is_found_after_it(followed):
    rows = following(AT + 60, seed=5)
    rows[AT - 20 :, X] = rows[AT - 20, X]
    trace = ScadaMonitor(SETTINGS, followed).run_samples(without(rows, AT - 20, 20))
    first = trace['t'][trace['alarm']]
    assert AT <= first[0] <= AT + 15


@pytest.mark.parametrize('gap', [100, 400])
def test_an_alarm_outlives_a_gap_as_long_as_its_fault_does(followed, gap):
    """What stood stands until it can be told; after a long gap new evidence decides."""
    rows = following(AT + 30 + gap + 300, seed=5)
    rows[AT:, X] += 0.1
    standing = ScadaMonitor(SETTINGS, followed)
    trace = standing.run_samples(without(rows, AT + 30, gap))
    after = trace['t'] >= AT + 30 + gap
    if gap < 300:
        assert (trace['ratio'][after] >= 1.0).all()
        assert standing.state.occurrence == 1
    else:
        assert trace['ratio'][after][0] == 0.0
        assert trace['t'][after][trace['ratio'][after] >= 1.0][0] <= AT + 30 + gap + 25
    rows[AT + 30 :, X] -= 0.1
    gone = ScadaMonitor(SETTINGS, followed)
    trace = gone.run_samples(without(rows, AT + 30, gap))
    assert gone.state.occurrence == 1
    assert not gone.state.stood


def test_a_pressure_that_fell_in_a_gap_is_still_off_after_it(metered):
    rows = driven(AT + 130, seed=12)
    rows[:, F] *= 0.5
    rows[AT:, P1] -= 0.6 * (rows[AT:, P1] - rows[AT:, P2])
    rows[AT:, F] *= math.sqrt(0.4)
    trace = ScadaMonitor(SETTINGS, metered).run_samples(without(rows, AT, 90))
    first = trace['t'][trace['alarm']]
    assert AT + 90 <= first[0] <= AT + 90 + SETTINGS.settle_s + 4


def test_a_gap_is_no_change_from_one_sample_to_the_next(followed):
    rows = following(500, seed=7)
    monitor = ScadaMonitor(SETTINGS, followed)
    monitor.run_samples(rows[:200])
    before = float(monitor.state.rough[0, 0])
    monitor.run_samples(rows[300:301] + np.array([0, 0, 0.5, 0, 0, 0, 0]))
    assert float(monitor.state.rough[0, 0]) == before


@pytest.mark.parametrize('law', [False, True])
def test_a_record_with_gaps_can_be_learned_from(law):
    """Also one that leaves a few samples between two gaps."""
    rows = driven(500, seed=13)
    if law:
        rows[:, F] *= 0.5
    for start, seconds in ((100, 40), (150, 35), (300, 60)):
        rows = without(rows, start, seconds)
    rows[-40:, P1] = math.nan
    rows[20, (P2, T1)] = math.nan
    reference = learn(rows, SETTINGS, math.inf)
    fresh = driven(300, seed=14)
    if law:
        fresh[:, F] *= 0.5
    fresh[200:, X] += 0.05
    trace = ScadaMonitor(SETTINGS, reference).run_samples(fresh)
    assert 200 <= trace['t'][trace['alarm']][0] <= 203


def test_a_command_that_was_missed_for_one_sample_raises_nothing(followed):
    """The stem follows it all the same: a quick one is elsewhere than between its neighbours."""
    rows = following(AT + 30, seed=8)
    for i in range(AT, AT + 24, 6):
        rows[i, CV] += 0.15
        rows[i + 2, X] += 0.15
        rows[i + 3, X] += 0.05
    trace = ScadaMonitor(SETTINGS, followed).run_samples(np.delete(rows, range(AT, AT + 24, 6), 0))
    assert not trace['alarm'].any()


def with_rows_missing(rows: np.ndarray, seed: int, share: float = 0.2) -> np.ndarray:
    """Return a record as a historian gives it that leaves out rows now and then."""
    kept = np.random.default_rng([seed, 9]).random(len(rows)) > share
    kept[0] = True
    return rows[kept]


@pytest.mark.parametrize('lag', [0.35, 1.2])
@pytest.mark.parametrize('seed', [1, 2, 3])
def test_where_every_fifth_row_is_missing_a_restless_stem_is_judged_all_the_same(seed, lag):
    learned = late(restless(900, seed), seed, lag=lag)
    known = learn(with_rows_missing(learned, seed), replace(SETTINGS, learn_s=900.0))
    rows = late(restless(1800, seed + 20), seed + 20, lag=lag)
    monitor = ScadaMonitor(SETTINGS, known)
    assert not monitor.run_samples(with_rows_missing(rows, seed + 20))['alarm'].any()
    rows[900:, 2] = rows[900, 2]
    monitor.reset()
    trace = monitor.run_samples(with_rows_missing(rows, seed + 20))
    assert 900.0 < trace['t'][trace['alarm']][0] < 960.0
