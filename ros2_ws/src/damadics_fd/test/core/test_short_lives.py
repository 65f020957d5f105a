# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Mode monitor from the first sample to the alarm in seconds, also as plain Python."""

import math

import numpy as np
import pytest
from damadics_fd.core.approximator.estimator import Estimator
from damadics_fd.core.approximator.transmitter import delay, delay_column
from damadics_fd.core.bank.bank import Bank
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.decision.events import Decision
from damadics_fd.core.modes import (
    PHASE_HOLD,
    PHASE_INIT,
    PHASE_LEARN_PHI,
    PHASE_MONITOR,
)
from damadics_fd.core.monitor import monitor_for, run
from damadics_fd.core.quality import Reason, Refused
from damadics_fd.core.sample import SIGNALS, Sample
from damadics_fd.core.settings import Settings

from .synthetic import valve

pytestmark = pytest.mark.plain
RATE = 50.0
QUICK = Settings.for_mode(
    'monitor', sample_rate=RATE, t_on=0.5, t_w=1.0, t_learn=11.0, travel_min=0.5, own_alarm=False
)


def lived(seconds, settings=QUICK, armed=None, **valve_is):
    """Run a valve for some time, from the start or from where another one ended."""
    columns = valve(seconds, rate=settings.sample_rate, **valve_is)
    return continued(armed, columns) if armed else run(columns, settings)


def continued(armed, columns):
    """Go on from the armed state, which stays as it is for the next test."""
    estimator, detector = Estimator(QUICK), Detector(QUICK)
    estimator.quality[:], estimator.state[:] = armed.estimator.quality, armed.estimator.state
    detector.state[:] = armed.detector.state
    return run(columns, QUICK, estimator, detector)


@pytest.fixture(scope='module')
def armed():
    """Learn a valve in 11 s."""
    return lived(11.5)


def test_a_fault_free_valve_is_learned_and_monitored(armed):
    phase = armed.estimates['phase']
    assert phase[-1] == PHASE_MONITOR
    assert armed.detections == []
    assert armed.estimator.status == 'monitoring'
    assert np.all(np.diff(armed.estimates['progress']) >= 0.0)
    assert armed.estimates['phi'][-1] == pytest.approx(330.0, rel=0.15)


def test_friction_grows_and_is_flagged_within_two_seconds(armed):
    later = lived(4.0, armed=armed, first=11.5, friction=0.06)
    [raised] = later.detections
    assert 11.5 < raised.stamp * 1e-9 < 13.5
    assert later.estimator.learned() == armed.estimator.learned(), 'a fault is not learned'


def test_bad_samples_leave_no_trace(armed):
    columns = valve(2.0, rate=RATE, first=11.5)
    rows = [20, 21, 40, 60]
    columns['x1'][[20, 21]] = math.nan, 1.5
    columns['ps'][40] = 5e6
    columns['t1'][60] = math.inf
    keep = np.setdiff1d(np.arange(100), rows)
    dirty = continued(armed, columns)
    clean = continued(armed, {name: column[keep] for name, column in columns.items()})
    assert np.flatnonzero(~dirty.accepted).tolist() == rows
    assert dirty.estimator.state.tobytes() == clean.estimator.state.tobytes()
    assert dirty.decisions[dirty.accepted].tolist() == clean.decisions.tolist()
    assert (dirty.counters['not_finite'], dirty.counters['out_of_range']) == (2, 2)
    assert dirty.estimator.last_rejection == 'not_finite: t1 = inf'
    assert dirty.estimator.failed_input == '', 'good samples have come since'
    lost = {name: column[:0] for name, column in columns.items()}
    assert continued(armed, lost).detections == []


def test_the_input_has_failed_when_nothing_else_comes_for_seconds(armed):
    columns = valve(5.0, rate=RATE, first=11.5)
    columns['x1'][10:] = 1.5
    failed = continued(armed, columns)
    assert failed.estimator.failing.reason == Reason.OUT_OF_RANGE
    assert failed.estimator.failed_input.startswith('out_of_range: x1 = 1.5, for 5 s: ')


@pytest.mark.parametrize(
    ('stamps', 'counts'),
    [
        ((0, 20, 20, 0, 40, 30, 60), {'duplicate': 1, 'zero_stamp': 1, 'out_of_order': 1}),
        ((0, 0), {'zero_stamp': 1}),
        ((5, 0), {'zero_stamp': 1}),
        ((-5,), {'out_of_order': 1}),
        ((20, 40, 200), {'gaps': 1, 'missed': 7}),
        ((20, 100_000), {'restarts': 1}),
    ],
)
def test_stamps_that_cannot_be_are_counted(stamps, counts):
    monitor = monitor_for(QUICK)
    said = [
        monitor.update(Sample(stamp * 1_000_000, 0.5, 0.5, 3.5e6, 2.6e6, 20.0, 5.0, 1.4e5))
        for stamp in stamps
    ]
    refused = [answer for answer in said if isinstance(answer, Refused)]
    counters = monitor.estimator.counters
    assert {name: counters[name] for name in counts} == counts
    assert counters['accepted'] == len(stamps) - len(refused)
    assert sum(monitor.refused.values()) == len(refused)


def test_a_clock_set_back_restarts_the_filters_and_keeps_what_is_learned(armed):
    again = lived(2.5, armed=armed, first=0.02)
    assert again.counters['clock_jumps'] == 1
    assert again.counters['out_of_order'] == QUICK.clock_jump_samples - 1
    phase = again.estimates['phase'][again.accepted]
    assert (phase[0], phase[-1]) == (PHASE_HOLD, PHASE_MONITOR)
    assert again.estimator.learned() == armed.estimator.learned()
    assert again.detections == []


def test_a_long_gap_restarts_the_filters(armed):
    later = lived(0.5, armed=armed, first=7200.0)
    assert later.counters['restarts'] == armed.counters['restarts'] + 1
    assert set(later.estimates['phase']) == {PHASE_HOLD}
    assert later.estimator.status == 'on hold: the input was interrupted, the filters settle'
    assert later.detector.decision.state == 0, 'not monitoring'


def test_a_valve_that_changes_while_it_is_learned_is_not():
    settings = QUICK.replace(t_learn=14.0)
    changing = lived(12.0, settings, friction=lambda t: 0.011 * (1.0 + 8.0 * (t > 8.0)))
    assert PHASE_MONITOR not in changing.estimates['phase']
    assert 'learning was refused' in changing.estimator.status
    assert 'offset ' in changing.estimator.status
    with pytest.raises(ValueError, match='nothing to save: learning'):
        changing.estimator.learned()


def test_nor_is_one_that_changes_before_it_has_slid_both_ways_for_long_enough():
    settings = QUICK.replace(t_learn=14.0)
    changing = lived(60.0, settings, friction=lambda t: 0.011 * (1.0 + 2.0 * (t > 8.0)))
    assert PHASE_MONITOR not in changing.estimates['phase']
    assert 'learning was refused' in changing.estimator.status


@pytest.mark.parametrize(
    ('valve_is', 'said'),
    [
        ({'motion': lambda t: 0.5 + 0.0 * t}, 'of 0.50 strokes travelled; move the valve'),
        ({'motion': lambda t: 0.2 + 0.045 * t}, 'in one direction only'),
        ({'stiffness': 0.6}, 'run commission'),
    ],
)
def test_it_is_told_why_a_valve_is_not_learned(valve_is, said):
    result = lived(12.5, **valve_is)
    assert result.estimates['phase'][-1] == PHASE_LEARN_PHI
    assert result.estimator.status.startswith('learning, ')
    assert said in result.estimator.status


def test_a_stem_that_rests_for_long_is_said(armed):
    result = lived(0.2, armed=armed, first=11.5)
    result.estimator.state['rested'] -= 1_000_000_000_000
    assert 'monitoring limited, no excitation: the stem has not' in result.estimator.status


def test_what_was_learned_is_taken_up_or_refused(armed):
    learned = armed.estimator.learned()
    fresh = Estimator(QUICK)
    with pytest.raises(ValueError, match='nothing to save: waiting for the first good sample'):
        fresh.learned()
    before = fresh.state.tobytes()
    for wrong, said in (
        ({**learned, 'ah1': 9e9}, 'ah1 = 9e.09 is not within'),
        ({**learned, 'eps1': 1e9}, 'the weights exceed w_max'),
        ({**learned, 'eps1': 'x'}, 'learned state'),
        ({}, 'learned state'),
    ):
        with pytest.raises(ValueError, match=said):
            fresh.restore(wrong)
    assert fresh.state.tobytes() == before
    fresh.restore(learned)
    result = run(valve(2.0, rate=RATE, first=100.0), QUICK, fresh)
    assert result.estimates['phase'][-1] == PHASE_MONITOR
    assert fresh.learned() == learned
    fresh.relearn(after_repair=True)
    again = run(valve(0.2, rate=RATE, first=102.0), QUICK, fresh)
    assert set(again.estimates['phase']) == {PHASE_INIT}
    assert fresh.progress < 0.1


@pytest.mark.parametrize(
    ('name', 'changes', 'lag'),
    [('high_pass', {'tau': 0.02}, 0.02), ('kalman', {}, 0.027), ('super_twisting', {}, 0.01)],
)
def test_velocity_estimators_follow_a_ramp(name, changes, lag):
    settings = QUICK.replace(velocity=name, sample_rate=200.0, **changes)
    result = lived(2.5, settings, motion=lambda t: 0.1 + 0.05 * t)
    assert result.estimates['x2'][-50:] == pytest.approx(0.05, abs=5e-4)
    # position and input lag alike, so the residual does not see the lag
    x1 = float(result.estimator.state[0].x1) - 0.25
    assert x1 == pytest.approx(0.1 + 0.05 * (2.5 - 0.005 - lag), abs=0.05 * lag)


def test_a_damped_transmitter_delays_a_column_as_its_samples():
    settings = QUICK.replace(ps_lag=0.1)
    c, s = settings.record()[0], Estimator(settings).state[0]
    values = np.r_[np.zeros(3), np.ones(30)]
    steps = np.full(33, 0.02)
    steps[0] = math.inf
    column = delay_column(values, steps, 0.1)
    single = [delay(s, c, i == 0, 0.02, v, 2.0 * v, 3.0 * v) for i, v in enumerate(values)]
    assert [late for late, _, _ in single] == column.tolist()
    assert single[-1][2] == pytest.approx(3.0 * column[-1])
    assert column[7] == pytest.approx(1.0 - math.exp(-1.0))  # after 0.1 s


def test_valves_in_a_bank_get_the_bits_of_their_own_monitors(armed):
    learned = armed.estimator.learned()
    settings = [QUICK, QUICK.replace(latch=False), QUICK]
    bank, other = Bank(settings), Bank(settings[::-1])
    kinds = ({}, {'friction': 0.06}, {'stiffness': 1.3})
    columns = [valve(2.2, rate=RATE, **kind) for kind in kinds]
    columns[1]['x1'][30] = math.nan
    results = []
    for v, (one, column) in enumerate(zip(settings, columns, strict=True)):
        alone = monitor_for(one)
        alone.restore(learned)
        bank.restore(v, learned)
        results.append(alone.run(column))
    assert any(result.detections for result in results)
    n = len(columns[0]['stamp'])
    number = np.tile([0, 1, 2], n)
    rows = {name: np.column_stack([c[name] for c in columns]).ravel() for name in columns[0]}
    stamp = rows.pop('stamp')

    def taken(bank, part, of):
        signals = {name: rows[name][part] for name in SIGNALS}
        return bank.take(of(number[part]), stamp[part], signals)

    first = taken(bank, slice(0, 150), lambda v: v)
    assert first.reason[91] == Reason.NOT_FINITE
    assert bank.failing(1) is None
    for v in range(3):
        other.restore_bytes(2 - v, bank.tobytes(v))
        assert other.tobytes(2 - v) == bank.tobytes(v)
    rest = taken(other, slice(150, None), lambda v: 2 - v)
    told = [*first.decisions, *rest.decisions]
    raised = [e for row in told for e in Decision(*row.item()).events if e.name == 'raised']
    assert len(raised) == sum(len(result.detections) for result in results)
    for v, result in enumerate(results):
        detector = other.detector(2 - v)
        assert detector.state.tobytes() == result.detector.state.tobytes()
        assert str(detector.decision) == str(result.detector.decision)
        assert other.counters(2 - v) == result.counters
        assert other.status(2 - v) == result.estimator.status
        assert other.judgement(2 - v) is None
    assert other.learned(0) == learned
    other.relearn(0)
    with pytest.raises(ValueError, match='nothing to save'):
        other.learned(0)
    untouched = other.tobytes(1)
    other.reset(0)
    assert other.counters(0)['accepted'] == 0
    assert other.tobytes(1) == untouched
    assert len(other.signatures) == len(other.estimates) == len(other) == 3
