# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Wrong samples: of CV they move the model and not the stem, of others one residual."""

import math
from dataclasses import replace

import numpy as np
import pytest
from damadics_fd.core.scada.judging.residuals import process_residual
from damadics_fd.core.scada.judging.spikes import wary
from damadics_fd.core.scada.laws.actuator import nominal_flow
from damadics_fd.core.scada.learning import learn
from damadics_fd.core.scada.monitor import ScadaMonitor
from damadics_fd.core.scada.state import MONITOR

from .driven import SETTINGS, driven

CV = 1
WRONG = slice(55, None, 30)
# CV jumps by itself, so that a jump is no reason to wait; the flow meter is not at its end.
STEPS = {'swing': 0.2, 'jump': 0.1, 'centre': 0.66}


@pytest.fixture(scope='module', params=[False, True], ids=['learned without', 'learned with'])
def reference(request):
    """Learn the stated actuator, from a record that may have wrong samples of CV itself."""
    rows = driven(270, seed=1, **STEPS)
    if request.param:
        rows[WRONG, CV] += 0.2
    return learn(rows, SETTINGS)


@pytest.mark.parametrize('off', [-0.2, 0.2])
def test_a_wrong_sample_of_cv_is_not_learned_from(off):
    rows = driven(270, seed=1, **STEPS)
    right = learn(rows, SETTINGS)
    rows[WRONG, CV] = np.clip(rows[WRONG, CV] + off, 0.0, 1.0)
    wrong = learn(rows, SETTINGS)
    for name in ('cv_jump', 's1', 'h'):
        assert wrong[name] == pytest.approx(right[name], rel=0.05)


@pytest.mark.parametrize('off', [-0.2, 0.1, 0.2])
def test_a_wrong_sample_of_cv_raises_nothing(reference, off):
    rows = driven(300, seed=5, **STEPS)
    rows[WRONG, CV] = np.clip(rows[WRONG, CV] + off, 0.0, 1.0)
    trace = ScadaMonitor(SETTINGS, reference).run_samples(rows)
    assert not trace['alarm'].any()


@pytest.mark.parametrize('off', [-0.2, 0.2])
def test_two_wrong_samples_of_cv_raise_nothing(reference, off):
    rows = driven(400, seed=5, **STEPS)
    for first in range(85, 400, 60):
        rows[first : first + 2, CV] = np.clip(rows[first : first + 2, CV] + off, 0.0, 1.0)
    trace = ScadaMonitor(SETTINGS, reference).run_samples(rows)
    assert not trace['alarm'].any()


@pytest.mark.parametrize(('lasts', 'alarm'), [(30, False), (140, True)])
def test_r1_waits_for_a_model_that_a_wrong_cv_has_thrown_but_not_for_ever(lasts, alarm):
    known = learn(driven(270, seed=1, **STEPS), SETTINGS)
    rows = driven(300, seed=5, **STEPS)
    rows[:, 6] = np.nan
    rows[155, CV] += 0.2
    rows[156 : 156 + lasts, 2] -= 0.03
    trace = ScadaMonitor(SETTINGS, known).run_samples(rows)
    assert trace['alarm'].any() == alarm
    assert not trace['alarm'][:206].any()


def test_a_fault_between_wrong_samples_is_found(reference):
    rows = driven(300, 6, 155, f13=0.25, **STEPS)
    rows[WRONG, CV] += 0.2
    trace = ScadaMonitor(SETTINGS, reference).run_samples(rows)
    assert 155.0 <= trace['t'][trace['alarm']][0] < 175.0


@pytest.mark.parametrize(('signal', 'every'), [(2, 30), (2, 7), (6, 30)], ids=['X', 'many X', 'F'])
@pytest.mark.parametrize('off', [0.05, 0.2])
def test_a_wrong_sample_raises_nothing_however_far_a_statistic_has_come(
    reference, signal, every, off
):
    rows = driven(600, seed=5, **STEPS)
    rows[61::every, signal] = np.clip(rows[61::every, signal] + off, 0.0, 1.0)
    trace = ScadaMonitor(SETTINGS, reference).run_samples(rows)
    assert not trace['alarm'].any()


@pytest.mark.parametrize(
    ('signal', 'first', 'second'),
    [(signal, a, b) for signal in (2, 3, 4) for a in (-0.1, 0.1) for b in (-0.1, 0.1)],
)
def test_two_wrong_samples_that_the_flow_knows_nothing_of_raise_nothing(
    reference, signal, first, second
):
    rows = driven(400, seed=5, **STEPS)
    for at in range(85, 400, 60):
        rows[at : at + 2, signal] += first, second
    trace = ScadaMonitor(SETTINGS, reference).run_samples(rows)
    assert not trace['alarm'].any()


def test_a_wrong_flow_and_a_wrong_position_after_it_raise_nothing(reference):
    rows = driven(400, seed=5, **STEPS)
    for at in range(85, 400, 60):
        rows[at, 6] -= 0.2
        rows[at + 1, 2] -= 0.2
    trace = ScadaMonitor(SETTINGS, reference).run_samples(rows)
    assert not trace['alarm'].any()


def with_wrong_samples(rows: np.ndarray, until: int) -> np.ndarray:
    """Let a record show that single samples of it are wrong now and then."""
    rows[61:until:15, 6] = np.clip(rows[61:until:15, 6] - 0.2, 0.0, 1.0)
    return rows


@pytest.mark.parametrize('signal', [2, 3, 4, 6], ids=['X', 'P1', 'P2', 'F'])
@pytest.mark.parametrize('off', [-0.2, 0.2])
def test_two_wrong_samples_raise_nothing_where_the_record_has_shown_single_ones(
    reference, signal, off
):
    rows = with_wrong_samples(driven(400, seed=5, **STEPS), 160)
    for at in range(175, 400, 30):
        rows[at : at + 2, signal] = np.clip(rows[at : at + 2, signal] + off, 0.0, 1.0)
    trace = ScadaMonitor(SETTINGS, reference).run_samples(rows)
    assert not trace['alarm'].any()


@pytest.mark.parametrize('fault', [{'f13': 0.25}, {'f17': 0.1}, {'f19': 0.25}])
def test_there_a_fault_is_found_with_the_third_sample(reference, fault):
    rows = with_wrong_samples(driven(300, 6, 155, **fault, **STEPS), 150)
    trace = ScadaMonitor(SETTINGS, reference).run_samples(rows)
    assert 155.0 < trace['t'][trace['alarm']][0] <= 157.0


@pytest.mark.parametrize('shown', [True, False], ids=['wrong samples before', 'none before'])
def test_there_what_a_slightly_wrong_flow_brought_is_taken_back_as_well(reference, shown):
    right = driven(200, seed=6, **STEPS)
    if shown:
        right = with_wrong_samples(right, 150)
    monitor = ScadaMonitor(SETTINGS, reference)
    r2 = monitor.run_samples(right)['r2'][175]
    rows = right.copy()
    rows[175, 6] += (5.0 - r2) * monitor.state.sq
    after = [ScadaMonitor(SETTINGS, reference).run_samples(r)['ratio'][176] for r in (rows, right)]
    assert (after[0] < after[1] + 0.01) == shown


def test_wrong_samples_of_long_ago_do_not_count(reference):
    monitor = ScadaMonitor(SETTINGS, reference)
    monitor.run_samples(with_wrong_samples(driven(200, seed=6, **STEPS), 150))
    assert wary(monitor.state)
    later = driven(9000, seed=6, **STEPS)[200:]
    monitor.run_samples(later)
    assert not wary(monitor.state)


@pytest.mark.parametrize('fault', [{'f13': 0.25}, {'f17': 0.1}], ids=['X', 'P1'])
def test_what_the_flow_answers_is_believed_with_the_second_sample(reference, fault):
    trace = ScadaMonitor(SETTINGS, reference).run_samples(driven(300, 6, 155, **fault, **STEPS))
    assert trace['t'][trace['alarm']][0] == 156.0


@pytest.mark.parametrize(
    ('signal', 'off'), [(2, 0.1), (3, -0.1), (4, -0.1)], ids=['X', 'P1', 'P2']
)
def test_what_stays_away_is_believed_without_the_flow_with_the_third(reference, signal, off):
    rows = driven(300, seed=6, **STEPS)
    rows[155:, signal] += off
    trace = ScadaMonitor(SETTINGS, reference).run_samples(rows)
    assert 155.0 < trace['t'][trace['alarm']][0] <= 157.0


@pytest.mark.parametrize('shown', [True, False], ids=['by the flow', 'by X alone'])
def test_one_sample_of_x_is_believed_where_the_flow_shows_it_too(shown):
    known = learn(driven(3600, seed=1, **STEPS), replace(SETTINGS, learn_s=3600.0))
    rows = driven(300, seed=6, **STEPS)
    act, row = SETTINGS.record()['act'][0], rows[175]
    before = nominal_flow(act, row[2], *row[3:6])
    row[2] -= 0.04
    if shown:
        row[6] += nominal_flow(act, row[2], *row[3:6]) - before
    trace = ScadaMonitor(SETTINGS, known).run_samples(rows)
    assert trace['alarm'][175] == trace['alarm'].any() == shown


def test_a_small_f13_that_a_quick_positioner_takes_back_is_found_with_the_second_sample(reference):
    """X shows it for one sample, then the flow alone."""
    rows = driven(300, seed=6, **STEPS)
    rows[155, 2] += 0.1
    rows[156:, 6] += 0.08
    trace = ScadaMonitor(SETTINGS, reference).run_samples(rows)
    assert trace['t'][trace['alarm']][0] == 156.0


@pytest.mark.parametrize('lasts', [2, 40])
def test_a_pressure_is_known_again_after_two_wrong_samples_and_after_a_step(reference, lasts):
    rows = driven(300, seed=6, **STEPS)
    rows[155 : 155 + lasts, 4] += 0.1
    monitor = ScadaMonitor(SETTINGS, reference)
    monitor.run_samples(rows[:157])
    for row in rows[157:180]:
        monitor.run_samples(row[None, :])
        assert monitor.state.p_hat[1] == pytest.approx(row[4], abs=0.01)


def test_wrong_samples_of_both_pressures_in_a_row_are_no_process_fault(reference):
    """Nothing moves P1 for one second and P2 for the next; what stays away is a fault."""
    state, known = np.zeros(1, MONITOR), reference.copy()
    known['drop'], known['swing'] = 0.2, 0.05
    s = state[0]
    s.level[:] = math.nan

    def told(p1: float, p2: float) -> float:
        return process_residual(s, known[0], p1, p2, math.nan)

    assert [told(0.9, 0.6) for _ in range(3)] == [0.0, 0.0, 0.0]
    assert [told(0.9, 0.8), told(0.7, 0.6), told(0.9, 0.6)] == [1.0, 0.0, 0.0]
    assert [told(0.7, 0.6), told(0.7, 0.6), told(0.7, 0.8)] == [1.0, 1.0, 1.0]
