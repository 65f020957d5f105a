# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Blocks are checked before compiled code; members decide as single monitors."""

import array

import numpy as np
import pytest
from damadics_fd.core.monitor import Chain
from damadics_fd.core.sample import SIGNALS
from damadics_fd.core.settings import Settings
from damadics_fd.core.stamps import DATE, SECOND

pytest.importorskip('damadics_msgs.msg')
from damadics_fd.nodes.fleet import blocks, status
from damadics_fd.nodes.fleet.ages import Ages
from damadics_fd.nodes.fleet.handover import Handover
from damadics_fd.nodes.fleet.members import Member, Members, members_of
from damadics_fd.nodes.fleet.raw_block import block_of
from damadics_fd.ros.raw import sample_of
from damadics_fd.store.alarms import AlarmStore
from damadics_fd.store.fleet_file import FleetError, Valve
from damadics_msgs.msg import FaultFlag, FleetLayout, Measurement, MeasurementBlock
from damadics_plant import simulate
from rclpy.serialization import serialize_message

VERSION = 7


def block(valve, stamp, layout=VERSION, **signals):
    message = MeasurementBlock(layout=layout)
    message.valve = array.array('I', np.asarray(valve, np.uint32).tobytes())
    message.stamp = array.array('q', np.asarray(stamp, np.int64).tobytes())
    for name, column in signals.items():
        setattr(message, name, array.array('d', np.asarray(column, np.float64).tobytes()))
    return message


def raw(*columns, **signals):
    return block_of(block(*columns, **signals))


def member(number, mode='paper'):
    return Member(f'/lv{number}', f'LV-{number}', '', Settings.for_mode(mode), None, '')


def test_a_good_block_is_taken_whole():
    rows, refused = blocks.check(raw([0, 1], [5, 5], cv=[0.1, 0.2], x1=[0.3, 0.4]), VERSION, 2)
    assert not refused
    assert rows.valve.tolist() == [0, 1]
    assert sorted(rows.signals) == ['cv', 'x1']


@pytest.mark.parametrize(
    ('message', 'reason'),
    [
        (block([0], [1], layout=VERSION + 1, cv=[0.0]), blocks.LAYOUT),
        (block([0, 1], [1], cv=[0.0, 0.0]), blocks.LENGTHS),
        (block([0, 1], [1, 1], cv=[0.0]), blocks.LENGTHS),
    ],
)
def test_a_block_that_cannot_be_understood_is_refused_whole(message, reason):
    rows, refused = blocks.check(block_of(message), VERSION, 2)
    assert not len(rows.valve)
    assert [one.reason for one in refused] == [reason]


def test_rows_of_unknown_valves_and_impossible_stamps_are_refused_alone():
    message = block([0, 9, 1], [1, 1, -1], cv=[0.1, 0.2, 0.3])
    rows, refused = blocks.check(block_of(message), VERSION, 2)
    assert rows.valve.tolist() == [0]
    assert rows.signals['cv'].tolist() == [0.1]
    assert {one.reason for one in refused} == {blocks.UNKNOWN, blocks.STAMP}
    counts = blocks.Refused(2)
    counts.note(refused, 'gateway')
    assert counts.by_valve.tolist() == [0, 1]
    assert counts.by_sender == {'gateway': 2}


def test_a_gateway_numbers_the_valves_as_it_likes():
    others = blocks.OtherLayouts(['/a', '/b'])
    others.learn(FleetLayout(version=3, valve=['/elsewhere', 'b', '/a']))
    message = block([0, 1, 2, 7, 1], [5, 5, 5, 5, -1], layout=3, cv=[0.0, 0.1, 0.2, 0.3, 0.4])
    rows, refused = blocks.check(block_of(message), VERSION, 2, others)
    assert rows.valve.tolist() == [1, 0], 'the valve of another fleet is none of ours'
    assert rows.signals['cv'].tolist() == [0.1, 0.2]
    assert [(one.reason, one.rows.tolist()) for one in refused] == [
        (blocks.UNKNOWN, []),
        (blocks.STAMP, [1]),
    ]
    for version in range(1000):
        others.learn(FleetLayout(version=version + 10, valve=['/a']))
    assert others.numbers(3) is None, 'strangers fill no memory'
    assert others.numbers(1009).tolist() == [0]


def test_no_block_however_odd_brings_the_members_down():
    rng = np.random.default_rng(3)
    members = Members([member(n) for n in range(4)])
    for _ in range(300):
        n = int(rng.integers(0, 6))
        lengths = rng.choice([n, n, n, 0, n + 1], size=1 + len(SIGNALS))
        message = block(
            rng.integers(0, 6, n),
            rng.choice([-(2**63), -1, 0, 1, 2**62, 2**63 - 1], lengths[0]),
            layout=int(rng.choice([VERSION, VERSION, VERSION, 0])),
            **{
                name: rng.choice([np.nan, np.inf, -np.inf, 0.0, 0.5, 1e308], size)
                for name, size in zip(SIGNALS, lengths[1:], strict=True)
            },
        )
        rows, _ = blocks.check(block_of(message), VERSION, 4)
        assert len(rows.stamp) == len(rows.valve)
        if len(rows.valve):
            members.take(rows)
    assert np.isfinite(members.column('threshold', np.float64)).all()


def test_members_of_two_modes_decide_as_single_monitors():
    run = simulate('paper_friction', rate=400.0, duration=85.0).columns
    modes = ['paper', 'monitor', 'paper']
    members = Members([member(n, mode) for n, mode in enumerate(modes)])
    happened = []
    for first in range(0, len(run['stamp']), 5000):
        piece = slice(first, first + 5000)
        n = len(run['stamp'][piece])
        order = np.argsort(np.tile(np.arange(n), 3), kind='stable')  # the valves interleaved
        rows = blocks.Rows(
            np.repeat(np.arange(3), n)[order],
            np.tile(run['stamp'][piece], 3)[order],
            {name: np.tile(run[name][piece], 3)[order] for name in SIGNALS if name in run},
        )
        happened += members.take(rows)[0]
    for number, mode in enumerate(modes):
        alone = Chain(Settings.for_mode(mode)).run(run)
        mine = [event for valve, event in happened if valve == number]
        assert mine == alone.events
        bank, place = members.at(number)
        assert bank.decisions[place].item() == alone.decisions[-1].item()
    assert len(happened) > 10


def test_a_valve_that_falls_silent_is_not_healthy():
    members = Members([member(0), member(1)])
    ages = Ages(np.array([0.0025, 0.0025]), simulated=False)
    stamp = DATE + np.arange(3) * SECOND
    half = np.full(3, 0.5)
    rows = blocks.Rows(np.zeros(3, np.int64), stamp, {'cv': half, 'x1': half})
    assert members.take(rows).changed == {0}
    assert not members.take(blocks.Rows(rows.valve, rows.stamp + 3 * SECOND, rows.signals)).changed
    ages.heard(rows.valve, rows.stamp, 10.0)
    now = int(stamp[-1])
    fresh, old = ages.ages(now + SECOND, 11.0), ages.ages(now + 5 * SECOND, 15.0)
    assert fresh[0] == pytest.approx(1.0)
    assert np.isnan(fresh[1])
    states = [status.state_of(members, age, ages.limits)[0].tolist() for age in (fresh, old)]
    assert states[0][0] == FaultFlag.STATE_HEALTHY
    assert states[1] == [FaultFlag.STATE_NOT_MONITORING] * 2
    assert states[0][1] == FaultFlag.STATE_NOT_MONITORING


def test_a_queue_of_simulated_stamps_that_grows_shows_as_age():
    ages = Ages(np.array([0.1]), simulated=False)
    zero = np.zeros(1, np.int64)
    ages.heard(zero, np.array([5 * SECOND]), 100.0)
    assert ages.ages(0, 100.0)[0] == pytest.approx(0.0)
    ages.heard(zero, np.array([6 * SECOND]), 104.0)
    assert ages.ages(0, 104.0)[0] == pytest.approx(3.0)


@pytest.mark.parametrize('frame_id', ['', 'a', 'LV-101', 'a tag of 17 chars'])
def test_a_serialised_measurement_is_read_without_a_message(frame_id):
    message = Measurement(cv=0.1, x1=0.2, p1=3e6, p2=2e6, t1=20.0, flow=5.0, ps=1e5)
    message.header.stamp.sec, message.header.stamp.nanosec = 12, 34
    message.header.frame_id = frame_id
    sample = sample_of(serialize_message(message))
    assert sample == (12 * SECOND + 34, 0.1, 0.2, 3e6, 2e6, 20.0, 5.0, 1e5)


@pytest.mark.parametrize('data', [b'', b'\0\1\0\0', b'\0\1\0\0' + b'\xff' * 40, b'\0\0' * 40])
def test_other_bytes_are_refused(data):
    with pytest.raises(ValueError, match='measurement'):
        sample_of(data)


def test_wrong_settings_of_a_list_are_told_together():
    with pytest.raises(FleetError) as told:
        members_of([Valve('a', settings={'mas': 3.0}), Valve('b', settings={'mass': -1.0})])
    assert 'mas' in str(told.value)
    assert 'b: ' in str(told.value)


def test_layouts_differ_in_their_version():
    one = blocks.layout_version(['/a', '/b'], ['A', 'B'])
    assert one != blocks.layout_version(['/b', '/a'], ['A', 'B'])
    assert one != blocks.layout_version(['/a', '/b'], ['A', 'C'])
    assert 0 < one < 2**32


class Silent:
    """A node as far as logging goes."""

    def __init__(self):
        self.said = []

    def get_logger(self):
        return self

    def info(self, text):
        self.said.append(text)

    warning = error = info


def fed(members, columns, rows):
    """Let all members take the same rows of a recording."""
    count = rows.stop - rows.start
    for n in range(len(members)):
        signals = {name: columns[name][rows] for name in SIGNALS if name in columns}
        valve = np.full(count, n)
        yield members.take(blocks.Rows(valve, columns['stamp'][rows], signals))


def test_a_valve_goes_on_in_another_process_where_it_was(tmp_path):
    columns = simulate('paper_spring', rate=400.0, duration=80.0)
    half = len(columns['stamp']) - 3000
    alarms = tmp_path / 'alarms'
    whole = Members([member(5)])
    told = [list(fed(whole, columns, slice(a, b))) for a, b in ((0, half), (half, half + 3000))]
    first = Members([member(4), member(5)])
    list(fed(first, columns, slice(0, half)))
    node = Silent()
    Handover(node, first, tmp_path, alarms).give()
    second = Members([member(5), member(9)])
    assert Handover(node, second, tmp_path, alarms).take() == {0}
    assert not list(tmp_path.glob('lv5.state*')), 'it can be taken once'
    rest = list(fed(second, columns, slice(half, half + 3000)))
    assert rest[0].happened == told[1][0].happened
    (bank, place), (alone, _) = second.at(0), whole.at(0)
    assert str(bank.decisions[place]) == str(alone.decisions[0])
    assert str(bank.estimates[place]) == str(alone.estimates[0])
    assert bank.detector(place).save() == alone.detector(0).save()
    assert bank.counters(place) == alone.counters(0)


def test_a_state_that_does_not_fit_or_is_older_than_the_alarm_is_not_taken(tmp_path):
    members = Members([member(1), member(2)])
    columns = simulate('nominal', rate=400.0, duration=1.0)
    list(fed(members, columns, slice(0, 400)))
    node = Silent()
    Handover(node, members, tmp_path, None).give()
    detector = members.at(0)[0].detector(0)
    detector.state['stamp'] += SECOND
    AlarmStore(tmp_path / 'lv1.alarm').save(detector.save())
    other = Member('/lv2', 'LV-2', '', Settings.for_mode('monitor'), None, '')
    assert Handover(node, Members([member(1), other]), tmp_path, tmp_path).take() == set()
    assert 'the alarm was kept after it' in node.said[-2]
    assert 'its settings differ' in node.said[-1]
