# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Mode scada on a valve that is operated another way than the one that was learned."""

import math

import numpy as np
import pytest
from damadics_fd.core.scada.judging.cusum import TEST_NAMES
from damadics_fd.core.scada.judging.decide import test_friction as weigh_friction
from damadics_fd.core.scada.laws.fit_stem import Piece, fit_stem
from damadics_fd.core.scada.learning import learn
from damadics_fd.core.scada.monitor import ScadaMonitor
from damadics_fd.core.scada.state import MONITOR, REFERENCE

from .driven import NOISE, SETTINGS, driven, following, late, sticking, wandering

T, CV, X, P1, P2, T1, F = range(7)
FALL = 0.04  # of the stroke a second
HOUR = 3600


def limited(n: int, seed: int, fall: float = FALL) -> np.ndarray:
    """Return rows of a stem that closes at once and opens slowly; CV is held for each second."""
    rng = np.random.default_rng(seed)
    cv = np.clip(0.6 + 0.06 * rng.normal(size=n), 0.0, 1.0)
    x = np.empty(n)
    at = x[0] = cv[0]
    parts = 20
    for k in range(1, n):
        for part in range(parts):  # a quarter of a second late
            command = cv[max(k - 2, 0)] if part < parts // 4 else cv[k - 1]
            at = max(command, at - fall / parts)
        x[k] = at
    rows = np.full((n, 7), np.nan)
    rows[:, T], rows[:, CV] = np.arange(float(n)), cv
    rows[:, X] = x + rng.normal(0.0, NOISE, n)
    return rows


@pytest.fixture(scope='module')
def followed():
    """Learn a valve of which CV and position alone are measured."""
    return learn(following(400, seed=2), SETTINGS, math.inf)


def test_a_command_that_is_held_between_samples_is_seen_to_be():
    rows = limited(600, seed=1)
    fit = fit_stem([Piece(rows[:, T], rows[:, CV], rows[:, X])], 1.0)
    law = fit.law[0]
    assert law['hold']
    assert law['fall'] == pytest.approx(FALL, rel=0.15)
    assert fit.sigma < 0.006, 'a CV along straight lines leaves 0.014'


@pytest.mark.parametrize(('jump', 'shown'), [(0.0, False), (0.2, True)])
def test_a_record_without_jumps_of_cv_does_not_tell_that_later_ones_can_be_judged(jump, shown):
    [reference] = learn(driven(270, seed=31, jump=jump), SETTINGS)
    assert reference['hold']
    assert (reference['cv_jump'] > 1.0) == shown  # CV is 0..1


def test_a_stem_with_more_air_than_on_the_learned_day_is_no_fault():
    reference = learn(limited(600, seed=1), SETTINGS, math.inf)
    monitor = ScadaMonitor(SETTINGS, reference)
    assert not monitor.run_samples(limited(HOUR, seed=2, fall=1.4 * FALL))['alarm'].any()
    stuck = limited(400, seed=3)
    stuck[200:, X] = stuck[200, X]
    trace = ScadaMonitor(SETTINGS, reference).run_samples(stuck)
    assert 200 <= trace['t'][trace['alarm']][0] <= 230


@pytest.mark.parametrize('share', [0.01, -0.01])
def test_a_position_that_drifts_for_hours_is_a_trend_and_a_jump_a_fault(followed, share):
    rows = following(2 * HOUR, seed=4)
    rows[:, X] += share * np.minimum(rows[:, T] / HOUR, 1.5)
    monitor = ScadaMonitor(SETTINGS, followed)
    assert not monitor.run_samples(rows)['alarm'].any()
    assert 'the stem has drifted by' in monitor.drifts()[0]
    rows = following(1300, seed=5)
    rows[1000:, X] += 2.0 * share
    trace = ScadaMonitor(SETTINGS, followed).run_samples(rows)
    assert 1000 <= trace['t'][trace['alarm']][0] <= 1180


@pytest.mark.parametrize(('share', 'alarm'), [(0.4, False), (0.7, True)])
def test_a_pressure_that_leaves_its_level_is_a_witness_until_it_is_far_off(share, alarm):
    rows = driven(270, seed=11)
    rows[:, F] *= 0.5
    reference = learn(rows, SETTINGS)
    drop = 0.9e6 / 3.5e6  # of P1
    rows = driven(160, 12, 100, f17=share * drop)
    rows[:, F] *= 0.5
    monitor = ScadaMonitor(SETTINGS, reference)
    monitor.run_samples(rows)
    peak = monitor.state.peaks[TEST_NAMES.index('process/0.5')]
    assert (peak >= 1.0) == alarm


@pytest.mark.parametrize(('moves', 'friction'), [(False, False), (True, True)])
def test_a_stem_at_rest_shows_its_friction_once(moves, friction):
    s, ref = np.zeros(1, MONITOR)[0], np.zeros(1, REFERENCE)[0]
    ref.s1, ref.kap2, ref.llr_limit = 0.0017, 1.0, 40.0
    s.testable[:] = 1
    largest = 0.0
    for k in range(HOUR):  # the model is off by 0.4 sigma, the copy with more play is not
        s.xm[0] = 0.5 + (0.01 * (k // 30 % 2) if moves else 0.0)
        s.residual[0] = 0.0007
        s.xd = s.xm[0] + 0.0007
        weigh_friction(s, ref)
        largest = max(largest, float(s.llr))
    assert (largest >= ref.llr_limit) == friction


def test_steps_of_cv_that_were_not_learned_are_no_fault():
    reference = learn(late(wandering(1800, 1), 1), SETTINGS, math.inf)
    cv = wandering(HOUR, 2) + 0.3 * (np.arange(HOUR) // 400 % 2) - 0.15
    trace = ScadaMonitor(SETTINGS, reference).run_samples(late(cv, 2))
    assert not trace['alarm'].any(), trace['t'][trace['alarm']][:1]
    stuck = late(cv[:1300], 3)
    stuck[1195:, X] = stuck[1194, X]  # five seconds before a step
    trace = ScadaMonitor(SETTINGS, reference).run_samples(stuck)
    assert 1195 <= trace['t'][trace['alarm']][0] <= 1220


def test_a_stem_that_rests_within_its_play_is_no_fault_and_one_beside_it_is():
    reference = learn(late(wandering(1800, 1), 1, lag=3.0, play=0.024), SETTINGS, math.inf)
    cv = wandering(2 * HOUR, 2)
    for begin in range(600, 2 * HOUR, 1200):
        cv[begin : begin + 900] = cv[begin]
    rows = late(cv, 2, lag=3.0, play=0.024)
    trace = ScadaMonitor(SETTINGS, reference).run_samples(rows)
    assert not trace['alarm'].any(), trace['t'][trace['alarm']][:1]
    rows[3000:, X] += 0.04
    trace = ScadaMonitor(SETTINGS, reference).run_samples(rows)
    assert 3000 <= trace['t'][trace['alarm']][0] <= 3060


@pytest.mark.parametrize('stick', [0.012, 0.024, 0.04])
def test_a_stem_that_sticks_from_the_first_day_is_stepped_without_an_alarm(stick):
    reference = learn(sticking(wandering(1800, 1), 1, stick), SETTINGS, math.inf)
    steps = np.repeat(np.random.default_rng(2).uniform(0.3, 0.7, 24), 300)
    rows = sticking(steps + 0.3 * (wandering(len(steps), 3) - 0.5), 2, stick)
    trace = ScadaMonitor(SETTINGS, reference).run_samples(rows)
    assert not trace['alarm'].any(), trace['t'][trace['alarm']][:1]
    sensor = rows.copy()
    sensor[3450:, X] *= 1.3125
    stuck = rows.copy()
    stuck[2990:, X] = stuck[2990, X]  # until the next but one step at the latest
    for faulty, since, until in ((sensor, 3450, 3455), (stuck, 2990, 3620)):
        trace = ScadaMonitor(SETTINGS, reference).run_samples(faulty)
        assert since <= trace['t'][trace['alarm']][0] <= until


def test_a_step_at_the_end_of_the_record_tells_neither_gain_nor_lag():
    cv = 0.4 + 0.2 * (np.arange(1200) >= 1188)
    reference = learn(sticking(cv, 1, 0.012), SETTINGS, math.inf)
    assert reference['stem_law']['gain'][0] == pytest.approx(1.0, abs=0.1)
    assert reference['stem_law']['stick'][0] >= 0.012


def test_a_record_that_stood_still_goes_on_elsewhere():
    reference = learn(late(wandering(1800, 1), 1), SETTINGS, math.inf)
    rows = late(wandering(HOUR, 2), 2)
    for begin in range(600, HOUR, 300):
        rows[begin : begin + 150, 1:] = rows[begin, 1:]
    trace = ScadaMonitor(SETTINGS, reference).run_samples(rows)
    assert not trace['alarm'].any(), trace['t'][trace['alarm']][:1]


@pytest.mark.parametrize('period', [1, 2])
def test_a_fault_that_has_gone_stands_for_a_minute_at_any_period(period):
    """At two seconds, too: the next fault of a plant may come two minutes later."""
    learned = learn(following(900, seed=2)[::period], SETTINGS, math.inf)
    rows = following(700, seed=5)
    rows[400:430, X] += 0.1
    trace = ScadaMonitor(SETTINGS, learned).run_samples(rows[::period])
    standing = trace['t'][trace['ratio'] >= 1.0]
    assert 400 <= standing[0] <= 400 + 5 * period
    assert 480 <= standing[-1] <= 520
