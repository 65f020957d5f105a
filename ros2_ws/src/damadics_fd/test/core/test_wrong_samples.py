# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Single wrong samples in mode monitor: they reach no filter, a true step does."""

import numpy as np
import pytest
from damadics_fd.commands.commission.wrong import told, without_wrong_samples, wrong_samples
from damadics_fd.core.approximator.estimator import Estimator
from damadics_fd.core.bank.bank import Bank
from damadics_fd.core.monitor import run
from damadics_fd.core.sample import SIGNALS
from damadics_fd.core.settings import Settings
from damadics_fd.core.settings.identified import FaultFree
from damadics_plant import simulate

from .synthetic import valve

SETTINGS = Settings.for_mode('monitor', own_alarm=False)
WRONG = {'x1': 0.98, 'p1': 1e5, 'p2': 4.2e6, 'ps': 9e5}
GOOD = (0.5, 0.5, 3.5e6, 2.6e6, 20.0, 5.0, 1.4e5)


def told_of(samples, settings=SETTINGS):
    """Return what becomes of samples 5 ms apart: the reason of refusal, 0 where there is none."""
    estimator = Estimator(settings)
    return [
        getattr(estimator.update((i + 1) * 5_000_000, *sample), 'reason', 0)
        for i, sample in enumerate(samples)
    ], estimator


def with_x(x):
    return (GOOD[0], x, *GOOD[2:])


@pytest.mark.parametrize('signal', WRONG)
def test_a_wrong_sample_leaves_no_trace(signal):
    columns = valve(4.0)
    rows = np.arange(100, 700, 50)
    columns[signal][rows] = WRONG[signal]
    clean = {name: np.delete(column, rows) for name, column in columns.items()}
    dirty = run(columns, SETTINGS)
    assert np.flatnonzero(~dirty.accepted).tolist() == rows.tolist()
    assert dirty.counters['spike'] == len(rows)
    assert dirty.estimator.last_rejection == f'spike: {signal} = {WRONG[signal]:g}'
    assert dirty.estimator.state.tobytes() == run(clean, SETTINGS).estimator.state.tobytes()


def spoilt(columns, share):
    """Put wrong values, far off, into a share of the samples of every signal."""
    rng = np.random.default_rng(0)
    late = columns['stamp'] > 60e9  # when it is armed
    for signal, far in {'x1': 0.2, 'p1': 0.6e6, 'p2': 0.6e6, 'ps': 4e4}.items():
        rows = np.flatnonzero(late & (rng.random(len(late)) < share))
        columns[signal][rows] += far * rng.choice([-1.0, 1.0], len(rows))
    return columns


def test_wrong_samples_raise_no_alarm_and_hide_no_fault():
    good = valve(120.0, noise=1e-4)
    result = run(spoilt(good, 2e-3), SETTINGS)
    assert result.counters['spike'] > 50
    assert result.detections == []
    worse = valve(120.0, noise=1e-4, friction=lambda t: 0.011 * (1.0 + 4.0 * (t > 90.0)))
    result = run(spoilt(worse, 2e-3), SETTINGS)
    assert [event.stamp * 1e-9 for event in result.detections] == [pytest.approx(90.1, abs=0.2)]


def test_a_stem_that_is_thrown_by_its_spring_is_believed_at_once():
    for rate in (50.0, 100.0, 200.0, 400.0):
        plant = simulate('random_spring', rate=rate, model='lugre', duration=72.0, noise=True)
        result = run(plant, Settings.for_mode('monitor', sample_rate=rate))
        assert result.accepted.all()


@pytest.mark.plain
def test_what_the_next_sample_confirms_is_believed():
    reasons, estimator = told_of([GOOD] * 3 + [with_x(0.8)] * 3)
    assert [int(reason) for reason in reasons] == [0, 0, 0, 6, 0, 0]
    assert estimator.refused.name == 'spike' and estimator.refused.signal == 'x1'
    assert 'wiring' in estimator.refused.remedy


@pytest.mark.plain
def test_wrong_samples_in_a_row_confirm_nothing_but_keep_nobody_out():
    reasons, _ = told_of([GOOD, with_x(0.9), with_x(0.1), with_x(0.95), GOOD, with_x(0.9), GOOD])
    assert [bool(reason) for reason in reasons] == [False, True, True, True, False, True, False]
    random = np.random.default_rng(1).random(400)
    reasons, _ = told_of([with_x(x) for x in random])
    longest = max(map(len, ''.join(' x'[bool(reason)] for reason in reasons).split()))
    assert 1 < longest <= 40  # 0.2 s: then any place may be true


@pytest.mark.plain
def test_modes_that_judge_single_samples_themselves_see_them():
    reasons, _ = told_of([GOOD, with_x(0.9), GOOD], Settings.for_mode('paper'))
    assert reasons == [0, 0, 0]


def test_a_bank_of_valves_names_the_signal_of_each():
    bank = Bank([SETTINGS] * 2)
    bad = [2.6e6] * 3 + [4.2e6, np.nan, 1e5, np.nan] * 250  # 5 s of wrong and missing ones
    for i, p2 in enumerate(bad):
        rows = {name: np.full(2, value) for name, value in zip(SIGNALS, GOOD, strict=True)}
        rows['p2'][1] = p2
        taken = bank.take(np.array([0, 1]), np.full(2, (i + 1) * 1_000), rows)
        assert taken.reason.tolist() == [0, 0 if i < 3 else 1 if np.isnan(p2) else 6]
        if i > 900 and not np.isnan(p2):
            assert bank.failing(1).text == f'spike: p2 = {p2:g}'
    assert bank.failing(0) is None


def test_a_recording_is_cleaned_of_wrong_samples_and_of_nothing_else():
    columns = valve(60.0, noise=1e-3)
    columns['cv'] = np.where(columns['stamp'] % 10_000_000_000 < 5e9, 0.7, 0.3)  # steps are true
    columns['ps'] += 2e3 * np.random.default_rng(2).standard_normal(len(columns['ps']))
    clean, found = without_wrong_samples([FaultFree('a', columns)])
    assert found == {} and told(found) == []
    assert all(clean[0].columns[name] is columns[name] for name in columns)
    rows = {'cv': [500], 'x1': [800, 7000], 'p1': [900], 'p2': [1000], 'ps': [800]}
    spoilt = {name: column.copy() for name, column in columns.items()}
    for name, places in rows.items():
        spoilt[name][places] += {'cv': 0.1, 'x1': 0.05}.get(name, 4e4)
    clean, found = without_wrong_samples([FaultFree('a', spoilt)])
    assert found == {name: len(places) for name, places in rows.items()}
    for name, places in rows.items():
        assert np.flatnonzero(np.isnan(clean[0].columns[name])).tolist() == places
    assert 'x1 2' in told(found)[0]


@pytest.mark.plain
def test_neighbours_that_were_not_measured_do_not_hide_a_wrong_sample():
    x = np.r_[np.full(9, 0.5), np.nan, 0.9, np.nan, np.full(9, 0.5), np.full(9, 0.6)]
    assert wrong_samples(x).nonzero()[0].tolist() == [10]
    assert not wrong_samples(np.full(5, np.nan)).any()
