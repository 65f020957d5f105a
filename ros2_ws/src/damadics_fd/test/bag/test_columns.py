# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Columns are what message by message decoding gives."""

import numpy as np
import pytest
import zstandard
from damadics_fd.bag import BagError, BagWriter, iter_columns, read_columns, write_columns
from damadics_fd.bag.checking.inspection import inspect
from damadics_fd.bag.mcap import loading
from damadics_fd.bag.mcap.reader import McapFile
from damadics_fd.bag.mcap.writer import McapWriter
from damadics_fd.bag.sources import find_bags

from .bag_support import SIGNALS, needs_messages, simulated

pytestmark = [needs_messages, pytest.mark.plain]


@pytest.mark.parametrize('name', ['a.mcap', 'bag'])
def test_columns_written_are_columns_read(tmp_path, name):
    columns = simulated(30_000)
    write_columns(tmp_path / name, columns)
    found = read_columns(tmp_path / name)
    assert set(found) == {'stamp', 'log_time', 'ps', *SIGNALS}
    for column in (*SIGNALS, 'stamp'):
        assert found[column].tobytes() == columns[column].tobytes()
    assert np.isnan(found['ps']).all()
    assert (found['log_time'] == columns['stamp']).all()
    states = read_columns(tmp_path / name, 'fault_state')
    assert (states['fault'] == columns['fault']).all()
    assert (states['strength'] == columns['strength']).all()


@pytest.mark.parametrize('threads', [1, 2, 5])
def test_other_cores_that_load_ahead_change_nothing(tmp_path, monkeypatch, threads):
    monkeypatch.setattr(loading, 'THREADS', threads)
    path, columns = tmp_path / 'a.mcap', simulated(60_000)
    write_columns(path, columns)
    for found in (read_columns(path), read_columns(path, on_problem=pytest.fail)):
        assert all(found[name].tobytes() == columns[name].tobytes() for name in SIGNALS)
    with McapFile(path) as mcap:
        offsets = [batch.offset for batch in mcap.batches()]
        sizes = [len(batch.starts) for batch in mcap.batches()]
    assert len(offsets) > 8
    data = bytearray(path.read_bytes())
    data[offsets[4] + 5000] ^= 1
    path.write_bytes(data)
    with pytest.raises(BagError, match='damaged'):
        read_columns(path)
    told = []
    found = read_columns(path, '/fault_state', on_problem=told.append)
    assert len(told) == 1
    states = np.cumsum([0, *sizes]) // 2
    kept = np.delete(columns['strength'], slice(states[4], states[5]))
    assert (found['strength'] == kept).all()


def test_channels_of_one_topic_keep_the_order_of_the_file(tmp_path):
    made = simulated(600)
    write_columns(tmp_path / 'one.mcap', {name: made[name] for name in ('stamp', *SIGNALS)})
    with McapFile(tmp_path / 'one.mcap') as source, (tmp_path / 'two.mcap').open('wb') as stream:
        (batch,) = source.batches()
        (schema,), (channel,) = source.schemas.values(), source.channels.values()
        writer = McapWriter(stream, chunk_size=10_000)
        kind = writer.add_schema(schema.name, schema.encoding, schema.data)
        numbers = [
            writer.add_channel(kind, channel.topic, 'cdr', {'recorded by': name}) for name in 'ab'
        ]
        for row, time in enumerate(batch.log_times().tolist()):
            writer.add_message(numbers[row % 2], batch.message(row), time, time)
        writer.finish()
    found = read_columns(tmp_path / 'two.mcap')
    assert all(found[name].tobytes() == made[name].tobytes() for name in ('stamp', *SIGNALS))
    report = inspect(tmp_path / 'two.mcap')
    assert not report.problems
    assert report.topics['/measurement'].timing.steps_back == 0
    assert report.topics['/measurement'].count == 600


def test_memory_of_a_closed_file_serves_the_next(tmp_path, monkeypatch):
    monkeypatch.setattr(loading, '_spare', [])
    write_columns(tmp_path / 'a.mcap', simulated(60_000))
    other = simulated(60_000)
    write_columns(tmp_path / 'b.mcap', other | {name: other[name] + 1.0 for name in SIGNALS})
    with McapFile(tmp_path / 'a.mcap') as mcap:
        for _, chunk in mcap.chunks():
            last, content = chunk, chunk.tobytes()
    kept = list(loading._spare)
    assert 0 < len(kept) <= loading.AHEAD
    with McapFile(tmp_path / 'b.mcap') as mcap:
        first = [chunk.tobytes() for _, chunk in mcap.chunks()]
    assert last.tobytes() == content, 'the last chunk of a closed file may still be looked at'
    monkeypatch.setattr(loading, '_spare', [])
    with McapFile(tmp_path / 'b.mcap') as mcap:
        assert first == [chunk.tobytes() for _, chunk in mcap.chunks()]
    monkeypatch.setattr(loading, '_spare', [])
    monkeypatch.setattr(loading, 'KEPT', 1000)
    read_columns(tmp_path / 'a.mcap')
    assert loading._spare == []


def test_a_channel_that_appears_later_is_read_too(tmp_path):
    with (tmp_path / 'a.mcap').open('wb') as stream:
        writer = McapWriter(stream)
        schema = writer.add_schema('std_msgs/msg/Float64', 'ros2msg', b'float64 data')
        for first in (0, 5):
            channel = writer.add_channel(schema, '/a', 'cdr', {})
            for i in range(first, first + 5):
                writer.add_message(channel, b'\0\1\0\0' + np.float64(i).tobytes(), i, i)
            writer.end_chunk()
        position = writer.position
        writer.finish()
    for size in (None, position):  # the second time without the summary
        (tmp_path / 'b.mcap').write_bytes((tmp_path / 'a.mcap').read_bytes()[:size])
        found = read_columns(tmp_path / 'b.mcap', '/a', on_problem=lambda text: None)
        assert found['data'].tolist() == list(range(10))


def test_chunks_are_bounded_and_add_up(tmp_path):
    columns = simulated(50_000)
    write_columns(tmp_path / 'a.mcap', columns)
    parts = list(iter_columns(tmp_path / 'a.mcap', fields=['x1']))
    assert len(parts) > 4
    assert max(len(part['x1']) for part in parts) < 12_000
    assert (np.concatenate([part['x1'] for part in parts]) == columns['x1']).all()


def test_fields_are_chosen_and_missing_ones_named(tmp_path):
    write_columns(tmp_path / 'a.mcap', simulated(10), frame_id='V17')
    found = read_columns(tmp_path / 'a.mcap', fields=['x1', 'frame_id'])
    assert set(found) == {'x1', 'frame_id', 'stamp', 'log_time'}
    assert set(found['frame_id']) == {'V17'}
    with pytest.raises(BagError, match='has no field x9; it has .*x1'):
        read_columns(tmp_path / 'a.mcap', fields=['x9'])
    with pytest.raises(BagError, match='has no topic /other; it has /fault_state, /measurement'):
        read_columns(tmp_path / 'a.mcap', '/other')


def test_messages_of_changing_size_come_in_order(tmp_path):
    """Tags of changing length move the fields behind them."""
    rclpy = pytest.importorskip('rclpy.serialization')
    messages = pytest.importorskip('damadics_msgs.msg')
    rng = np.random.default_rng(3)
    values = rng.random(500)
    tags = ['V' * int(k) for k in rng.integers(1, 30, 500)]
    with BagWriter(tmp_path / 'bag', chunk_size=4000) as bag:
        topic = bag.add_topic('/fault_event', 'damadics_msgs/msg/FaultEvent')
        for i, (value, tag) in enumerate(zip(values, tags, strict=True)):
            message = messages.FaultEvent(residual=value, cause=tag, text='x' * (i % 7))
            message.header.frame_id = tag
            message.header.stamp.sec = i
            bag.write(topic, rclpy.serialize_message(message), i, i)
    found = read_columns(tmp_path / 'bag', '/fault_event')
    assert (found['residual'] == values).all()
    assert (found['stamp'] == np.arange(500) * 10**9).all()
    texts = read_columns(tmp_path / 'bag', '/fault_event', ['frame_id', 'cause', 'text'])
    assert texts['frame_id'].tolist() == tags == texts['cause'].tolist()
    assert texts['text'].tolist() == ['x' * (i % 7) for i in range(500)]


def test_arrays_become_rows_and_narrow_numbers_keep_their_type(tmp_path):
    schema = b'uint8 a\nint16 b\nfloat32[2] c\nfloat64[3] d\nbuiltin_interfaces/Time t\n' + (
        b'=' * 80 + b'\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n'
    )
    kind = np.dtype(
        {
            'names': ['head', 'a', 'b', 'c', 'd', 'sec', 'ns'],
            'formats': ['<u4', 'u1', '<i2', ('<f4', 2), ('<f8', 3), '<i4', '<u4'],
            'offsets': [0, 4, 6, 8, 20, 44, 48],
            'itemsize': 52,
        }
    )
    data = np.zeros(5, kind)
    data['head'] = 0x100
    data['a'], data['b'] = 200 + np.arange(5), -np.arange(5)
    data['c'], data['d'] = np.arange(10).reshape(5, 2), np.arange(15).reshape(5, 3)
    data['sec'], data['ns'] = -1, 999_999_999
    with (tmp_path / 'a.mcap').open('wb') as stream:
        writer = McapWriter(stream)
        number = writer.add_schema('a/msg/B', 'ros2msg', schema)
        channel = writer.add_channel(number, '/b', 'cdr', {})
        writer.add_rows([channel], np.arange(5), [data])
        writer.finish()
    found = read_columns(tmp_path / 'a.mcap', '/b')
    assert found['a'].dtype == np.uint8
    assert found['a'].tolist() == [200, 201, 202, 203, 204]
    assert found['b'].tolist() == [0, -1, -2, -3, -4]
    assert found['c'].tolist() == data['c'].tolist()
    assert found['d'].tolist() == data['d'].tolist()
    assert set(found['t'].tolist()) == {-1}


def test_split_bags_are_one_with_or_without_metadata(tmp_path):
    with BagWriter(tmp_path / 'bag', split_seconds=1.0) as bag:
        topic = bag.add_topic('/a', 'std_msgs/msg/Float64')
        for i in range(125):
            bag.write(topic, b'\0\1\0\0' + np.float64(i).tobytes(), i * 10**8, i * 10**8)
    assert len(list((tmp_path / 'bag').glob('*.mcap'))) == 13
    assert read_columns(tmp_path / 'bag', '/a')['data'].tolist() == list(range(125))
    (tmp_path / 'bag' / 'metadata.yaml').unlink()
    assert find_bags(tmp_path / 'bag') == [tmp_path / 'bag']
    assert find_bags(tmp_path) == [tmp_path / 'bag']
    assert read_columns(tmp_path / 'bag', '/a')['data'].tolist() == list(range(125))


def test_a_file_compressed_as_a_whole_is_read(tmp_path):
    columns = simulated(100)
    write_columns(tmp_path / 'a.mcap', columns)
    packed = zstandard.compress((tmp_path / 'a.mcap').read_bytes())
    (tmp_path / 'b.mcap.zstd').write_bytes(packed)
    assert (read_columns(tmp_path / 'b.mcap.zstd')['x1'] == columns['x1']).all()


@pytest.mark.parametrize(
    ('content', 'reason'),
    [
        (b'', 'is empty'),
        (b'SQLite format 3\0', 'damaged SQLite bag'),
        (b'#ROSBAG V2.0\n', 'ROS 1 bag'),
        (b'hello, world', 'does not start as an MCAP file'),
    ],
)
def test_what_is_no_mcap_file_is_named(tmp_path, content, reason):
    (tmp_path / 'a.mcap').write_bytes(content)
    with pytest.raises(BagError, match=reason):
        read_columns(tmp_path / 'a.mcap')


def test_folders_without_bags_and_missing_files_are_named(tmp_path):
    with pytest.raises(BagError, match='holds no .mcap file'):
        read_columns(tmp_path)
    with pytest.raises(BagError, match='does not exist'):
        read_columns(tmp_path / 'nowhere')
