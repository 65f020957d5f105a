# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The black box: a bag from before until after each fault, on a full disk too."""

import errno
import os

import numpy as np
import pytest
from damadics_fd.bag import read_columns
from damadics_fd.bag.checking.inspection import WHOLE, inspect
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.rosbag2 import Topic
from damadics_fd.bag.writing import blackbox
from damadics_fd.bag.writing.blackbox import FLAG, STATUS, BlackBox
from damadics_fd.bag.writing.latched import MOST_MESSAGES, Kept, Latched
from damadics_fd.bag.writing.whole_writes import WholeWrites

from .bag_support import needs_messages

serialization = pytest.importorskip('rclpy.serialization')
messages = pytest.importorskip('damadics_msgs.msg')
pytestmark = [needs_messages, pytest.mark.plain]
TENTH = 100_000_000
FLOAT = 'std_msgs/msg/Float64'
LATCHED = [{'durability': 'transient_local', 'depth': 1}]


def number(value: float) -> bytes:
    return b'\0\1\0\0' + np.float64(value).tobytes()


def flag(fault: bool) -> bytes:
    return serialization.serialize_message(messages.FaultFlag(fault=fault))


class Recorded:
    """A black box that hears a number ten times a second, and flags."""

    def __init__(self, path, before=1.0, after=0.5) -> None:
        self.box = BlackBox(path, before, after)
        self.numbers = self.box.add_topic('/number', FLOAT)
        self.flags = self.box.add_topic('/flag', FLAG)
        self.count = 0

    def hear(self, count: int) -> None:
        for _ in range(count):
            at = self.count * TENTH
            self.box.write(self.numbers, number(self.count), at, at)
            self.count += 1

    def tell(self, fault: bool, topic=None) -> None:
        at = self.count * TENTH - 1
        self.box.write(topic or self.flags, flag(fault), at, at)


def status(layout: int, *faults: bool) -> bytes:
    message = messages.FleetStatus(layout=layout, valve=range(len(faults)), fault=faults)
    message.cause = ['friction'] * len(faults)
    return serialization.serialize_message(message)


def test_a_fault_of_any_valve_of_a_fleet_is_written(tmp_path):
    valve = Recorded(tmp_path / 'box')
    fleet = valve.box.add_topic('/fleet/status', STATUS, LATCHED)

    def say(layout, *faults) -> list[str]:
        valve.hear(20)
        at = valve.count * TENTH - 1
        valve.box.write(fleet, status(layout, *faults), at, at)
        valve.hear(10)
        return sorted(folder.name for folder in (tmp_path / 'box').iterdir())

    assert say(1, False, False) == []
    assert say(1, False, True) == ['event_000']
    assert say(1, False, True) == ['event_000'], 'it stands already'
    assert say(1, True, True) == ['event_000', 'event_001'], 'the fault of another valve'
    assert say(1, False, False) == ['event_000', 'event_001']
    assert say(2) == ['event_000', 'event_001']
    valve.box.close()
    assert inspect(tmp_path / 'box' / 'event_001').code == WHOLE


def test_a_bag_holds_what_was_before_and_after_each_fault(tmp_path):
    valve = Recorded(tmp_path / 'box')
    info = valve.box.add_topic('/info', FLOAT, LATCHED)
    assert valve.box.add_topic('/info', FLOAT) is info
    valve.box.write(info, number(42.0), 0, 0)
    valve.hear(30)
    valve.tell(False)
    valve.tell(True)
    valve.tell(True)  # it is the same fault
    assert valve.box.unsaved > 0
    valve.hear(20)
    valve.tell(False)
    valve.tell(True)
    valve.box.flush()
    valve.box.flush_if_due()
    valve.box.close()
    assert sorted(path.name for path in (tmp_path / 'box').iterdir()) == ['event_000', 'event_001']
    first = read_columns(tmp_path / 'box/event_000', '/number')
    assert first['data'].tolist() == list(range(20, 36))
    assert read_columns(tmp_path / 'box/event_000', '/info')['data'].tolist() == [42.0]
    assert read_columns(tmp_path / 'box/event_001', '/number')['data'].tolist() == [*range(40, 50)]
    assert inspect(tmp_path / 'box/event_000').code == WHOLE
    assert 'flagged_at_ns' in (tmp_path / 'box/event_000/metadata.yaml').read_text()
    assert valve.box.counts['/number'] == 26
    assert valve.box.size == sum(
        path.stat().st_size for path in (tmp_path / 'box').rglob('*.mcap')
    )
    assert not valve.box.drop_oldest(), 'bags of faults are kept'


def test_bags_of_before_stay_and_faults_at_once_are_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr(blackbox, 'MOST_EVENTS', 2)
    (tmp_path / 'event_000').mkdir()
    valve = Recorded(tmp_path)
    valve.hear(3)
    for name in ('/a/flag', '/b/flag', '/c/flag'):
        valve.tell(True, valve.box.add_topic(name, FLAG))
    assert valve.box.missed == 1
    valve.box.close()
    names = ['event_000', 'event_001', 'event_002']
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    assert not any((tmp_path / 'event_000').iterdir())


def test_what_a_full_disk_does_not_take_waits(tmp_path, monkeypatch):
    valve = Recorded(tmp_path)
    valve.hear(5)
    write, full = os.write, True

    def refuse(descriptor, data):
        if full:
            raise OSError(errno.ENOSPC, 'No space left on device')
        return write(descriptor, data)

    monkeypatch.setattr(os, 'write', refuse)
    with pytest.raises(BagError, match='No space left'):
        valve.tell(True)
    assert not any(tmp_path.iterdir()), 'an empty bag is not left behind'
    assert valve.box.unsaved == 6
    assert valve.box.size == 0
    full = False
    valve.box.flush()
    valve.hear(1)
    valve.box.close()
    assert read_columns(tmp_path / 'event_000', '/number')['data'].tolist() == [0, 1, 2, 3, 4, 5]


def test_memory_is_bounded_whatever_the_seconds(tmp_path, monkeypatch):
    monkeypatch.setattr(blackbox, 'MOST_BYTES', 20 * len(number(0.0)))
    valve = Recorded(tmp_path, before=3600.0)
    valve.hear(100)
    valve.tell(True)
    valve.box.close()
    held = read_columns(tmp_path / 'event_000', '/number')['data'].tolist()
    assert 15 <= len(held) <= 20
    assert held[-1] == 99


def test_a_bag_that_cannot_be_finished_stays_readable(tmp_path):
    valve = Recorded(tmp_path)
    valve.hear(3)
    valve.tell(True)
    valve.box.flush()
    valve.box.abandon()
    assert inspect(tmp_path / 'event_000').messages == 4


def test_a_place_that_cannot_be_is_refused(tmp_path):
    (tmp_path / 'file').touch()
    with pytest.raises(BagError, match='cannot be created'):
        BlackBox(tmp_path / 'file/box', 1.0, 1.0)


def test_only_what_every_publisher_latches_is_kept():
    kept = Latched()

    def hear(offered, count=3):
        topic = Topic(f'/{len(offered)}{offered!r}', FLOAT, offered)
        for n in range(count):
            kept.keep(Kept(topic, number(n), n, n))
        return [m.log_time for m in kept.before(10**9) if m.topic is topic]

    volatile = {'durability': 'volatile', 'depth': 5}
    assert hear([]) == []
    assert hear([volatile]) == []
    assert hear([*LATCHED, volatile]) == []
    assert hear(LATCHED) == [2]
    assert hear([{'durability': '1', 'depth': 2}]) == [1, 2]
    assert hear([{'durability': 'transient_local'}]) == [2]
    assert len(hear([{'durability': '1', 'depth': 10_000}], 300)) == MOST_MESSAGES
    assert [m.log_time for m in kept.before(2)][:1] == [1]


def test_a_write_is_whole_or_leaves_no_trace_and_a_removed_file_comes_back(tmp_path, monkeypatch):
    path = tmp_path / 'folder' / 'file'
    path.parent.mkdir()
    stream = WholeWrites(path)
    stream.write(b'one')
    write = os.write
    monkeypatch.setattr(os, 'write', lambda descriptor, data: write(descriptor, data[:2]))
    stream.write(b'two')  # in pieces
    calls = []

    def half(descriptor, data):
        calls.append(data)
        if len(calls) > 1:
            raise OSError(errno.ENOSPC, 'No space left on device')
        return write(descriptor, data[:2])

    monkeypatch.setattr(os, 'write', half)
    with pytest.raises(OSError, match='No space'):
        stream.write(b'three')
    monkeypatch.setattr(os, 'write', write)
    assert path.read_bytes() == b'onetwo'
    assert not stream.restore(), 'it is there'
    path.unlink()
    path.parent.rmdir()
    assert stream.restore()
    stream.write(b'four')
    assert path.read_bytes() == b'onetwofour'
    with pytest.raises(FileExistsError):
        WholeWrites(path)
    path.unlink()
    monkeypatch.setattr(os, 'write', half)
    with pytest.raises(OSError, match='No space'):
        stream.restore()
    assert not path.exists()
    stream.close()
    stream.close()
    assert not stream.restore()
