# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bad input and bad time: the IN and TI rows of the reliability cases."""

import math

import hypothesis.strategies as st
import numpy as np
import pytest
from damadics_fd.core.approximator.estimator import Estimator
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.modes import PHASE_HOLD, PHASE_MONITOR
from damadics_fd.core.monitor import run
from damadics_fd.core.quality import Reason, Refused
from damadics_fd.core.settings import Settings, SettingsError
from hypothesis import given
from hypothesis import settings as profile

from .synthetic import valve

SETTINGS = Settings.for_mode('monitor', own_alarm=False)
QUICK = SETTINGS.replace(t_on=0.0, t_w=0.05, t_learn=0.2, travel_min=0.0)
SIGNALS = ('cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps')


@pytest.fixture(scope='module')
def armed():
    return run(valve(60.5), SETTINGS)


def continued(armed, columns):
    """Go on from the armed state, which stays as it is for the next test."""
    estimator, detector = Estimator(SETTINGS), Detector(SETTINGS)
    estimator.quality[:], estimator.state[:] = armed.estimator.quality, armed.estimator.state
    detector.state[:] = armed.detector.state
    return run(columns, SETTINGS, estimator, detector)


def without(columns, rows):
    keep = np.ones(len(columns['stamp']), bool)
    keep[rows] = False
    return {name: column[keep] for name, column in columns.items()}


BAD = {
    'cv': [math.nan, math.inf, -0.2, 1.3],
    'x1': [math.nan, -math.inf, 1.5, 1e300],
    'p1': [math.nan, 1e12],
    'p2': [math.inf, -1e6],
    'ps': [math.nan, 5e6],
    't1': [math.inf, -1e10],
    'flow': [-math.inf, 1e308],
}


@pytest.mark.parametrize('signal', BAD)
def test_refused_sample_leaves_no_trace(armed, signal):  # IN-1, IN-2
    columns = valve(4.0, first=60.5)
    rows = []
    for n, value in enumerate(BAD[signal]):
        rows += list(range(100 + 50 * n, 103 + 50 * n))
        columns[signal][rows[-3:]] = value
    dirty, clean = continued(armed, columns), continued(armed, without(columns, rows))
    assert dirty.estimator.state.tobytes() == clean.estimator.state.tobytes()
    assert np.flatnonzero(~dirty.accepted).tolist() == rows
    assert dirty.decisions[dirty.accepted].tolist() == clean.decisions.tolist()
    refused = dirty.counters['not_finite'] + dirty.counters['out_of_range']
    assert refused - armed.counters['not_finite'] == len(rows)
    assert dirty.detections == []
    assert signal in dirty.estimator.last_rejection or dirty.estimator.last_rejection == ''


@pytest.mark.plain
def test_reason_names_the_signal():
    estimator = Estimator(SETTINGS)
    assert (
        estimator.update(1, 0.5, 0.5, 3.5e6, 2.6e6, 20.0, 5.0, math.nan).reason
        == Reason.NOT_FINITE
    )
    assert estimator.last_rejection == 'not_finite: ps = nan'
    assert estimator.update(1, 0.5, 55.0, 3.5e6, 2.6e6, 20.0, 5.0, 1e5).signal == 'x1'
    assert estimator.last_rejection == 'out_of_range: x1 = 55'
    assert estimator.status == 'waiting for the first good sample'


@pytest.mark.plain
def test_unmeasured_signals_are_no_fault_in_paper_mode():
    estimator = Estimator(Settings.for_mode('paper'))
    assert estimator.update(0, 0.5, 0.5, *[math.nan] * 5).stamp == 0
    refused = estimator.update(2_500_000, 0.5, 0.5, math.inf, *[math.nan] * 4)
    assert refused == (Reason.NOT_FINITE, 'not_finite: p1 = inf', 'p1')


def stamps(*values):
    estimator = Estimator(SETTINGS)
    for value in values:
        estimator.update(value, 0.5, 0.5, 3.5e6, 2.6e6, 20.0, 5.0, 1.4e5)
    return estimator


def test_zero_duplicate_and_disordered_stamps():  # TI-2, TI-3, TI-4
    estimator = stamps(0, 5_000_000, 5_000_000, 0, 10_000_000, 7_000_000, 15_000_000)
    counters = estimator.counters
    assert counters['accepted'] == 4
    assert counters['duplicate'] == counters['zero_stamp'] == counters['out_of_order'] == 1
    assert counters['restarts'] == counters['clock_jumps'] == 0
    assert stamps(0, 0).counters['zero_stamp'] == 1
    assert stamps(5, 0).counters['zero_stamp'] == 1
    assert stamps(-5).counters['out_of_order'] == 1


def test_clock_set_back_restarts_the_filters_and_keeps_what_is_learned(armed):  # TI-5
    again = continued(armed, valve(3.0, first=0.005))
    assert again.counters['out_of_order'] == SETTINGS.clock_jump_samples - 1
    assert again.counters['clock_jumps'] == 1
    phase = again.estimates['phase'][again.accepted]
    assert set(phase[:199]) == {PHASE_HOLD}
    assert phase[-1] == PHASE_MONITOR
    assert again.estimator.learned() == armed.estimator.learned()
    assert again.detections == []


def test_single_wrong_stamp_does_not_move_the_clock(armed):
    columns = valve(2.0, first=60.5)
    columns['stamp'][100] = 1_000_000_000
    result = continued(armed, columns)
    assert result.counters['clock_jumps'] == 0
    assert result.counters['out_of_order'] == 1


def test_long_gap_restarts_the_filters_and_keeps_what_is_learned(armed):  # TI-1, TI-5
    later = continued(armed, valve(3.0, first=7200.0))
    assert later.counters['restarts'] == 1
    assert set(later.estimates['phase'][:199]) == {PHASE_HOLD}
    assert set(later.estimates['phase'][201:]) == {PHASE_MONITOR}
    assert set(later.decisions['state'][:199]) == {0}  # not monitoring
    assert later.estimator.learned() == armed.estimator.learned()
    assert later.detections == []


@pytest.mark.parametrize('share', [0.01, 0.1, 0.5])
def test_dropped_samples_leave_the_residual_consistent(share):  # TI-1
    columns = valve(120.0)
    lost = np.flatnonzero(np.random.default_rng(3).random(len(columns['stamp'])) < share)
    whole, holes = run(columns, SETTINGS), run(without(columns, lost), SETTINGS)
    assert holes.detections == []
    assert holes.counters['missed'] >= 0.9 * len(lost)
    kept = np.setdiff1d(np.arange(len(columns['stamp'])), lost)[-2000:]
    difference = whole.estimates['xi2'][kept] - holes.estimates['xi2'][-2000:]
    assert np.sqrt(np.mean(difference**2)) < 0.02


def test_jitter_raises_no_alarm():  # TI-7
    rng = np.random.default_rng(5)
    t = (np.arange(24000) + rng.uniform(-0.49, 0.49, 24000)) * 0.005 + 0.005
    fault = run(
        valve(stamps=t, noise=1e-3, friction=lambda s: 0.011 * (1 + 4 * (s > 90))), SETTINGS
    )
    assert len(fault.detections) == 1
    assert fault.detections[0].stamp * 1e-9 == pytest.approx(90.1, abs=0.2)


def test_one_sample_per_second_stays_finite():  # TI-8
    n = 20000
    rng = np.random.default_rng(0)
    columns = {
        'stamp': np.arange(n) * 1_000_000_000,
        'cv': rng.random(n),
        'x1': rng.random(n),
        'p1': 4e6 * rng.random(n),
        'p2': 4e6 * rng.random(n),
        'ps': 3e5 * rng.random(n),
    }
    result = run(columns, SETTINGS)
    assert result.counters['accepted'] == n
    for name in ('x2', 'x1_hat', 'x2_hat', 'xi1', 'xi2', 'phi'):
        assert np.isfinite(result.estimates[name]).all()


NUMBERS = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.floats(0.0, 1.0),
    st.just(0.5),
    st.sampled_from([0.0, 1.0, 1e300, -1e300, 1e-300, 3.5e6, 2.6e6, 1.4e5, math.nan, math.inf]),
)
STEPS = st.one_of(
    st.just(5_000_000),
    st.integers(-(10**10), 10**10),
    st.integers(0, 10),
    st.integers(-(2**62), 2**62),
)
SAMPLES = st.lists(st.tuples(STEPS, NUMBERS, NUMBERS, *[NUMBERS] * 5, st.booleans()), max_size=60)


@pytest.mark.parametrize('velocity', ['high_pass', 'kalman', 'super_twisting'])
@given(samples=SAMPLES)
@profile(max_examples=60, deadline=None)
def test_any_input_keeps_states_finite_and_weights_bounded(velocity, samples):  # AL-5
    settings = QUICK.replace(velocity=velocity, w_max=50.0)
    estimator, detector = Estimator(settings), Detector(settings)
    stamp = 0
    for step, cv, x1, p1, p2, t1, flow, ps, tame in samples:
        stamp = max(-(2**62), min(2**62, stamp + step))
        sample = (
            (
                0.5,
                abs(x1) % 1.0 if math.isfinite(x1) else 0.5,
                3.5e6,
                2.6e6,
                20.0,
                5.0,
                abs(ps) % 3e5 if math.isfinite(ps) else 1e5,
            )
            if tame
            else (cv, x1, p1, p2, t1, flow, ps)
        )
        before = estimator.state.tobytes()
        estimate = estimator.update(stamp, *sample)
        s = estimator.state[0]
        if isinstance(estimate, Refused):
            assert estimator.state.tobytes() == before
            assert estimator.last_rejection
            continue
        finite = (
            estimate.x2,
            estimate.x1_hat,
            estimate.x2_hat,
            estimate.xi1,
            estimate.xi2,
            estimate.phi,
            estimate.u,
            *estimate.alpha_hat,
            s.y,
            s.v,
            s.uy,
            s.uv,
            s.travel,
        )
        assert all(math.isfinite(v) for v in finite)
        norm = math.sqrt(sum(float(np.sum(s[name] ** 2)) for name in ('w1', 'w2', 'eps1', 'b1')))
        assert norm <= 50.0 * (1 + 1e-12)
        assert abs(estimate.alpha5 - settings.alpha5) <= 0.3 * settings.alpha5 * (1 + 1e-12)
        decision = detector.update(estimate)
        assert math.isfinite(decision.threshold)
        assert decision.threshold >= settings.rho_min
        assert not decision.fault or estimate.phase == PHASE_MONITOR or decision.since < stamp


@pytest.mark.plain
def test_settings_list_all_errors_at_once():  # PR-5
    with pytest.raises(SettingsError) as caught:
        Settings.from_mapping(
            {
                'mode': 'monitor',
                'k1': -1.0,
                'k3': 5.0,
                'kappa': math.nan,
                'decide_m': 2.5,
                'latch': 1,
                'plug_table': [1.0],
                'wn': 'fast',
            }
        )
    assert len(caught.value.problems) == 7
    text = str(caught.value)
    for name in (
        'k1 = -1.0',
        'k3: no such setting',
        'kappa',
        'decide_m',
        'latch',
        'plug_table',
        "wn = 'fast'",
    ):
        assert name in text
    with pytest.raises(SettingsError, match='rho_min is not larger than dz'):
        Settings.for_mode('monitor', rho_min=0.05)
    with pytest.raises(SettingsError, match='decide_m is larger than decide_n'):
        Settings.for_mode('monitor', decide_m=3)
    with pytest.raises(SettingsError, match='mode'):
        Settings.for_mode('papre')


@pytest.mark.plain
def test_settings_describe_themselves():
    for mode in ('paper', 'monitor'):
        rows = Settings.describe(mode)
        assert all(row['description'] and 'unit' in row for row in rows)
        assert all(
            row['low'] <= row['default'] <= row['high']
            for row in rows
            if row['type'] in (int, float)
        )
        built = Settings.from_mapping({row['name']: row['default'] for row in rows})
        assert built == Settings.for_mode(mode)
        assert Settings.from_mapping(built.to_dict()) == built
