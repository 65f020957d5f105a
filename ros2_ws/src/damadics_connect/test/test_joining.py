"""Signals joined to samples on the valve's clock."""

import math
import random

import numpy as np
import pytest
from damadics_connect.joining import NANO, Joiner

DAY0 = 1_760_000_000 * NANO
CV, X1, P1, P2, T1, FLOW, PS = range(7)


class Rig:
    """A joiner with a clock of its own and what it has emitted."""

    def __init__(self, period=1.0, settle=0.3, signals=(CV, X1, P1)):
        self.now = 5 * NANO
        self.rows = []
        self.joiner = Joiner(
            int(period * NANO),
            int(settle * NANO),
            signals,
            lambda stamp, values: self.rows.append((stamp, values)),
        )
        self.joiner.begin(self.now)

    @property
    def stamps(self):
        return [stamp for stamp, _ in self.rows]

    def at(self, seconds, *values, offset=DAY0):
        """At a time of the source, take (slot, value) with that stamp."""
        self.now = 5 * NANO + int(seconds * NANO)
        stamp = offset + int(seconds * NANO)
        for slot, value in values:
            self.joiner.take(slot, stamp, value, self.now)
        self.joiner.look(self.now)

    def quiet(self, begin, end, step=0.05):
        for t in np.arange(begin, end, step):
            self.at(float(t))


def test_signals_of_one_instant_are_one_sample_with_its_stamp():
    rig = Rig()
    for t in range(5):
        rig.at(t, (CV, 0.1 * t), (X1, 0.2 * t), (P1, 1.0))
    assert rig.stamps == [DAY0 + t * NANO for t in range(5)]
    assert rig.rows[3][1][:2] == pytest.approx([0.3, 0.6])
    assert math.isnan(rig.rows[3][1][PS])


def test_signals_spread_over_the_period_are_one_sample_with_the_newest_time():
    rig = Rig(settle=0.9)
    for t in range(4):
        rig.at(t, (CV, t))
        rig.at(t + 0.25, (X1, t))
        rig.at(t + 0.5, (P1, t))
    assert rig.stamps == [DAY0 + t * NANO + NANO // 2 for t in range(4)]
    assert [row[1][:3] for row in rig.rows] == [[t, t, t] for t in range(4)]


def test_no_change_is_no_silence_while_the_source_lives():
    rig = Rig()
    rig.at(0, (CV, 0.5), (X1, 0.5), (P1, 1.0))
    rig.quiet(0.1, 10.0)
    assert len(rig.rows) == pytest.approx(10, abs=2)
    assert np.diff(rig.stamps).tolist() == [NANO] * (len(rig.rows) - 1)
    rig.at(10.0, (X1, 0.7), (CV, 0.6), (P1, 1.1))
    assert rig.stamps[-1] == DAY0 + 10 * NANO, 'a change has its own stamp'
    assert rig.rows[-1][1][:3] == [0.6, 0.7, 1.1]
    assert rig.joiner.tally.gaps == 0


def test_nothing_is_held_once_nobody_looks():
    rig = Rig()
    rig.at(0, (CV, 0.5), (X1, 0.5), (P1, 1.0))
    before = len(rig.rows)
    rig.now += 60 * NANO  # the session is lost: no look
    assert len(rig.rows) == before


def test_a_batch_after_silence_is_filled_with_held_samples_in_between():
    rig = Rig(period=0.02, settle=0.2)
    rig.at(0, (CV, 0.5), (X1, 0.5), (P1, 1.0))
    rig.now += NANO // 10
    for n in (1, 2, 5):  # 3 and 4 brought no change
        rig.joiner.take(X1, DAY0 + n * NANO // 50, 0.5 + n, rig.now)
    rig.now += NANO // 4
    rig.joiner.look(rig.now)
    begin = [DAY0 + n * NANO // 50 for n in range(6)]
    assert rig.stamps[:6] == begin
    assert [row[1][X1] for row in rig.rows[:6]] == [0.5, 1.5, 2.5, 2.5, 2.5, 5.5]


@pytest.mark.parametrize('jitter', [0.0, 0.2, 0.45])
def test_every_change_is_judged_once_whatever_the_jitter(jitter):
    chance = random.Random(7)
    rig = Rig(period=0.02, settle=0.1)
    wanted = {}
    for n in range(2000):
        t = 0.02 * (n + jitter * chance.uniform(-0.5, 0.5) + 1)
        rig.at(t, (CV, float(n)), (X1, float(n)), (P1, 1.0 + n))
        wanted[DAY0 + int(t * NANO)] = float(n)
    taken = {stamp: row[X1] for stamp, row in rig.rows}
    assert wanted == taken
    assert rig.stamps == sorted(set(rig.stamps))


@pytest.mark.parametrize('stall', [0.1, 0.25])
def test_a_source_that_is_held_up_for_less_than_a_third_of_a_second_loses_nothing(stall):
    """What it had to tell comes late, in a heap, when others have been told of no change."""
    rig = Rig(period=0.02, settle=0.08)
    late = []
    for n in range(1, 500):
        rig.now = 5 * NANO + n * NANO // 50
        late.append(n)
        if not 200 <= n < 200 + stall * 50:
            for k in late:
                for slot in (CV, X1, P1):
                    rig.joiner.take(slot, DAY0 + k * NANO // 50, float(k), rig.now)
            late.clear()
        rig.joiner.look(rig.now)
    assert rig.stamps == [DAY0 + n * NANO // 50 for n in range(1, 500)]
    assert [values[X1] for _, values in rig.rows] == list(range(1, 500))


@pytest.mark.parametrize('heap', [0.5, 1.0, 1.8, 8.0])
def test_a_device_that_tells_in_heaps_is_waited_for_once_that_is_known(heap):
    """A gateway hands on what it has gathered; the first heap is not expected, all others are."""
    rig = Rig(period=0.02, settle=0.08)
    gathered = []
    for n in range(1, 2000):
        rig.now = 5 * NANO + n * NANO // 50
        gathered.append(n)
        if n % round(50 * heap) == 0:
            for k in gathered:
                for slot in (CV, X1, P1):
                    rig.joiner.take(slot, DAY0 + k * NANO // 50, float(k), rig.now)
            gathered.clear()
        rig.joiner.look(rig.now)
    rows = rig.rows[round(100 * heap) :]
    assert len(rows) > 1900 - 160 * heap
    assert [values[X1] for _, values in rows] == [(stamp - DAY0) * 50 / NANO for stamp, _ in rows]


def test_a_slow_way_of_a_temperature_does_not_hold_the_valve_up():
    """It is read once in a while and comes a minute late; stem and pressure change seldom."""
    rig = Rig(signals=(CV, X1, T1))
    rig.at(0, (CV, 0.5), (X1, 0.5), (T1, 20.0))
    heard = []
    for t in range(1, 600):
        rig.at(t)
        if t % 100 == 0:
            rig.at(t, (X1, 0.5 + 1e-3 * t))
        if t % 70 == 0:
            rig.joiner.take(T1, DAY0 + (t - 60) * NANO, 20.0 + t, rig.now)
        rig.joiner.look(rig.now)
        heard.append(len(rig.rows))
    assert np.diff(heard[2:]).max() <= 2 and (np.diff(heard[2:][::3]) > 0).all()
    assert rig.rows[-1][1][T1] == 580.0


def test_a_new_session_doubles_no_sample_and_names_the_gap():
    rig = Rig()
    for t in range(3):
        rig.at(t, (CV, t), (X1, t), (P1, t))
    rig.now = (5 + 60) * NANO
    rig.joiner.begin(rig.now)
    rig.joiner.take(CV, DAY0 + 2 * NANO, 2, rig.now)  # unchanged since before
    rig.joiner.take(X1, DAY0 + 2 * NANO, 2, rig.now)
    rig.joiner.take(P1, DAY0 + 2 * NANO, 2, rig.now)
    rig.joiner.look(rig.now)
    assert len(rig.rows) == 3
    rig.at(61, (CV, 9), (X1, 9), (P1, 9))
    assert rig.stamps[-1] == DAY0 + 61 * NANO
    assert len(rig.rows) == 4, 'the time in between is not made up'
    assert rig.joiner.tally.gaps == 1
    assert rig.joiner.tally.last_gap == (DAY0 + 2 * NANO, DAY0 + 61 * NANO)


def test_a_bad_value_at_an_unchanged_time_is_taken():
    rig = Rig()
    rig.at(0, (CV, 0.5), (X1, 0.5), (P1, 1.0))
    rig.joiner.take(X1, DAY0, math.nan, rig.now)
    rig.quiet(0.1, 3.0)
    assert math.isnan(rig.rows[-1][1][X1])
    assert rig.rows[-1][1][CV] == 0.5


def test_a_day_with_clock_steps_and_daylight_saving():
    """A source that stamps in local time: steps of an hour and of seconds, both ways."""
    rig = Rig(period=10.0, settle=1.0)
    steps = {7_200: 3600.0, 30_000: -3600.0, 50_000: 7.0, 60_000: -7.0, 70_000: -40.0}
    offset, lost = 0.0, 0
    for t in range(0, 86_400, 10):
        offset += steps.get(t, 0.0)
        rig.now = 5 * NANO + t * NANO
        stamp = DAY0 + int((t + offset) * NANO)
        before = len(rig.rows)
        for slot in (CV, X1, P1):
            rig.joiner.take(slot, stamp, float(t), rig.now)
        rig.joiner.look(rig.now)
        new = [row[0] for row in rig.rows[before:]]
        lost += stamp not in new
        rig.joiner.look(rig.now + 5 * NANO)
    assert lost <= 4, 'a step back costs a sample or two, until it is known to be one'
    assert len(rig.rows) == pytest.approx(8640, abs=8)
    assert rig.joiner.tally.steps == 2


def test_a_stamp_far_in_the_future_does_not_stop_the_valve():
    rig = Rig()
    for t in range(3):
        rig.at(t, (CV, t), (X1, t), (P1, t))
    rig.joiner.take(X1, DAY0 + 400 * 86_400 * NANO, 0.3, rig.now)
    for t in range(3, 8):
        rig.at(t, (CV, t), (X1, t), (P1, t))
    assert rig.joiner.tally.future == 1
    assert rig.stamps[-1] == DAY0 + 7 * NANO
    assert rig.rows[-1][1][X1] == 7


def test_a_signal_that_the_source_lacks_is_not_waited_for():
    rig = Rig()
    rig.joiner.without(P1)
    rig.at(0, (CV, 0.5), (X1, 0.5))
    assert rig.stamps == [DAY0]
    assert math.isnan(rig.rows[0][1][P1])


@pytest.mark.parametrize('hours', [-1.0, 1.0])
def test_a_source_whose_clock_is_not_that_of_its_server(hours):
    rig = Rig()
    off = DAY0 + int(hours * 3600 * NANO)
    rig.joiner.source_clock(DAY0, rig.now)
    for slot in (CV, X1, P1):
        rig.joiner.take(slot, off - 86_400 * NANO, 0.5, rig.now)  # unchanged since yesterday
    rig.quiet(0.1, 5.0)
    assert len(rig.rows) >= 3, 'held by the server clock, as nothing else is known'
    for t in range(5, 10):
        rig.at(t, (CV, t), (X1, t), (P1, t), offset=off)
    assert rig.stamps[-5:] == [off + t * NANO for t in range(5, 10)]


@pytest.mark.parametrize('late', [0.5, 30.0])
def test_a_valve_that_is_read_as_often_as_it_changes_is_sampled_from_its_first_change(late):
    rig = Rig(period=0.2, settle=0.35)
    rig.joiner.source_clock(DAY0, rig.now)
    off = DAY0 - int(late * NANO)
    rig.joiner.take(P1, off - 3600 * NANO, 1e5, rig.now)  # it rests
    for n in range(20):  # CV and X change between any two looks: a sample is always open
        rig.at(0.2 * n, (CV, n), (X1, n), offset=off)
    assert rig.stamps[:17] == [off + n * NANO // 5 for n in range(1, 18)]


def test_a_source_whose_time_stands_still_is_followed_by_our_clock():
    """Some servers give each value the time at which its node was made."""
    rig = Rig(period=0.2, settle=0.05)
    rig.joiner.source_clock(DAY0, rig.now)
    for n in range(100):
        now = rig.now + NANO // 5 * n
        for slot in (CV, X1, P1):
            rig.joiner.take(slot, DAY0 - 3600 * NANO, 0.001 * n, now)
        rig.joiner.look(now)
    taken = [row for row in rig.rows if row[1][X1] > 0.0105]
    assert len(taken) == pytest.approx(88, abs=3)
    assert np.diff([stamp for stamp, _ in taken[1:]]).tolist() == [NANO // 5] * (len(taken) - 2)
    assert abs(taken[-1][0] - (DAY0 + 99 * NANO // 5)) < NANO // 10
    assert rig.joiner.tally.still > 200


def test_a_bad_value_with_the_time_of_the_last_good_one_is_taken_at_once():
    rig = Rig()
    for t in range(5):
        rig.at(t, (CV, 0.1 * t), (X1, 0.2 * t), (P1, 1.0))
    rig.quiet(4.1, 8.0)
    rig.joiner.take(X1, DAY0 + 4 * NANO, math.nan, rig.now)
    rig.quiet(8.0, 8.5)
    assert math.isnan(rig.rows[-1][1][X1]) and rig.joiner.tally.still == 0
