# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The SCADA-rate monitor on recorded data: genuine Simulink output and the real plant."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from damadics_evaluate.baselines.residuals import FirCusum
from damadics_fd.core.scada.judging.cusum import TEST_NAMES, siegmund_limit
from damadics_fd.core.scada.judging.limits import cusum_maximum
from damadics_fd.core.scada.learning import LearningError, learn
from damadics_fd.core.scada.monitor import ScadaMonitor
from damadics_fd.core.scada.samples import scada_samples
from damadics_fd.core.scada.settings import ScadaSettings
from damadics_fd.core.scada.state import LAW, NOMINAL
from damadics_plant import Fault, load_scenario, simulate

from .driven import SETTINGS, driven

DATA = Path(__file__).resolve().parents[6] / 'shared' / 'data'
T, CV, X, P1, P2, T1, F = range(7)
COLUMNS = ('stamp', 'cv', 'x1', 'p1', 'p2', 't1', 'flow')
QUARTER = ScadaSettings(learn_s=900.0)


def table(name):
    file = DATA / name
    if not file.exists():
        pytest.skip(f'{file} is not there: it carries no redistribution licence')
    return np.genfromtxt(file, delimiter=',', skip_header=1)


@pytest.fixture(scope='module')
def simulink():
    d = table('simulink_dgen_nominal_900s.csv')
    return np.column_stack([d[:, 0], d[:, 1], d[:, 4], d[:, 2], d[:, 3], d[:, 6], d[:, 5]])


@pytest.fixture(scope='module')
def lublin():
    d = table('lublin_actuator3_20min_1hz.csv')
    scale = (1.0, 0.01, 0.01, 1e3 / 4e6, 1e3 / 4e6, 1 / 200, 1 / 40)
    return d[:, (0, 5, 6, 1, 2, 3, 4)] * scale


def synthetic(n, seed=0):
    """Return samples whose position follows CV, for what needs no real valve."""
    rng = np.random.default_rng(seed)
    t = np.arange(float(n))
    cv = 0.5 + 0.25 * np.sin(2 * np.pi * 0.01 * t)
    p1 = np.full(n, 0.875)
    signals = np.column_stack([cv, p1, p1 - 0.225, np.full(n, 0.215), np.full(n, 0.5)])
    noise = rng.normal(0.0, 0.0014, (n, 5))
    noisy = signals + noise
    return np.column_stack([t, cv, noisy])


def test_residual_on_genuine_simulink_output(simulink):
    monitor = ScadaMonitor(ScadaSettings(learn_s=400.0))
    trace = monitor.run_samples(simulink)
    assert not trace['alarm'].any()
    assert np.nanstd(trace['r1']) < 0.0028  # the sensor noise alone is 0.0014
    assert trace['ratio'].max() < 0.8


def test_columns_equal_samples_bit_for_bit(simulink):
    settings = ScadaSettings(learn_s=400.0)
    whole = ScadaMonitor(settings)
    trace = whole.run_samples(simulink)
    single = ScadaMonitor(settings)
    parts = np.concatenate([single.run_samples(row[None]) for row in simulink])
    assert parts.tobytes() == trace.tobytes()
    assert single._state.tobytes() == whole._state.tobytes()


def test_no_alarm_on_the_real_plant(lublin):
    trace = ScadaMonitor(QUARTER).run_samples(lublin)
    assert not trace['alarm'].any()
    assert np.isfinite(trace['r1'][lublin[:, T] > 900]).all()


FAULTS = {
    'bias 5 %': lambda x, d: x + 0.05,
    'bias 2 %': lambda x, d: x + 0.02,
    'gain 0.9': lambda x, d: 0.9 * x,
    'stuck': lambda x, d: np.full_like(x, x[0]),
}


@pytest.mark.parametrize('name', FAULTS)
def test_injected_faults_are_found_before_the_fir_baseline(lublin, name):
    since = 920.0
    faulty = lublin.copy()
    on = faulty[:, T] >= since
    faulty[on, X] = FAULTS[name](faulty[on, X], faulty[on, T] - since)
    monitor = ScadaMonitor(QUARTER)
    monitor.run_samples(faulty)
    baseline = FirCusum()
    baseline.t_on = 900.0
    baseline.fit(lublin[:900])
    hits = np.flatnonzero(baseline.statistic(faulty) >= 12.0)
    theirs = faulty[hits[0], T] - since if hits.size else math.inf
    assert monitor.state.alarm
    assert 0.0 <= monitor.state.t_alarm - since <= theirs


def test_refused_samples_leave_the_state_alone(simulink):
    monitor = ScadaMonitor(ScadaSettings(learn_s=400.0))
    monitor.run_samples(simulink[:600])
    before = monitor._state.tobytes()
    good = simulink[600]
    for column, value in ((CV, math.nan), (X, math.inf), (P1, 7.0), (P2, -3.0), (T, 10.0)):
        bad = good.copy()
        bad[column] = value
        assert len(monitor.run_samples(bad[None])) == 0
        assert monitor._state.tobytes() == before
    bad = good.copy()
    bad[T] = math.nan
    assert len(monitor.run_samples(bad[None])) == 0
    assert len(monitor.run_samples(good[None])) == 1


def test_missing_flow_and_temperature_only_switch_their_tests_off(simulink):
    bare = simulink.copy()
    bare[:, (T1, F)] = math.nan
    monitor = ScadaMonitor(ScadaSettings(learn_s=400.0))
    trace = monitor.run_samples(bare)
    assert not trace['alarm'].any()
    assert np.isfinite(trace['r1'][401:]).all()
    assert np.isnan(trace['r2']).all()
    bare[700:, X] += 0.05
    monitor.reset()
    assert monitor.run_samples(bare)['alarm'][-1]


def test_faster_input_is_thinned_to_the_period():
    rows = synthetic(400)
    fast = np.repeat(rows, 4, axis=0)
    fast[:, T] = np.arange(len(fast)) / 4.0
    trace = ScadaMonitor().run_samples(fast)
    assert np.array_equal(trace['t'], np.arange(400.0))


def test_a_gap_restarts_the_models_without_an_alarm(simulink):
    broken = np.delete(simulink, np.s_[600:690], axis=0)
    trace = ScadaMonitor(ScadaSettings(learn_s=400.0)).run_samples(broken)
    assert not trace['alarm'].any()
    short = np.delete(simulink, np.s_[600:605], axis=0)
    trace = ScadaMonitor(ScadaSettings(learn_s=400.0)).run_samples(short)
    assert not trace['alarm'].any()


def test_a_valve_that_stands_still_is_not_learned():
    rows = synthetic(700)
    rows[:, CV] = 0.5
    rows[:, X] = 0.5
    monitor = ScadaMonitor(ScadaSettings(learn_s=400.0))
    monitor.run_samples(rows)
    assert monitor.reference is None
    assert 'travelled' in monitor.learning_problem
    with pytest.raises(LearningError, match='travelled'):
        learn(rows, ScadaSettings(learn_s=400.0))


def test_numbers_that_no_valve_has_are_not_learned_and_end_nothing():
    rows = driven(700, 3)
    rows[::3, F] = 1e308
    monitor = ScadaMonitor(SETTINGS)
    monitor.run_samples(rows)
    assert monitor.reference is None
    assert 'the flow is more than 1000 times its range in 33 %' in monitor.learning_problem
    rows = driven(700, 3)
    rows[100, F] = rows[101, F] = 1e308
    monitor = ScadaMonitor(SETTINGS)
    assert not monitor.run_samples(rows)['alarm'].any()
    assert monitor.reference is not None


@pytest.mark.parametrize(('swing', 'shift', 'kind'), [(0.1, -0.01, LAW), (0.1, 0.0, NOMINAL)])
def test_a_quiet_stem_off_the_stated_one_is_another_valve(swing, shift, kind):
    """Of a stem that hardly moves the stated actuator leaves little, whatever the valve is."""
    rows = driven(480, seed=21, swing=swing)
    rows[:, X] += shift
    settings = dataclasses.replace(SETTINGS, learn_s=480.0)
    assert learn(rows, settings)['stem_kind'][0] == kind


def test_nothing_adapts_after_learning(simulink):
    monitor = ScadaMonitor(ScadaSettings(learn_s=400.0))
    monitor.run_samples(simulink[:500])
    before = monitor.reference.tobytes()
    monitor.run_samples(simulink[500:])
    assert monitor.reference.tobytes() == before


def test_settings_name_every_error():
    with pytest.raises(ValueError, match='period_s.*sigma'):
        ScadaSettings(period_s=0.0, sigma=-1.0)


def test_the_cusum_limit_keeps_its_budget():
    k, arl = 0.5, 400.0
    h = siegmund_limit(k, arl)
    rng = np.random.default_rng(1)
    lengths = []
    for _ in range(400):
        z = rng.normal(size=6000)
        up = 0.0
        for i, value in enumerate(z):
            up = max(0.0, up + value - k)
            if up >= h:
                lengths.append(i + 1)
                break
    assert np.mean(lengths) == pytest.approx(arl, rel=0.2)


def test_cusum_maximum_by_hand():
    z = np.array([1.0, 2.0, math.nan, 9.0, -5.0])
    assert cusum_maximum(z, 0.5, 1e9) == pytest.approx(0.5 + 1.5 + 8.5)
    assert cusum_maximum(z, 0.5, 4.0) == pytest.approx(0.5 + 1.5 + 3.5)
    assert len(TEST_NAMES) == len(set(TEST_NAMES))


class Stepped:
    """The benchmark's sine for CV, with an operator's steps from 1000 s to 1600 s."""

    def at(self, t):
        sine = 0.5 + 0.25 * np.sin(2 * np.pi * 0.01 * t)
        steps = np.where((t // 150) % 2 == 0, 0.8, 0.3)
        return np.where((t >= 1000) & (t < 1600), steps, sine)


@pytest.mark.parametrize(
    ('fault', 'found'),
    [((), None), ((('f13', 0.25, 1200.0),), 1202.0), ((('f1', 0.75, 1400.0),), 1500.0)],
)
def test_an_unlearned_step_of_cv_is_no_fault_and_hides_none_for_long(fault, found):
    scenario = dataclasses.replace(
        load_scenario('nominal'),
        duration=2100.0,
        cv=Stepped(),
        faults=tuple(Fault(*f) for f in fault),
    )
    run = simulate(scenario, rate=1, noise='cv', seed=5)
    columns = {name: getattr(run, name) for name in ('cv', 'x1', 'p1', 'p2', 't1', 'flow')}
    trace = ScadaMonitor(QUARTER).run({'stamp': np.rint(run.t * 1e9).astype(int), **columns})
    alarms = trace['t'][trace['alarm']]
    if found is None:
        assert not len(alarms)
        assert trace['ratio'].max() < 0.9
    else:
        assert fault[0][2] <= alarms[0] <= found


@pytest.mark.parametrize(('first', 'step'), [(0, 2), (1, 2), (0, 3)])
def test_rare_samples_of_a_quick_valve_are_no_wrong_scale(lublin, first, step):
    rows = lublin[first::step]
    reference = learn(rows, dataclasses.replace(QUARTER, learn_from_s=0.0, learn_s=1200.0))
    assert abs(reference['stem_law']['gain'][0] - 1.0) < 0.1


def test_a_flow_that_the_stated_kv_cannot_give_is_refused():
    run = simulate('nominal', rate=1.0, duration=1000.0, noise=True, seed=11)
    rows = scada_samples({name: np.asarray(run[name]) for name in COLUMNS})
    stated = dataclasses.replace(QUARTER, kv_stated=True)
    learn(rows, stated)
    rows[:, F] *= 0.75
    with pytest.raises(LearningError, match=r'the flow is 0\.7\d of that of the stated Kv 120'):
        learn(rows, stated)
    assert learn(rows, QUARTER)['flow_kind'][0] == LAW
