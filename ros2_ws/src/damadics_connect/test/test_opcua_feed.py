# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A subscription whose messages come late, in heaps, or with a clock that is set."""

import numpy as np
import pytest

pytest.importorskip('asyncua')
from damadics_connect.joining import NANO
from damadics_connect.opcua.feed import Feed, Options
from damadics_connect.opcua.horizon import Horizon
from damadics_connect.opcua.wire import Changes
from damadics_connect.valve_list import Signal, ValveSource

DAY0 = 1_760_000_000 * NANO
CV, X1, P1 = range(3)


class Kept:
    """An output that keeps what it gets."""

    samples = 0
    zero: set[str] = set()

    def __init__(self):
        self.rows = []

    def send(self, valve, stamp, values):
        self.rows.append((stamp, values))

    def flush(self):
        pass

    @property
    def stamps(self):
        return np.array([stamp for stamp, _ in self.rows])


class Rig:
    """A feed of one valve and the clocks of server and receiver."""

    def __init__(self, period):
        self.kept = Kept()
        signals = tuple(Signal(slot, f'i={slot}', float) for slot in (CV, X1, P1))
        valve = ValveSource('lv1', 'LV-1', period, signals)
        self.feed = Feed(period, {0: valve}, Options(), self.kept)
        self.feed.begin(0)

    def message(self, now, published, *stamps, value=None):
        """At a time [s] of the receiver, take a message put together at another [s]."""
        at = self.feed.hear(DAY0 + round(published * NANO), round(now * NANO))
        if stamps:
            times = [DAY0 + round(s * NANO) for s in stamps for _ in range(3)]
            values = [s if value is None else value for s in stamps for _ in range(3)]
            handles = [0, 1, 2] * len(stamps)
            n = len(times)
            changes = Changes(handles, values, [0] * n, times, [''] * n)
            self.feed.take(changes, DAY0 + round(published * NANO), at)
        self.feed.look(at)


def test_a_server_or_receiver_that_is_held_up_costs_no_sample_and_makes_none_up():
    """At 50 Hz, every few messages come late and in a heap; every change is judged as it was."""
    rig = Rig(0.02)
    chance = np.random.default_rng(1)
    free = late = 0.0  # when server and receiver can go on
    n = 0
    for cycle in range(3000):
        put = max(0.02 * cycle, free)
        if chance.random() < 0.02:
            put = free = put + chance.uniform(0.05, 1.0)  # the server stands still
        came = max(put + 0.002, late)
        if chance.random() < 0.02:
            came = late = came + chance.uniform(0.05, 1.0)  # we do
        due = []
        while 0.02 * n <= put - 0.001:
            due.append(0.02 * n)
            n += 1
        rig.message(came, put, *due)
    rig.message(100.0, 99.0)
    taken = {stamp: values[X1] for stamp, values in rig.kept.rows}
    for k in range(n):
        stamp = 0.02 * k
        assert taken[DAY0 + round(stamp * NANO)] == stamp, 'not judged, or as a held value'
    assert (np.diff(rig.kept.stamps) > 0).all()


@pytest.mark.parametrize('stall', [0.4, 1.0, 2.0])
def test_a_server_that_catches_up_message_by_message_has_nothing_held_in_between(stall):
    """After it stood still its first messages are empty, or hold only a part of what is due."""
    rig = Rig(0.02)
    n, put = 1, 0.0
    for cycle in range(1, 1500):
        put += 0.02 + (stall if cycle in (200, 900) else 0.0)
        most = 0 if cycle in (200, 201, 900) else 8
        due = []
        while 0.02 * n <= put - 0.001 and len(due) < most:
            due.append(0.02 * n)
            n += 1
        rig.message(put + 0.002, put, *due)
    assert n > 1400
    stamps = [DAY0 + round(0.02 * k * NANO) for k in range(1, n)]
    assert rig.kept.stamps.tolist() == stamps
    assert [values[X1] for _, values in rig.kept.rows] == [0.02 * k for k in range(1, n)]


def test_a_valve_at_rest_is_held_again_after_a_stall_without_a_gap():
    rig = Rig(0.02)
    rig.message(0.1, 0.1, 0.1)
    puts = [0.1 * k for k in range(2, 30)] + [4.9 + 0.1 * k for k in range(150)]
    for put in puts:
        rig.message(put, put)
    rig.message(puts[-1] + 0.1, puts[-1] + 0.1, puts[-1] + 0.05, value=7.0)
    assert set(np.diff(rig.kept.stamps)) <= {NANO // 50, 3 * NANO // 100}
    assert rig.kept.rows[-1][1][X1] == 7.0
    before = [row for row in rig.kept.rows if row[1][X1] != 7.0]
    assert len(before) > 50 * (puts[-1] - 0.6)


@pytest.mark.parametrize(('rate', 'most'), [(0.05, 3.0), (0.1, 9.0), (0.6, 9.0), (0.6, 30.0)])
def test_a_server_that_falls_behind_its_own_stamps_has_every_change_judged_as_it_was(rate, most):
    """It is overloaded: what it has not written yet is in none of its messages, all of today."""
    rig = Rig(0.02)
    chance = np.random.default_rng(3)
    worst = 10.0 + most / rate  # then it stays so for 20 s, and catches up
    n, put = 1, 0.0
    while put < worst + 25.0 + most:
        put += chance.uniform(0.02, 0.04)
        lag = min(most, rate * max(put - 10.0, 0.0)) - 2.0 * max(put - worst - 20.0, 0.0)
        due = []
        while 0.02 * n <= put - max(lag, 0.0):
            due.append(0.02 * n)
            n += 1
        rig.message(put + 0.002, put, *due)
    taken = {stamp: values[X1] for stamp, values in rig.kept.rows}
    for k in range(1, n):
        assert taken[DAY0 + round(0.02 * k * NANO)] == 0.02 * k, 'not judged, or as a held value'
    joiner = rig.feed.joiners['lv1']
    assert len(rig.kept.rows) == n - 1 and joiner.tally.overtaken == 0
    assert joiner.lateness(rig.feed.at) > 0.9 * min(most, 3.0), 'and that is told'


def test_changes_that_nobody_could_expect_so_late_are_counted():
    rig = Rig(0.02)
    for n in range(1, 200):
        rig.message(0.02 * n, 0.02 * n, 0.02 * n)
    for n in range(200, 300):  # the device is held up, its server is not
        rig.message(0.02 * n, 0.02 * n)
    late = [0.02 * n for n in range(200, 300)]
    rig.message(6.0, 6.0, *late)
    tally = rig.feed.joiners['lv1'].tally
    taken = {stamp: values[X1] for stamp, values in rig.kept.rows}
    judged = sum(taken[DAY0 + round(t * NANO)] == t for t in late)
    assert tally.overtaken == len(late) - judged > 0
    assert (np.diff(rig.kept.stamps) > 0).all()


@pytest.mark.parametrize('back', [3600.0, 7.0])
def test_a_clock_set_back_while_a_valve_is_at_rest_loses_no_change(back):
    """Its own stamps alone do not tell: the last change is older than the step."""
    rig = Rig(1.0)
    rig.message(0.1, 0.1, 0.0, value=0.5)
    for k in range(1, 9000):
        rig.message(0.5 * k, 0.5 * k)
    for k in range(9000, 9100):
        put = 0.5 * k - back
        changes = [put - 0.1] if k >= 9010 and k % 2 else []
        rig.message(0.5 * k, put, *changes)
    rows = dict(rig.kept.rows)
    lost = [
        k
        for k in range(9011, 9100, 2)
        if rows.get(DAY0 + round((0.5 * k - back - 0.1) * NANO), [0, 0])[X1]
        != pytest.approx(0.5 * k - back - 0.1)
    ]
    assert not lost
    assert rig.feed.joiners['lv1'].tally.steps == 1


def test_a_value_that_does_not_change_is_held_as_far_as_the_server_has_spoken():
    rig = Rig(0.02)
    rig.message(0.1, 0.1, 0.1)
    for k in range(1, 40):
        rig.message(0.1 + 0.1 * k, 0.1 + 0.1 * k)
    newest = (rig.kept.stamps[-1] - DAY0) / NANO
    assert 3.8 < newest < 4.0
    assert set(np.diff(rig.kept.stamps)) == {NANO // 50}
    before = len(rig.kept.rows)
    rig.message(9.0, 4.1)  # it was on its way for five seconds
    assert len(rig.kept.rows) - before <= 5 + 1


def test_a_server_that_speaks_seldom_is_not_waited_for():
    feed = Rig(0.02).feed
    assert feed.prompt
    feed.patience = 5.0  # as the server has revised it
    assert not feed.prompt
    assert feed.hear(DAY0, 7 * NANO) == 7 * NANO


@pytest.mark.parametrize('step', [-3600.0, -5.0, -0.5, 0.5, 5.0, 3600.0])
def test_a_server_whose_clock_is_set_is_followed(step):
    horizon = Horizon()
    horizon.begin(0)
    ats = []
    for k in range(1000):
        now = 0.1 * k
        published = DAY0 + round((now + (step if k >= 50 else 0.0)) * NANO)
        ats.append(horizon.heard(published, round(now * NANO)) / NANO)
    lag = np.array([0.1 * k - at for k, at in enumerate(ats)])
    assert lag.max() < 0.11 + (0.5 if step == -0.5 else 0.0)
    assert abs(lag[-1]) < 1e-6
    assert (np.diff(ats) >= 0.0).all()


def test_a_lasting_delay_is_taken_for_the_least_after_a_while():
    horizon = Horizon()
    horizon.begin(0)
    lag = []
    for k in range(1000):
        now = 0.1 * k + (2.0 if k >= 50 else 0.0)
        at = horizon.heard(DAY0 + round(0.1 * k * NANO), round(now * NANO))
        lag.append(now - at / NANO)
    assert lag[51] == pytest.approx(2.0, abs=0.01)
    assert lag[-1] == pytest.approx(0.0, abs=0.01)


def test_messages_without_a_time_count_when_they_come():
    horizon = Horizon()
    horizon.begin(0)
    assert [horizon.heard(0, n) for n in (5, 7, 6)] == [5, 7, 7]


def test_a_day_at_one_hertz_with_clock_steps_and_daylight_saving():
    """Source and server stamp in local time; the clock is also set by seconds, both ways."""
    rig = Rig(1.0)
    steps = {7_200: 3600.0, 30_000: -3600.0, 40_000: 7.0, 50_000: -7.0, 60_000: 0.4, 70_000: -0.4}
    offset, wanted = 0.0, []
    for t in range(86_400):
        offset += steps.get(t, 0.0)
        wanted.append(DAY0 + round((t + offset) * NANO))
        rig.message(t + 0.55, t + offset + 0.5, t + offset, value=float(t))
    rig.message(86_401.6, 86_401.5 + offset)
    lost = set(wanted) - set(rig.kept.stamps.tolist())
    assert len(lost) <= 2 * sum(step < 0.0 for step in steps.values())
    assert len(rig.kept.rows) == pytest.approx(86_400, abs=10)
    by_time = dict(rig.kept.rows)
    assert all(by_time[stamp][X1] == t for t, stamp in list(enumerate(wanted))[40_001:49_900])
    tally = rig.feed.joiners['lv1'].tally
    assert tally.steps == 2 and tally.gaps <= 4
