# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""An alarm from its begin to its end, on records of seconds, also as plain Python."""

import dataclasses
import math

import numpy as np
import pytest
from damadics_fd.core.signature import state as st
from damadics_fd.core.signature.own_alarm import (
    material,
    own_level,
    persists,
    start_alarm,
    weigh_absence,
)
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.signature import Signature
from damadics_fd.core.signature.step import CHANGED, QUIET, pass_by

from .balance import DT, QUICK, Strokes, take

pytestmark = pytest.mark.plain
SECOND = 1_000_000_000


@pytest.fixture(scope='module')
def learned():
    """Return what a signature has learned of the valve in 40 s, and what it told meanwhile."""
    strokes = Strokes(seed=1)
    signature = Signature(QUICK)
    results = take(signature, strokes.columns(strokes.motion(32.0)))
    assert signature.view().state == st.STATE_MONITOR
    return signature.save(), results


def monitoring(learned, seed, settings=QUICK):
    signature = Signature(settings)
    signature.load(learned[0])
    return signature, Strokes(seed)


def test_a_valve_is_learned_verified_and_left_alone(learned):
    saved, results = learned
    assert np.sum(results == CHANGED) == 2  # LEARN to VERIFY to MONITOR
    assert saved['verified'] == 1
    assert saved['kappa'] < 1.5
    assert saved['theta'][st.X1] == pytest.approx(1.0, abs=0.02)
    assert saved['theta'][st.SIGN] == pytest.approx(0.0108, abs=0.003)


@pytest.mark.parametrize(
    ('change', 'cause', 'value', 'tolerance'),
    [
        ({'dF': 2.0}, 'friction_up', 2.0, 0.4),
        ({'dK': -0.08}, 'spring_softer', -0.08, 0.02),
        ({'preload': 0.08}, 'preload', 0.08 * QUICK.force_scale, 25.0),
        ({'pressure': -0.1}, 'pressure_gain', -0.1, 0.02),
        ({'dp_offset': 1.5e5}, 'dp_offset', 1.5e5, 2e4),
    ],
)
def test_a_change_raises_its_own_alarm_and_is_named_and_sized(
    learned, change, cause, value, tolerance
):
    signature, strokes = monitoring(learned, seed=2)
    take(signature, strokes.columns(strokes.motion(4.0)))
    s, c = signature.state[0], signature.record[0]
    assert (signature.view().state, own_level(s, c)) == (st.STATE_MONITOR, 0)
    take(signature, strokes.columns(strokes.motion(3.0), **change))
    assert s.own == 1
    assert s.own_t <= 7 * SECOND
    take(signature, strokes.columns(strokes.motion(13.0), **change), alarm=True)
    view = signature.view()
    assert view.cause == cause
    assert view.value == pytest.approx(value, abs=tolerance)
    assert view.confidence > 0.95
    assert (own_level(s, c), persists(s, c), material(s, c, False)) == (1, True, True)


def test_an_alarm_ends_and_the_signature_watches_again(learned):
    signature, strokes = monitoring(learned, seed=3)
    take(signature, strokes.columns(strokes.motion(6.0), dK=0.3), alarm=True)
    assert signature.view().family == st.FAMILY_ELASTIC
    results = take(signature, strokes.columns(strokes.motion(2.0)))
    s, c = signature.state[0], signature.record[0]
    assert results[0] == CHANGED
    assert (signature.view().state, signature.view().cause) == (st.STATE_MONITOR, 'none')
    assert (s.own, own_level(s, c), persists(s, c)) == (0, 0, False)
    assert math.isnan(signature.view().value)


def test_a_change_about_the_limit_goes_once_and_not_with_each_stroke(learned):
    signature, _ = monitoring(learned, seed=13)
    s, c = signature.state[0], signature.record[0]
    start_alarm(s, c)
    s.own, s.family, s.stage2, s.ne[:], s.block.age = 1, st.FAMILY_FRICTION, 1, 100.0, 1.0

    def present(D: float, blocks: int) -> list[int]:
        levels = []
        for _ in range(blocks):
            s.D[st.SET_ALARM] = s.D[st.SET_SLOW] = D
            weigh_absence(s, c)
            assert persists(s, c) == (own_level(s, c) == 1)
            levels.append(own_level(s, c))
        return levels

    least = int(s.raised_by)
    assert least >= 30
    for _ in range(5):
        assert present(0.7 * c.d_decide, least - 1) == [1] * (least - 1)
        assert present(1.1 * c.d_decide, 1) == [1]
    assert present(0.7 * c.d_decide, least)[-1] == 0
    assert present(1.1 * c.d_decide, least) == [0] * least  # not as much as an alarm needs
    assert present(1.1 * c.d_alarm, 1) == [1]


def test_an_alarm_that_no_motion_confirms_is_called_unconfirmed(learned):
    signature, strokes = monitoring(learned, seed=4)
    take(signature, strokes.columns(strokes.motion(12.0)), alarm=True)
    view = signature.view()
    assert (view.family, view.cause) == (st.FAMILY_UNCONFIRMED, 'unconfirmed')
    assert not persists(signature.state[0], signature.record[0])
    assert material(signature.state[0], signature.record[0], False)


def test_what_only_the_resting_stem_shows_is_stick_or_play(learned):
    signature, strokes = monitoring(learned, seed=5)
    take(signature, strokes.columns(strokes.motion(12.0, rest=1.5), held=0.05), alarm=True)
    view = signature.view()
    assert (view.family, view.cause) == (st.FAMILY_FRICTION, 'stick_play')
    assert view.value > 0.8
    assert math.isnan(view.std)


def test_slower_filling_is_a_loss_of_supply(learned):
    quiet = dataclasses.replace(QUICK, d_alarm=1e9)  # these strokes are not what it learned from
    signature, strokes = monitoring(learned, 6, quiet)
    signature.state['air_learned'] = 0
    for share in (1.0, 0.75):
        for _ in range(13):
            target = 0.85 if strokes.x < 0.5 else 0.15
            speed = 0.3 * (share if target > 0.5 else 1.0)
            steps = round(abs(target - strokes.x) / speed / DT)
            stroke = np.linspace(strokes.x, target, steps + 1)[1:]
            strokes.x = target
            take(signature, strokes.columns(np.r_[stroke, np.full(8, target)]))
        if share == 1.0:
            assert signature.view().state == st.STATE_MONITOR
    view = signature.view()
    assert (view.family, view.cause) == (st.FAMILY_SUPPLY, 'supply')
    assert -4e5 < view.value < -5e4  # Pa
    s, c = signature.state[0], signature.record[0]
    assert (own_level(s, c), persists(s, c), material(s, c, True)) == (1, True, True)


def test_a_stem_that_moves_against_its_force_has_no_friction(learned):
    """While the stem runs ahead of its force, only the spring can have changed."""
    signature, strokes = monitoring(learned, seed=7)
    strokes.x = 0.3
    take(signature, strokes.columns(np.full(20, 0.3)))
    s = signature.state[0]
    up = 0.3 + 0.3 * np.arange(1, 41) * DT
    take(signature, strokes.columns(up, dK=-0.4), alarm=True)
    assert s.b_p_until > s.t


def test_small_named_changes_are_not_material(learned):
    signature, _ = monitoring(learned, seed=8)
    s, c = signature.state[0], signature.record[0]
    s.state, s.confidence = st.STATE_ALARM, 0.99
    for cause, value, std, matters in (
        (st.CAUSE_FRICTION_UP, 0.1, 0.02, False),
        (st.CAUSE_FRICTION_DOWN, -0.5, 0.02, True),
        (st.CAUSE_SPRING_STIFFER, 0.005, 0.001, False),
        (st.CAUSE_SPRING_SOFTER, -0.05, 0.001, True),
        (st.CAUSE_PRELOAD, 1.0, 0.1, True),
    ):
        s.cause, s.cause_value, s.cause_std = cause, value, std
        assert material(s, c, False) is matters
    s.cause, s.cause_value, s.cause_std = st.CAUSE_FRICTION_UP, 0.28, 0.0
    assert (material(s, c, False), material(s, c, True)) == (False, True)  # hysteresis
    s.cause, s.own, s.t, s.alarm_t = st.CAUSE_UNDETERMINED, 1, 5 * SECOND, 0
    assert not material(s, c, False), 'the own alarm has a size first'
    s.now_t, s.now[:] = 5 * SECOND, (0.0, 0.0, 0.1)
    assert not material(s, c, False), 'friction by 10 %'
    s.now[:] = (0.03, 0.0, 0.1)
    assert material(s, c, False), 'and the spring by 3 %'
    for cause in (st.CAUSE_FRICTION_UP, st.CAUSE_SPRING_SOFTER):
        s.cause, s.cause_value = cause, math.nan
        s.now[:] = (0.0, 0.0, 0.1)
        assert not material(s, c, False), 'nor is one whose size is withheld, while it is small'
        s.now[:] = (0.0, 0.0, 0.9)
        assert material(s, c, False)


def test_a_clock_that_is_set_back_ends_no_alarm(learned):
    signature, strokes = monitoring(learned, seed=9)
    change = {'dK': 0.2}
    strokes.t = 100.0
    take(signature, strokes.columns(strokes.motion(6.0), **change), alarm=True)
    before = signature.view()
    s = signature.state[0]
    since, alarm_t = int(s.since), int(s.alarm_t)
    assert before.family == st.FAMILY_ELASTIC
    old = strokes.columns(strokes.motion(0.1), **change)
    assert not take(signature, (old[0] - SECOND, *old[1:]), alarm=True).any()  # older: not used
    take(signature, [column[:1] for column in old], alarm=True, ready=False)
    strokes.t = 3.0
    take(signature, strokes.columns(strokes.motion(2.0), **change), alarm=True)
    assert signature.view().family == st.FAMILY_ELASTIC
    assert s.t == pytest.approx(5 * SECOND, abs=0.1 * SECOND)
    assert since - s.since == alarm_t - s.alarm_t > 90 * SECOND


def test_learning_begins_anew_with_an_alarm_and_asks_for_motion():
    strokes = Strokes(seed=10)
    signature = Signature(QUICK)
    take(signature, strokes.columns(strokes.motion(10.0)))
    assert 0.3 < signature.progress < 0.6
    assert signature.save() == {}
    assert signature.lacking == ''
    assert take(signature, strokes.columns(strokes.motion(0.5)), alarm=True)[0] == CHANGED
    assert signature.progress < 0.1
    rest = strokes.columns(np.full(round(42.0 / DT), 0.5))
    take(signature, rest)
    assert signature.view().state == st.STATE_INSUFFICIENT
    assert 'give the valve some strokes of 0.3 of its range' in signature.lacking


def test_too_few_samples_or_no_chamber_pressure_show_nothing():
    slow = Signature(SignatureSettings(available=False, sample_period=0.1))
    strokes = Strokes(seed=11)
    columns = strokes.columns(strokes.motion(1.0))
    assert (take(slow, columns) == QUIET).all()
    assert slow.lacking == 'causes are unavailable below 40 Hz'
    blind = Signature(QUICK)
    assert (take(blind, (*columns[:2], columns[2] * np.nan, columns[3])) == QUIET).all()
    assert blind.view().state == st.STATE_UNAVAILABLE
    assert math.isnan(blind.view().value)
    thinned = Signature(QUICK)
    assert not take(thinned, [column[::2] for column in columns]).any()  # no block is whole


@pytest.mark.parametrize(
    'wrong',
    [{'theta': [1.0]}, {'sigma': 0.0}, {'kappa': 0.5}, {'J0': 'x'}, {'sigma': math.nan}],
)
def test_a_reference_that_cannot_be_is_refused(learned, wrong):
    signature, _ = monitoring(learned, seed=12)
    before = signature.state.tobytes()
    with pytest.raises(ValueError, match='signature reference'):
        signature.load({**learned[0], **wrong})
    assert signature.state.tobytes() == before


@pytest.mark.parametrize(
    ('wrong', 'said'),
    [
        ({'plug_km': (1.0,)}, 'plug_km must have'),
        ({'ne107': (1.0, 2.0)}, 'ne107 must have'),
        ({'diaphragm_area': 0.0}, 'diaphragm_area must not be 0'),
        ({'force_scale': -1.0}, 'force_scale must be positive'),
    ],
)
def test_settings_that_no_valve_has_are_refused(wrong, said):
    with pytest.raises(ValueError, match=said):
        SignatureSettings(**wrong)


def test_a_sample_within_a_block_leaves_what_the_whole_step_leaves(learned):
    whole, strokes = monitoring(learned, seed=13)
    short, _ = monitoring(learned, seed=13)
    stamp, x, ps, dp = strokes.columns(strokes.motion(8.0))
    keep = np.arange(len(stamp)) % 40 != 7
    keep[100:140] = False  # a gap of ten blocks
    stamp[60:62], x[80], ps[90], dp[95] = stamp[59], np.nan, np.inf, np.nan
    stamp[200:] -= 3 * SECOND  # the clock was set back while the filters settle
    passed = 0
    for i in np.flatnonzero(keep):
        values = int(stamp[i]), float(x[i]), float(ps[i]), float(dp[i])
        ready, alarm = not 190 <= i < 201, i >= 260
        take(whole, [np.array([value]) for value in values], alarm, ready)
        before = short.state.tobytes()
        if pass_by(short.state[0], short.record[0], *values, ready, alarm):
            passed += 1
        else:
            assert short.state.tobytes() == before
            take(short, [np.array([value]) for value in values], alarm, ready)
        assert short.state.tobytes() == whole.state.tobytes()
    assert passed > 0.6 * keep.sum()
    blind = Signature(dataclasses.replace(QUICK, available=False))
    before = blind.state.tobytes()
    assert pass_by(blind.state[0], blind.record[0], SECOND, 0.5, 1e5, 9e5, True, False)
    assert blind.state.tobytes() == before
