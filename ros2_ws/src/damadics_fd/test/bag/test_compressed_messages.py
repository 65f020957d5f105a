# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bags with `compression_mode: message`, in both storages: each message is a zstd frame."""

import sqlite3
import struct
from pathlib import Path

import pytest
import zstandard
from damadics_fd.bag import read_columns
from damadics_fd.bag.checking.inspection import LOSSY, WHOLE, inspect
from damadics_fd.bag.mcap.writer import McapWriter
from damadics_fd.bag.rosbag2 import METADATA_FILE, METADATA_ROOT
from damadics_fd.bag.salvage import salvage
from damadics_fd.commands import verify

from .bag_support import MEASUREMENT, needs_messages, replayed, stroke
from .test_damage import SCHEMA

N = 300
MODES = ('sized', 'unsized', 'streamed')


def message(i: int) -> bytes:
    return b'\0\1\0\0' + struct.pack('<iIIB3xd', i, 0, 1, 0, i / 4)


def packed(data: bytes, mode: str) -> bytes:
    if mode == 'sized':
        return zstandard.compress(data)
    if mode == 'unsized':
        return zstandard.ZstdCompressor(write_content_size=False).compress(data)
    stream = zstandard.ZstdCompressor().compressobj()
    return stream.compress(data) + stream.flush()


def write_mcap(path: Path, payloads: list[bytes], schema: bytes = SCHEMA) -> None:
    with path.open('wb') as stream:
        writer = McapWriter(stream, chunk_size=4000)
        number = writer.add_schema('a/msg/B', 'ros2msg', schema)
        channel = writer.add_channel(number, '/measurement', 'cdr', {})
        for i, data in enumerate(payloads):
            writer.add_message(channel, data, i, i)
        writer.finish()


def write_sqlite(path: Path, payloads: list[bytes], kind: str = 'std_msgs/msg/Float64') -> None:
    with sqlite3.connect(path) as database:
        database.execute(
            'CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT,'
            ' serialization_format TEXT, offered_qos_profiles TEXT)'
        )
        database.execute(
            'CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER,'
            ' data BLOB)'
        )
        database.execute("INSERT INTO topics VALUES(1, '/measurement', ?, 'cdr', '')", (kind,))
        rows = [(1, i, data) for i, data in enumerate(payloads)]
        database.executemany(
            'INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)', rows
        )
    database.close()


def bag(folder: Path, payloads: list[bytes], storage: str) -> Path:
    """Write a bag directory as `ros2 bag record --compression-mode message` does."""
    folder.mkdir()
    name = f'bag_0.{"mcap" if storage == "mcap" else "db3"}'
    (write_mcap if storage == 'mcap' else write_sqlite)(folder / name, payloads)
    (folder / METADATA_FILE).write_text(
        f'{METADATA_ROOT}:\n  version: 5\n  storage_identifier: {storage}\n'
        f'  relative_file_paths:\n    - {name}\n  message_count: {len(payloads)}\n'
        '  compression_format: zstd\n  compression_mode: MESSAGE\n'
    )
    return folder


@pytest.mark.plain
@pytest.mark.parametrize('mode', MODES)
def test_an_mcap_of_compressed_messages_is_read_and_recovered(mode, tmp_path):
    path = bag(tmp_path / 'bag', [packed(message(i), mode) for i in range(N)], 'mcap')
    report = inspect(path)
    assert (report.code, report.messages) == (WHOLE, N), report.problems
    assert report.topics['/measurement'].timing.rate == pytest.approx(1.0)  # its own stamps
    columns = read_columns(path, '/measurement')
    assert columns['x1'].tolist() == [i / 4 for i in range(N)]
    assert columns['log_time'].tolist() == list(range(N))
    result = salvage(path, tmp_path / 'saved')
    assert (result.code, result.saved.messages) == (WHOLE, N)
    (saved,) = (tmp_path / 'saved').glob('*.mcap')
    reader = pytest.importorskip('mcap.reader')
    with saved.open('rb') as stream:  # for readers that know nothing of compressed messages
        found = [m.data for _, _, m in reader.make_reader(stream).iter_messages()]
    assert found == [message(i) for i in range(N)]


@pytest.mark.plain
@pytest.mark.parametrize('mode', MODES)
@needs_messages
def test_an_sqlite_bag_of_compressed_messages_is_read(mode, tmp_path):
    values = [b'\0\1\0\0' + struct.pack('<d', i / 4) for i in range(N)]
    path = bag(tmp_path / 'bag', [packed(data, mode) for data in values], 'sqlite3')
    assert inspect(path).code == WHOLE
    assert read_columns(path, '/measurement')['data'].tolist() == [i / 4 for i in range(N)]


@pytest.mark.plain
@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_damaged_messages_among_compressed_ones_are_told_and_left_out(storage, tmp_path):
    payloads = [packed(message(i), 'sized') for i in range(N)]
    payloads[7] = payloads[7][:-3]
    payloads[8] = payloads[8][:4]
    payloads[9] = b''
    report = inspect(bag(tmp_path / 'bag', payloads, storage))
    assert report.code == LOSSY
    assert report.messages in (N - 2, N - 3)
    assert any('lost' in text or 'no messages' in text for text in report.problems)


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_compressed_messages_that_unpack_to_gigabytes_are_refused(storage, tmp_path):
    bombs = [zstandard.compress(bytes(1 << 25))] * 40
    report = inspect(bag(tmp_path / 'bag', [packed(message(0), 'sized'), *bombs], storage))
    assert report.code == LOSSY
    assert 1 <= report.messages < 20


@needs_messages
def test_replay_gives_the_same_result(tmp_path):
    from damadics_fd.bag import write_columns
    from damadics_fd.bag.cdr.definition import schema_text
    from damadics_fd.bag.mcap.reader import McapFile

    write_columns(tmp_path / 'plain.mcap', stroke())
    with McapFile(tmp_path / 'plain.mcap') as mcap:
        number = next(c.id for c in mcap.channels.values() if c.topic == '/measurement')
        payloads = [
            packed(batch.message(row), 'sized')
            for batch in mcap.batches()
            for row in (batch.channels == number).nonzero()[0].tolist()
        ]
    folder = bag(tmp_path / 'bag', [], 'mcap')
    (folder / 'bag_0.mcap').unlink()
    (folder / METADATA_FILE).unlink()
    with (folder / 'bag_0.mcap').open('wb') as stream:
        writer = McapWriter(stream)
        schema = writer.add_schema(MEASUREMENT, 'ros2msg', schema_text(MEASUREMENT).encode())
        channel = writer.add_channel(schema, '/measurement', 'cdr', {})
        for i, data in enumerate(payloads):
            writer.add_message(channel, data, i, i)
        writer.finish()
    (expected,), (found,) = replayed(tmp_path / 'plain.mcap'), replayed(folder)
    assert expected['detections']
    assert found['detections'] == expected['detections']
    assert verify.main([str(folder)]) == WHOLE


@pytest.mark.parametrize('compression', ['NONE', 'FILE', 'MESSAGE', 'STORAGE'])
@pytest.mark.parametrize('storage', ['MCAP', 'SQLITE3'])
@pytest.mark.parametrize('version', [8, 9])
def test_bags_of_rosbags_in_every_form_are_whole(version, storage, compression, tmp_path):
    rosbag2 = pytest.importorskip('rosbags.rosbag2')
    typesys = pytest.importorskip('rosbags.typesys')
    if (storage, compression) == ('SQLITE3', 'STORAGE'):
        pytest.skip('rosbag2 leaves compression of the storage to MCAP')
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    kind = 'std_msgs/msg/Float64'
    plugin = rosbag2.StoragePlugin[storage]
    writer = rosbag2.Writer(tmp_path / 'bag', version=version, storage_plugin=plugin)
    if compression != 'NONE':
        mode = rosbag2.CompressionMode[compression]
        writer.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection('/a', kind, typestore=store)
        for i in range(N):
            data = store.serialize_cdr(store.types[kind](float(i)), kind)
            writer.write(connection, i, data)
    report = inspect(tmp_path / 'bag')
    assert (report.code, report.messages) == (WHOLE, N), report.problems
    assert read_columns(tmp_path / 'bag', '/a')['data'].tolist() == list(range(N))
    assert salvage(tmp_path / 'bag', tmp_path / 'saved').code == WHOLE
