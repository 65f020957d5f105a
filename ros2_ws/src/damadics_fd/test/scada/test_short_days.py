# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Mode scada on records of minutes: learned, watched, named; also as plain Python."""

import dataclasses
import math

import numpy as np
import pytest
from damadics_fd.core.bank.bank import Bank
from damadics_fd.core.decision.alarm import RAISED
from damadics_fd.core.modes import PHASE_HOLD, PHASE_MONITOR
from damadics_fd.core.monitor import Chain
from damadics_fd.core.quality import Refused
from damadics_fd.core.result import events_in
from damadics_fd.core.sample import Sample
from damadics_fd.core.scada.judging.cusum import TEST_NAMES, siegmund_limit
from damadics_fd.core.scada.judging.limits import cusum_maximum
from damadics_fd.core.scada.laws.actuator import F_RANGE, P_RANGE, T_RANGE, TPH_PER_KGS
from damadics_fd.core.scada.laws.identify import identify
from damadics_fd.core.scada.laws.plausible import check_flow
from damadics_fd.core.scada.learning import LearningError, learn
from damadics_fd.core.scada.monitor import ScadaMonitor
from damadics_fd.core.scada.naming.isolation import misfit
from damadics_fd.core.scada.state import LAW, NOMINAL, Reference
from damadics_fd.core.settings import Settings
from damadics_fd.core.settings.identified import LIMITED, REFUSED, FaultFree
from damadics_fd.store import references as kept
from damadics_fd.store.references import load_reference, save_reference

from .driven import SETTINGS, driven, following

pytestmark = pytest.mark.plain
T, CV, X, P1, P2, T1, F = range(7)
AT = 60  # s
MODE = Settings.for_mode('scada', t_on=40.0, t_w=30.0, t_learn=270.0, hold=20.0)


@pytest.fixture(scope='module')
def reference():
    """Learn the stated actuator from four minutes."""
    return learn(driven(270, seed=1), SETTINGS)


@pytest.fixture(scope='module')
def followed():
    """Learn a valve of which CV and position alone are measured."""
    return learn(following(400, seed=2), SETTINGS, math.inf)


def columns(rows: np.ndarray) -> dict[str, np.ndarray]:
    """Return rows as columns of a recording, in SI units."""
    return {
        'stamp': np.round(rows[:, T] * 1e9).astype(np.int64),
        'cv': rows[:, CV],
        'x1': rows[:, X],
        'p1': rows[:, P1] * P_RANGE,
        'p2': rows[:, P2] * P_RANGE,
        't1': rows[:, T1] * T_RANGE,
        'flow': rows[:, F] * (F_RANGE / TPH_PER_KGS),
    }


def test_the_stated_actuator_is_learned_as_what_it_is(reference):
    ref = reference[0]
    assert (ref['stem_kind'], ref['flow_kind']) == (NOMINAL, NOMINAL)
    assert ref['s1'] == pytest.approx(0.0015, rel=0.3)
    assert ref['g1'] == pytest.approx(1.0, abs=0.05)


def test_no_alarm_without_a_fault_and_the_same_bits_sample_by_sample(reference):
    rows = driven(AT, seed=3)
    whole, single = (ScadaMonitor(SETTINGS, reference) for _ in range(2))
    trace = whole.run_samples(rows)
    parts = np.concatenate([single.run_samples(row[None]) for row in rows])
    assert not trace['alarm'].any()
    assert parts.tobytes() == trace.tobytes()
    assert whole.isolate() is None
    assert (whole.missing(), whole.drifts(), whole.strange) == ([], [], '')


@pytest.mark.parametrize(
    ('fault', 'strength', 'group'),
    [
        (13, 0.25, 'plug, seat or position sensor'),
        (17, 0.3, 'pressures'),
    ],
)
def test_a_fault_is_found_at_once_and_its_group_named(reference, fault, strength, group):
    monitor = ScadaMonitor(SETTINGS, reference)
    trace = monitor.run_samples(driven(AT + 9, 4, AT, **{f'f{fault}': strength}))
    first = trace['t'][trace['alarm']]
    assert len(first)
    assert AT <= first[0] <= AT + 8
    isolation = monitor.isolate()
    assert isolation is monitor.isolate(), 'it is made once'
    assert isolation.best.fault == fault
    assert isolation.group == group
    assert isolation.confidence[fault] == max(isolation.confidence.values())


def test_a_misfit_below_that_of_the_fault_free_record_counts_too():
    assert misfit(0.25, 1.0) == -0.75
    assert misfit(math.e, 1.0) == pytest.approx(1.0)


def test_faults_of_a_valve_that_is_not_stated_are_named_by_witnesses(followed):
    assert followed['stem_kind'][0] == LAW
    rows = following(AT + 20, seed=5)
    rows[AT:, X] = rows[AT, X]  # it sticks
    monitor = ScadaMonitor(SETTINGS, followed)
    trace = monitor.run_samples(rows)
    assert trace['alarm'][-1]
    assert not trace['alarm'][:AT].any()
    isolation = monitor.isolate()
    assert 4 in isolation.candidates
    assert isolation.group == 'actuator or positioner'
    assert [text.split()[1] for text in monitor.missing()] == ['flow', 'pressures']


def test_a_stem_that_leaves_its_command_for_its_rest_lacks_air(followed):
    rows = following(AT + 20, seed=6)
    rows[AT:, X] = np.maximum(rows[AT, X] - 0.06 * np.arange(20), 0.0)
    monitor = ScadaMonitor(SETTINGS, followed)
    monitor.run_samples(rows)
    isolation = monitor.isolate()
    assert isolation.best.fault == 16


@pytest.fixture(scope='module')
def metered():
    """Learn a valve with half of the stated Kv."""
    rows = driven(270, seed=11)
    rows[:, F] *= 0.5
    notes = []
    return learn(rows, SETTINGS, notes=notes), notes


def test_another_kv_than_the_stated_one_is_identified(metered):
    reference, notes = metered
    assert reference['flow_kind'][0] == LAW
    assert notes[0].startswith('flow characteristic identified from')
    with pytest.raises(LearningError, match=r'the flow is 0\.\d+ of that of the stated Kv'):
        check_flow(reference[0], dataclasses.replace(SETTINGS, kv_stated=True))


@pytest.mark.parametrize(
    ('flow', 'drop', 'fault'), [(1.6, 0.0, 19), (0.5, 0.0, 19), (0.8, 0.6, 17)]
)
def test_a_flow_that_does_not_fit_is_named_by_witnesses(metered, flow, drop, fault):
    rows = driven(AT + 12, seed=12)
    rows[:, F] *= 0.5
    rows[AT:, F] *= flow
    rows[AT:, P1] -= drop * (rows[AT:, P1] - rows[AT:, P2])
    monitor = ScadaMonitor(SETTINGS, metered[0])
    trace = monitor.run_samples(rows)
    assert not trace['alarm'][:AT].any()
    assert trace['alarm'][-1]
    assert fault in monitor.isolate().candidates


def test_samples_that_cannot_be_are_refused_and_leave_no_trace(reference):
    monitor = ScadaMonitor(SETTINGS, reference)
    rows = driven(4, seed=7)
    monitor.run_samples(rows[:3])
    before = monitor.states.tobytes()
    for column, value in ((CV, math.nan), (X, math.inf), (P1, 7.0), (P2, -3.0), (T, 1.0)):
        bad = rows[3].copy()
        bad[column] = value
        assert len(monitor.run_samples(bad[None])) == 0
    assert monitor.update(math.nan, 0.5, 0.5, 3.5e6, 2.6e6) is None
    assert monitor.states.tobytes() == before
    decision = monitor.update(3.0, 0.5, 0.5, 3.5e6, 2.6e6, 43.0, 8.0)
    assert not decision.alarm
    assert not decision.monitoring, 'the models settle'
    assert decision.test in TEST_NAMES


def test_samples_at_another_period_than_the_learned_one_are_told(reference):
    monitor = ScadaMonitor(SETTINGS, reference)
    rows = driven(200, seed=8)[::10]
    monitor.run_samples(np.vstack([rows, rows + np.r_[200.0, np.zeros(6)]]))
    assert 'samples come every 10 s, but every 1 s were learned from' in monitor.strange


def test_a_valve_that_stands_still_is_not_learned():
    rows = following(300, seed=9)
    rows[:, CV] = rows[:, X] = 0.5
    with pytest.raises(LearningError, match='record 200 or more'):
        learn(rows[:100], SETTINGS, math.inf)
    monitor = ScadaMonitor(SETTINGS)
    monitor.run_samples(rows)
    assert monitor.reference is None
    assert 'travelled' in monitor.learning_problem
    assert monitor.progress < 1.0


def test_an_alarm_goes_through_the_monitor_and_names_its_cause(reference):
    chain = Chain(MODE)
    with pytest.raises(ValueError, match='nothing to save: waiting for the first good sample'):
        chain.learned()
    chain.restore(Reference.plain(reference))
    result = chain.run(columns(driven(AT + 9, 4, AT, f13=0.25)))
    raised = result.detections
    assert len(raised) == 1
    assert AT <= raised[0].stamp * 1e-9 <= AT + 4
    assert 'f13 stem position sensor' in chain.status
    phases = result.estimates['phase'].tolist()
    assert (phases[0], phases[-1]) == (PHASE_HOLD, PHASE_MONITOR)
    bad = chain.update(Sample(60 * 10**9, 0.5, math.nan))
    assert isinstance(bad, Refused)
    assert bad.signal == 'x1'
    assert result.estimator.judgement.found_by == 'control-room test'
    chain.reset()
    assert chain.estimator.status == 'waiting for the first good sample'


def test_valves_in_a_bank_are_moved_learned_and_relearned(reference):
    learned = Reference.plain(reference)
    bank, other = Bank([MODE] * 2), Bank([MODE] * 2)
    alone = Chain(MODE)
    alone.restore(learned)
    bank.restore(0, learned)  # valve 1 is still learned
    rows = columns(driven(AT + 12, 4, AT, f13=0.25))
    rows['x1'][5] = math.nan
    stamp = rows.pop('stamp')
    result = alone.run({'stamp': stamp, **rows})

    def both(part):
        return (
            np.repeat([0, 1], len(stamp[part])),
            np.tile(stamp[part], 2),
            {name: np.tile(column[part], 2) for name, column in rows.items()},
        )

    bank.take(*both(slice(0, 50)))
    assert 'learning' in bank.status(1)
    for v in (0, 1):
        other.restore_bytes(1 - v, bank.tobytes(v))
        assert other.tobytes(1 - v) == bank.tobytes(v)
    valve, rest, signals = both(slice(50, None))
    changes = other.take(1 - valve, rest, signals)
    told = [event for event in events_in(changes.decisions) if event.transition == RAISED]
    assert [event.stamp for event in told] == [event.stamp for event in result.detections]
    assert other.judgement(1).test == alone.estimator.judgement.test
    assert other.judgement(0) is None
    assert other.counters(1) == result.counters
    assert other.counters(1)['not_finite'] == other.counters(0)['not_finite'] == 1
    assert other.learned(1) == learned
    other.relearn(1)
    with pytest.raises(ValueError, match='nothing to save'):
        other.learned(1)
    with pytest.raises(ValueError, match='learned state'):
        other.restore(1, learned | {'s1': 0.0})
    seen = other.tobytes(0)
    with pytest.raises(ValueError, match='is damaged'):
        other.restore_bytes(0, seen[:-8])
    other.reset(1)
    assert other.counters(1)['accepted'] == 0


# what version 0.1 kept of a valve in this mode
FIELDS_OF_0_1 = (
    *('hold', 'cv_jump', 'w', 'dp_mean', 'g0', 'g1', 'mu', 'sd', 'k', 'h', 'clip', 's1', 'kap2'),
    *('llr_limit', 'n', 'pressure_a', 'pressure_c', 'pressure_sigma', 'pressure_mean'),
    *('pressure_b', 'pressure_b0'),
)


@pytest.mark.parametrize('change', ['0.1', 'less', 'more'])
def test_a_reference_of_another_version_is_refused_with_what_to_do(reference, change, tmp_path):
    learned = Reference.plain(reference)
    if change == '0.1':
        learned = dict.fromkeys(FIELDS_OF_0_1, 1.0)
    elif change == 'less':
        del learned['period']
    else:
        learned['later'] = 1.0
    file = tmp_path / 'LC74'
    save_reference(file, kept.Reference('LC74', learned, MODE.to_dict()))
    chain = Chain(MODE)
    with pytest.raises(ValueError, match='another version.*learn anew.*commission --mode scada'):
        chain.restore(load_reference(file, 'LC74', MODE).learned)
    assert chain.status == 'waiting for the first good sample'


@pytest.mark.parametrize(
    ('samples', 'names', 'verdict', 'said'),
    [
        (420, ('stamp', 'cv', 'x1'), LIMITED, 'P1 or P2 is not measured'),
        (260, ('stamp', 'cv', 'x1'), LIMITED, 'the first half alone is not enough'),
        (60, ('stamp', 'cv', 'x1'), REFUSED, 'record 200 or more'),
    ],
)
def test_commissioning_tells_what_will_not_be_found(samples, names, verdict, said):
    record = columns(following(samples, seed=10))
    day = FaultFree('day', {name: record[name] for name in names})
    found = identify([day], Settings.for_mode('scada'))
    assert found.verdict == verdict
    assert any(said in reason for reason in found.reasons)
    assert bool(found.learned) == (verdict != REFUSED)


def test_limits_keep_their_budget():
    z = np.array([1.0, 2.0, math.nan, 9.0, -5.0])
    assert cusum_maximum(z, 0.5, 1e9) == pytest.approx(0.5 + 1.5 + 8.5)
    assert cusum_maximum(z, 0.5, 4.0) == pytest.approx(0.5 + 1.5 + 3.5)
    assert siegmund_limit(0.5, 370.0) == pytest.approx(4.77 - 1.166 + 0.5, abs=0.6)
