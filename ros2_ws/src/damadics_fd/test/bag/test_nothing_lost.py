# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the recorder writes can be read; full disks, lost folders and splits lose nothing."""

import shutil
import struct
from pathlib import Path

import numpy as np
import pytest
from damadics_fd.bag import BagError, BagWriter, read_columns, write_columns
from damadics_fd.bag.checking.inspection import WHOLE, inspect
from damadics_fd.bag.mcap.reader import McapFile
from damadics_fd.bag.mcap.records import MAGIC, Op, record, string
from damadics_fd.bag.rosbag2 import qos
from damadics_fd.bag.salvage import salvage
from damadics_fd.bag.writing.blackbox import BlackBox
from damadics_fd.bag.writing.spool import Spool
from damadics_fd.commands.replay.replay import main as replay
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from .bag_support import needs_messages, simulated
from .test_fuzz import spans
from .test_spool import Disk, number, wait_until

pytestmark = needs_messages
plain = pytest.mark.plain  # short as plain Python, too
FLOAT = 'std_msgs/msg/Float64'
FLAG = 'damadics_msgs/msg/FaultFlag'
LATCHED = qos(durability='transient_local', depth=3)


def payload(size: int, kind: int, seed: int) -> bytes:
    """Bytes that compress extremely well, well or not at all."""
    if kind == 0:
        return bytes(size)
    if kind == 1:
        return bytes([seed % 256, 1, 2]) * (size // 3)
    return np.random.default_rng(seed).bytes(size)


def messages_of(path) -> list[tuple[str, int, bytes]]:
    found = []
    with McapFile(path) as mcap:
        for batch in mcap.batches():
            for row, (number, log_time) in enumerate(
                zip(batch.channels.tolist(), batch.log_times().tolist(), strict=True)
            ):
                found.append((mcap.channels[number].topic, log_time, batch.message(row)))
    return found


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    st.lists(
        st.tuples(
            st.integers(0, 2),
            st.one_of(st.integers(0, 2000), st.integers(0, 3_000_000)),
            st.integers(0, 2),
        ),
        min_size=1,
        max_size=12,
    ),
    st.sampled_from([1000, 1 << 20]),
)
def test_whatever_is_written_is_read(tmp_path_factory, entries, chunk_size):
    path = tmp_path_factory.mktemp('p') / 'a.mcap'
    expected = []
    with BagWriter(path, chunk_size=chunk_size) as bag:
        topics = [bag.add_topic(f'/t{i}', 'std_msgs/msg/UInt8MultiArray') for i in range(3)]
        for i, (topic, size, kind) in enumerate(entries):
            data = b'\0\1\0\0' + payload(size, kind, i)
            bag.write(topics[topic], data, i, i)
            expected.append((f'/t{topic}', i, data))
    report = inspect(path)
    assert (report.code, report.messages) == (WHOLE, len(entries)), report.problems
    assert messages_of(path) == expected


@pytest.mark.parametrize(('count', 'size'), [(40, 50_000), (8, 10_000_000)])
def test_blank_images_beside_measurements_are_read(count, size, tmp_path):
    with BagWriter(tmp_path / 'a.mcap') as bag:
        big = bag.add_topic('/big', 'std_msgs/msg/UInt8MultiArray')
        small = bag.add_topic('/small', FLOAT)
        for i in range(count):
            bag.write(small, number(i), i, i)
            bag.write(big, b'\0\1\0\0' + bytes(8) + bytes(size), i, i)
    report = inspect(tmp_path / 'a.mcap')
    assert (report.code, report.messages) == (WHOLE, 2 * count), report.problems
    assert read_columns(tmp_path / 'a.mcap', '/small')['data'].tolist() == list(range(count))
    assert salvage(tmp_path / 'a.mcap', tmp_path / 'b.mcap').code == WHOLE


def test_a_thousand_topics_are_written_read_and_recovered(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        topics = [bag.add_topic(f'/v{i}/a', FLOAT, [qos()]) for i in range(1000)]
        for i in range(3000):
            bag.write(topics[i % 1000], number(i), i, i)
    report = inspect(tmp_path / 'bag')
    assert (report.code, report.messages, len(report.topics)) == (WHOLE, 3000, 1000)
    result = salvage(tmp_path / 'bag', tmp_path / 'saved')
    assert (result.code, result.saved.messages, len(result.saved.topics)) == (WHOLE, 3000, 1000)


@plain
def test_a_recording_is_never_overwritten(tmp_path):
    write_columns(tmp_path / 'a.mcap', simulated(50))
    before = (tmp_path / 'a.mcap').read_bytes()
    for out in (tmp_path / 'a.mcap', tmp_path):
        with pytest.raises(BagError, match='give (the bag )?another name'):
            BagWriter(out)
    with pytest.raises(BagError, match='give another name'):
        salvage(tmp_path / 'a.mcap', tmp_path / 'a.mcap')
    assert (tmp_path / 'a.mcap').read_bytes() == before


@plain
def test_latched_messages_stand_at_the_head_of_every_split(tmp_path):
    with BagWriter(tmp_path / 'bag', split_seconds=1.0) as bag:
        event, sample = bag.add_topic('/event', FLOAT, [LATCHED]), bag.add_topic('/a', FLOAT)
        for i in range(5):
            bag.write(event, number(i), i, i)
        for i in range(35):
            bag.write(sample, number(i), i * 10**8, i * 10**8)
    for i in range(1, 4):
        found = messages_of(tmp_path / 'bag' / f'bag_{i}.mcap')
        assert [(topic, data) for topic, _, data in found[:3]] == [
            ('/event', number(k)) for k in (2, 3, 4)
        ]
        assert found[3][:2] == ('/a', found[0][1])
    assert inspect(tmp_path / 'bag').code == WHOLE


def flag(fault: bool) -> bytes:
    head = b'\0\1\0\0' + bytes(8) + b'\1\0\0\0' + b'\0'
    return head + bytes([fault]) + bytes(80)


def feed(box, samples: int, rise: int) -> None:
    event = box.add_topic('/fault_event', FLOAT, [LATCHED])
    flags = box.add_topic('/fault_flag', FLAG, [LATCHED])
    sample = box.add_topic('/a', FLOAT)
    box.write(event, number(7), 0, 0)
    for i in range(samples):
        box.write(sample, number(i), i * 10**8, i * 10**8)
        if i == rise:
            box.write(flags, flag(True), i * 10**8, i * 10**8)


@plain
def test_black_box_bags_begin_with_the_latched_messages_of_before(tmp_path):
    box = BlackBox(tmp_path, 2.0, 1.0)
    feed(box, 100, 60)
    box.close()
    found = messages_of(tmp_path / 'event_000' / 'event_000_0.mcap')
    assert found[0][0] == '/fault_event'
    assert found[0][2] == number(7)
    samples = [np.frombuffer(data[4:])[0] for topic, _, data in found if topic == '/a']
    assert samples == list(range(40, 71))
    assert inspect(tmp_path / 'event_000').code == WHOLE


@plain
def test_a_fault_while_the_disk_is_full_is_written_once_there_is_room(tmp_path, monkeypatch):
    disk = Disk(monkeypatch)
    box = BlackBox(tmp_path, 2.0, 1.0)
    spool = Spool(box)
    topics = [box.add_topic('/fault_flag', FLAG, [LATCHED]), box.add_topic('/a', FLOAT)]
    disk.free = 0
    for i in range(40):
        spool.put((topics[1], number(i), i * 10**8, i * 10**8))
        if i == 20:
            spool.put((topics[0], flag(True), i * 10**8, i * 10**8))
    wait_until(lambda: 'No space left' in spool.error)
    disk.free = 1 << 60
    wait_until(lambda: not spool.error and not spool.waiting)
    spool.close()
    assert (spool.dropped, spool.error) == (0, '')
    assert len(list(tmp_path.iterdir())) == 1
    assert read_columns(tmp_path / 'event_000', '/a')['data'].tolist() == list(range(31))
    assert inspect(tmp_path / 'event_000').code == WHOLE


@plain
def test_a_disk_that_stays_full_costs_what_is_told(tmp_path, monkeypatch):
    disk = Disk(monkeypatch)
    bag = BagWriter(tmp_path / 'bag', chunk_size=2000, flush_period=0.05)
    spool = Spool(bag)
    topic = bag.add_topic('/a', FLOAT)
    for i in range(300):
        spool.put((topic, number(i), i, i))
    wait_until(lambda: spool.waiting == 0 and not bag.unsaved)
    disk.free = 10
    for i in range(300, 1000):
        spool.put((topic, number(i), i, i))
    wait_until(lambda: spool.error)
    spool.close()
    kept = len(read_columns(tmp_path / 'bag', '/a', on_problem=lambda _: None)['data'])
    assert kept == spool.written
    assert kept + spool.dropped == 1000
    assert 'No space left' in spool.error


@plain
@pytest.mark.parametrize('split', [0.0, 0.5])
def test_a_split_on_a_full_disk_loses_nothing(tmp_path, monkeypatch, split):
    disk = Disk(monkeypatch)
    bag = BagWriter(tmp_path / 'bag', split_seconds=split, chunk_size=500, flush_period=0.0)
    spool = Spool(bag)
    topic = bag.add_topic('/a', FLOAT)
    for i in range(400):
        spool.put((topic, number(i), i * 10**7, i * 10**7))
        if i % 50 == 20:
            disk.free = 300 * (i % 7)
    wait_until(lambda: spool.error)
    disk.free = 1 << 60
    wait_until(lambda: not spool.error and not spool.waiting)
    spool.close()
    assert spool.dropped == 0
    assert read_columns(tmp_path / 'bag', '/a')['data'].tolist() == list(range(400))
    assert inspect(tmp_path / 'bag').code == WHOLE


@plain
def test_a_folder_that_is_removed_is_made_again_with_all_that_was_in_the_file(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        topic = bag.add_topic('/a', FLOAT)
        for i in range(100):
            bag.write(topic, number(i), i, i)
        bag.flush()
        shutil.rmtree(tmp_path / 'bag')
        for i in range(100, 200):
            bag.write(topic, number(i), i, i)
        bag.flush()
    assert read_columns(tmp_path / 'bag', '/a')['data'].tolist() == list(range(200))
    assert inspect(tmp_path / 'bag').code == WHOLE


GOLDEN = Path(__file__).parents[5] / 'bags'


@plain
@pytest.mark.parametrize('byte', [40, 51])
def test_messages_whose_schema_is_lost_are_saved_all_the_same(byte, tmp_path):
    """The first schema and the end of the file are damaged; every message is still there."""
    data = bytearray((GOLDEN / 'lugre_nominal.mcap').read_bytes()[:-300])
    data[byte] ^= 0xFF
    (tmp_path / 'bad.mcap').write_bytes(data)
    result = salvage(tmp_path / 'bad.mcap', tmp_path / 'saved.mcap')
    counts = {name: topic.count for name, topic in inspect(tmp_path / 'saved.mcap').topics.items()}
    assert counts['/measurement'] == counts['/fault_state'] == 15_001
    assert result.saved.messages == sum(counts.values())


@pytest.mark.parametrize('what', [Op.SCHEMA, Op.CHANNEL], ids=['schema', 'channel'])
@pytest.mark.parametrize('chunks', [True, False], ids=['chunks', 'loose'])
def test_what_is_said_to_be_saved_is_in_the_file_for_others_too(what, chunks, tmp_path):
    """A5: whichever byte of a schema or channel is wrong, and with no end of the file to help."""
    library = pytest.importorskip('mcap.writer')
    reader = pytest.importorskip('mcap.reader')
    whole = tmp_path / 'whole.mcap'
    with whole.open('wb') as stream:
        writer = library.Writer(stream, use_chunking=False)
        writer.start('ros2')
        channels = []
        for topic in ('/a', '/b'):
            schema = writer.register_schema(FLOAT, 'ros2msg', b'float64 data')
            channels.append(writer.register_channel(topic, 'cdr', schema))
        for n in range(200):
            writer.add_message(channels[n % 2], n, b'\0\1\0\0' + struct.pack('<d', n), n)
        writer.finish()
    data = whole.read_bytes()
    records = list(spans(data))
    end = next(begin for op, begin, _ in records if op == Op.DATA_END)
    head = [data[b:e] for op, b, e in records if op in (Op.SCHEMA, Op.CHANNEL) and b < end]
    body = b''.join(data[b:e] for op, b, e in records if op == Op.MESSAGE)
    if chunks:
        body = record(
            Op.CHUNK,
            struct.pack('<QQQII', 0, 199, len(body), 0, 0) + struct.pack('<Q', len(body)) + body,
        )
    first = b''.join(head)
    start = data[: records[0][2]]
    place = next(b for op, b, _ in spans(start + first + body) if op == what)
    size = next(e - b for op, b, e in spans(start + first + body) if op == what)
    known = 0
    for byte in range(place, place + size):
        bad = bytearray(start + first + body)
        bad[byte] ^= 0xFF
        (tmp_path / 'bad.mcap').write_bytes(bad)
        intact = sum(topic.count for topic in inspect(tmp_path / 'bad.mcap').topics.values())
        result = salvage(tmp_path / 'bad.mcap', tmp_path / f'{byte}.mcap')
        with (tmp_path / f'{byte}.mcap').open('rb') as stream:
            theirs = sum(1 for _ in reader.make_reader(stream).iter_messages())
        assert theirs == result.saved.messages >= intact, byte
        known += theirs == 200
    assert known > size // 2


@pytest.mark.parametrize('times', [0, 2])
def test_a_chunk_that_is_missing_or_doubled_is_told_by_replay(times, tmp_path, capsys):
    """The records are well formed: only the counts at the end of the file tell."""
    data = (GOLDEN / 'dablib_friction.mcap').read_bytes()
    _, (_, begin, end) = [span for span in spans(data) if span[0] == Op.CHUNK]
    path = tmp_path / 'bad.mcap'
    path.write_bytes(data[:begin] + data[begin:end] * times + data[end:])
    replay([str(path), '--mode', 'paper', '--jobs', '1'])
    assert 'warning' in capsys.readouterr().err


@plain
def test_all_messages_of_lost_channels_are_counted(tmp_path):
    parts = [MAGIC, record(Op.HEADER, string('ros2'), string(''))]
    for channel in (1, 2, 3, 3):
        head = struct.pack('<HIQQ', channel, 0, 5, 5)
        parts.append(record(Op.MESSAGE, head, b'\0\1\0\0' + bytes(8)))
    parts += [record(Op.DATA_END, bytes(4)), record(Op.FOOTER, bytes(20)), MAGIC]
    (tmp_path / 'a.mcap').write_bytes(b''.join(parts))
    (told,) = inspect(tmp_path / 'a.mcap').problems
    assert '4 messages belong to a channel that is lost' in told
