# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The age of a judgement by its stamp, and stamps that jump ahead (TI-5, TI-9)."""

import math
import random

import numpy as np
import pytest
from damadics_fd.ros.freshness import ForwardJumps, Freshness, default_max_age

SECOND = 10**9
TODAY = 1_790_000_000 * SECOND
PERIOD = SECOND // 200


def test_nothing_heard_is_infinitely_old():
    assert Freshness().age(TODAY, 0.0) == math.inf


@pytest.mark.parametrize(('rate', 'expected'), [(200.0, 2.0), (1.0, 3.0), (0.1, 30.0)])
def test_three_samples_or_two_seconds_are_recent(rate, expected):
    assert default_max_age(1.0 / rate) == pytest.approx(expected)


def test_a_date_is_compared_with_the_clock():
    fresh = Freshness()
    fresh.heard(TODAY, 0.0)
    assert fresh.age(TODAY + 3 * SECOND, 0.5) == pytest.approx(3.0)
    assert fresh.age(TODAY - 3 * SECOND, 0.5) == pytest.approx(-3.0)


def test_with_simulated_time_the_clock_is_that_of_the_simulation():
    fresh = Freshness(simulated=True)
    fresh.heard(5 * SECOND, 100.0)
    assert fresh.age(9 * SECOND, 1000.0) == pytest.approx(4.0)


def test_a_queue_of_a_simulated_run_shows_until_it_is_worked_off():
    """A node that stood still for 15 s takes 3000 samples afterwards, ten times as fast."""
    fresh = Freshness()
    for n in range(400):
        fresh.heard(n * PERIOD, 50.0 + n / 200)
    assert fresh.age(0, 52.0) == pytest.approx(0.0, abs=0.01)
    now = 52.0 + 15.0
    ages = []
    for n in range(400, 4000):
        now += 1 / 2000
        fresh.heard(n * PERIOD, now)
        ages.append(fresh.age(0, now))
        assert ages[-1] == pytest.approx(max(now - 50.0 - n / 200, 0.0), abs=0.01), 'true age'
    assert ages[0] == pytest.approx(15.0, abs=0.1)


def test_a_queue_that_grows_all_the_time_shows():
    fresh = Freshness()
    for n in range(20_000):
        fresh.heard(n * PERIOD, n / 190)
    assert fresh.age(0, 20_000 / 190) == pytest.approx(20_000 / 190 - 20_000 / 200, abs=0.1)


def test_a_queue_that_grows_slowly_shows_too():
    fresh = Freshness()
    for n in range(60_000):
        fresh.heard(n * PERIOD, n / 198)
    assert fresh.age(0, 60_000 / 198) == pytest.approx(60_000 / 198 - 60_000 / 200, abs=0.1)


def test_a_source_that_was_paused_is_fresh_again_after_a_while():
    rng = np.random.default_rng(0)
    fresh = Freshness()
    for n in range(200):
        fresh.heard(n * PERIOD, n / 200)
    for n in range(200, 1200):
        now = 10.0 + n / 200 + rng.exponential(0.02)
        fresh.heard(n * PERIOD, now)
        if n < 900:
            assert fresh.age(0, now) > 9.0, 'not before it is certain'
    assert fresh.age(0, 10.0 + 6.0) == pytest.approx(0.0, abs=0.3)


@pytest.mark.parametrize('period', [0.005, 1.0, 10.0])
def test_slow_sources_may_pause_too(period):
    fresh = Freshness()
    for n in range(20):
        fresh.heard(int(n * period * SECOND), n * period)
    now = 0.0
    for n in range(20, 2000 if period < 1.0 else 60):
        now = 50.0 + n * period
        fresh.heard(int(n * period * SECOND), now)
        if n == 21:
            assert fresh.age(0, now) == pytest.approx(50.0, abs=0.1)
    assert fresh.age(0, now) == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize('period', [0.005, 1.0, 10.0])
def test_a_source_that_pauses_after_its_first_sample_is_fresh_again_after_a_while(period):
    fresh = Freshness()
    fresh.heard(0, 0.0)
    ages = []
    for n in range(1, 2000 if period < 1.0 else 20):
        now = 7.0 + 3.0 * period + n * period
        fresh.heard(int(n * period * SECOND), now)
        ages.append(fresh.age(0, now))
    assert ages[0] > 6.5
    assert ages[-1] == pytest.approx(0.0, abs=0.1)


def test_another_run_begins_anew():
    fresh = Freshness()
    for n in range(200):
        fresh.heard(100 * SECOND + n * PERIOD, n / 200)
    fresh.heard(PERIOD, 5.0)
    assert fresh.age(0, 5.0) == pytest.approx(0.0, abs=1e-6)


def test_a_fast_replay_is_never_old():
    fresh = Freshness()
    for n in range(5000):
        fresh.heard(n * PERIOD, n / 4000)
        assert fresh.age(0, n / 4000) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize('first', [SECOND, TODAY])
def test_one_stamp_of_2038_is_refused(first):
    jumps = ForwardJumps()
    taken = []
    for n in range(100):
        taken += jumps.admit(first + n * PERIOD, n, n / 200)
        if n == 50:
            taken += jumps.admit(2**31 * SECOND, 'wrong', n / 200)
    assert taken == list(range(100))
    assert jumps.refused == 1


def test_a_clock_that_was_set_ahead_is_believed_and_no_sample_is_lost():
    jumps = ForwardJumps()
    taken = jumps.admit(TODAY, 0, 0.0)
    for n in range(1, 50):
        taken += jumps.admit(TODAY + 3600 * SECOND + n * PERIOD, n, n / 200)
    assert taken == list(range(50))
    assert jumps.refused == 0


def test_samples_after_a_long_silence_are_taken_at_once():
    jumps = ForwardJumps()
    jumps.admit(TODAY, 0, 0.0)
    assert jumps.admit(TODAY + 86400 * SECOND, 1, 86400.0) == [1]


def test_wild_stamps_are_refused_each():
    jumps = ForwardJumps()
    jumps.admit(SECOND, 0, 0.0)
    for n in range(1, 50):
        assert jumps.admit(n * 10**6 * SECOND, n, n / 200) == []
    assert jumps.admit(SECOND + PERIOD, 50, 0.3) == [50]
    assert jumps.refused == 49


@pytest.mark.parametrize('seed', range(20))
def test_the_short_way_lets_the_same_stamps_through(seed):
    rng = random.Random(seed)
    short, whole = ForwardJumps(), ForwardJumps()
    stamp, now = 0, 0.0
    for item in range(400):
        now += rng.choice((0.01, 0.01, 1.0, 100.0))
        stamp += rng.choice((10**7, 10**7, 10**9, -(10**9), 70 * SECOND, 10**12))
        passed = [item] if short.passes(stamp, now) else short.admit(stamp, item, now)
        assert passed == whole.admit(stamp, item, now)
        assert (short.refused, short.holds) == (whole.refused, whole.holds)
    assert whole.refused
