# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A judgement that rests on an old sample is none about now, however often it is repeated."""

import pytest

pytest.importorskip('rclpy')
from damadics_connect.ages import Ages
from damadics_connect.judgement import Judgement
from damadics_fd.ros.freshness import judged_stamp
from damadics_msgs.msg import FaultFlag

SECOND = 10**9
TODAY = 1_790_000_000 * SECOND


@pytest.mark.parametrize('origin', [SECOND, TODAY], ids=['simulated', 'dates'])
@pytest.mark.parametrize('period', [0.005, 1.0, 10.0])
def test_repeats_of_one_stamp_grow_old_and_slow_samples_do_not(origin, period):
    ages = Ages()
    shown = max(period, 1.0)  # a flag is repeated every second
    last = 0.0
    for n in range(12):
        last = n * shown
        ages.heard('lv1', origin + int(last * SECOND), last)
        for later in (0.0, 0.5, 0.99 * shown):
            assert not ages.old('lv1', origin + int((last + later) * SECOND), last + later)
    for k in range(200):
        now = last + k
        ages.heard('lv1', origin + int(last * SECOND), now)
        old = ages.old('lv1', origin + int(now * SECOND), now)
        assert old == (k > max(2.0, 3.0 * shown) + 1.0), k


def test_a_lasting_delay_shows_and_other_valves_are_not_concerned():
    ages = Ages()
    for n in range(10):
        ages.heard('late', TODAY + (n - 30) * SECOND, float(n))
        ages.heard('good', TODAY + n * SECOND, float(n))
    assert ages.old('late', TODAY + 9 * SECOND, 9.0)
    assert not ages.old('good', TODAY + 9 * SECOND, 9.0)
    assert not ages.old('unheard', TODAY, 9.0)


def test_flags_of_before_the_first_sample_make_no_later_one_old():
    ages = Ages()
    for second in range(6):
        flag = FaultFlag(state=FaultFlag.STATE_NOT_MONITORING)
        ages.heard('lv1', judged_stamp(flag), float(second))
    for second in range(6, 12):
        flag = FaultFlag(state=FaultFlag.STATE_HEALTHY)
        flag.header.stamp.sec = second - 5
        ages.heard('lv1', judged_stamp(flag), float(second))
        assert not ages.old('lv1', 0, second + 0.1)
    assert ages.old('lv1', 0, 80.0)


@pytest.mark.parametrize(
    ('state', 'fault', 'then'),
    [
        ('healthy', False, 'not_monitored'),
        ('learning', False, 'not_monitored'),
        ('alarm', True, 'not_monitored'),
        ('latched', True, 'not_monitored'),
        ('unknown', False, 'unknown'),
    ],
)
def test_a_silent_valve_keeps_its_alarm_and_one_that_was_lost(state, fault, then):
    before = Judgement('lv1', state=state, fault=fault, ne107='normal', occurrence=3)
    after = before.silent()
    assert (after.state, after.fault, after.occurrence) == (then, fault, 3)
    assert after.ne107 == 'function_check'
