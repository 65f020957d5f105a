# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Damaged and hostile files: no crash, no hang, every intact chunk saved, the right verdict."""

import random
import struct
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import zstandard
from damadics_fd.bag import BagError, BagWriter, read_columns
from damadics_fd.bag.checking.inspection import LOSSY, UNUSABLE, WHOLE, inspect
from damadics_fd.bag.mcap.reader import McapFile
from damadics_fd.bag.mcap.records import CHUNK, MAGIC, Op, record, string
from damadics_fd.bag.mcap.writer import McapWriter
from damadics_fd.bag.salvage import salvage
from damadics_fd.commands.recover import main as recover
from damadics_fd.commands.verify import main as verify

SCHEMA = (
    b'std_msgs/Header header\nfloat64 x1\n'
    + b'=' * 80
    + (
        b'\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n'
        + b'=' * 80
        + b'\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n'
    )
)
KIND = np.dtype(
    [
        ('cdr', '<u4'),
        ('sec', '<i4'),
        ('ns', '<u4'),
        ('len', '<u4'),
        ('tag', 'S1'),
        ('pad', 'V7'),
        ('x1', '<f8'),
    ]
)
CHUNKS, ROWS = 4, 5


def messages(first: int = 0, count: int = ROWS) -> np.ndarray:
    data = np.zeros(count, KIND)
    data['cdr'], data['len'] = 0x100, 1
    data['sec'] = np.arange(first, first + count)
    data['x1'] = np.random.default_rng(first).random(count)
    return data


def small_bag(path: Path, chunks: int = CHUNKS, index: bool = True) -> list[tuple[int, int]]:
    """Write a small bag; return where each of its chunks ends and the messages up to there."""
    ends = []
    with path.open('wb') as stream:
        writer = McapWriter(stream, message_index=index)
        number = writer.add_schema('a/msg/B', 'ros2msg', SCHEMA)
        channel = writer.add_channel(number, '/measurement', 'cdr', {})
        for i in range(chunks):
            data = messages(i * ROWS)
            writer.add_rows([channel], data['sec'].astype(np.int64) * 10**9, [data])
            ends.append((writer.position, (i + 1) * ROWS))
        writer.add_metadata('rosbag2', {'serialized_metadata': 'version: 9'})
        writer.finish()
    return ends


def chunk_ends(path: Path) -> list[int]:
    """Return where each Chunk record of a whole file ends."""
    data = path.read_bytes()
    at, ends = len(MAGIC), []
    while at < len(data) - len(MAGIC):
        op, length = struct.unpack_from('<BQ', data, at)
        at += 9 + length
        if op == Op.CHUNK:
            ends.append(at)
    return ends


def seconds(path: Path) -> list[int]:
    """Return the stamps that can be read, damage left out."""
    try:
        return (read_columns(path, on_problem=lambda _: None)['stamp'] // 10**9).tolist()
    except BagError:
        return []


@pytest.mark.plain
def test_a_whole_bag_is_whole(tmp_path):
    small_bag(tmp_path / 'a.mcap')
    report = inspect(tmp_path / 'a.mcap')
    assert (report.code, report.messages, report.problems) == (WHOLE, CHUNKS * ROWS, [])
    assert verify([str(tmp_path / 'a.mcap')]) == WHOLE


@pytest.mark.parametrize('step', [pytest.param(150, marks=pytest.mark.plain), 7])
def test_a_bag_cut_anywhere_gives_all_messages_of_complete_chunks(step, tmp_path):
    whole, cut, saved = (tmp_path / name for name in ('a.mcap', 'cut.mcap', 'saved.mcap'))
    small_bag(whole)
    data, ends = whole.read_bytes(), chunk_ends(whole)
    first = data.index(b'ros2msg')
    finely = max(step // 10, 1)
    near = {end + n for end in ends for n in range(-20, 21, finely)}
    last = range(len(data) - 40, len(data), finely)
    for size in sorted({*range(0, len(data), step), *near, *last}):
        cut.write_bytes(data[:size])
        expected = list(range(ROWS * sum(end <= size for end in ends)))
        assert seconds(cut) == expected, size
        report = inspect(cut)
        assert report.code == (LOSSY if expected else UNUSABLE), (size, report)
        assert report.messages == len(expected)
        if size % (5 * step) == 0 and size > first:
            saved.unlink(missing_ok=True)
            assert salvage(cut, saved).code == report.code
            assert seconds(saved) == expected if expected else not saved.exists()


def corrupted(data: bytes, rng: random.Random) -> bytes:
    """Damage a file as disks, networks and attackers do."""
    kind = rng.randrange(6)
    at = rng.randrange(len(data))
    size = rng.choice((1, 2, 8, 100))
    if kind == 0:
        return data[:at] + bytes([data[at] ^ (1 << rng.randrange(8))]) + data[at + 1 :]
    if kind == 1:
        return data[:at] + rng.randbytes(size) + data[at + size :]
    if kind == 2:
        return data[:at] + data[at + size :]
    if kind == 3:
        return data[:at] + rng.randbytes(size) + data[at:]
    if kind == 4:
        return data[:at] + bytes(size) + data[at + size :]
    return data[:at] + b'\xff' * 8 + data[at + 8 :]


def intact(data: bytes, whole: bytes, ends: list[int], starts: list[int]) -> set[int]:
    """Return the seconds in chunks whose bytes are all still there."""
    return {
        chunk * ROWS + i
        for chunk, (start, end) in enumerate(zip(starts, ends, strict=True))
        if whole[start:end] in data
        for i in range(ROWS)
    }


def corruptions(tmp_path: Path, count: int, seed: int) -> None:
    whole, bad, saved = (tmp_path / name for name in ('a.mcap', 'bad.mcap', 'saved.mcap'))
    small_bag(whole)
    data, ends = whole.read_bytes(), chunk_ends(whole)
    with McapFile(whole) as mcap:
        starts = [batch.offset for batch in mcap.batches()]
    rng = random.Random(seed)
    slowest = 0.0
    for i in range(count):
        damaged = corrupted(data, rng)
        bad.write_bytes(damaged)
        began = time.process_time()
        report = inspect(bad)
        slowest = max(slowest, time.process_time() - began)
        expected = intact(damaged, data, ends, starts)
        if report.code == WHOLE:  # unharmed, or a CRC of zero, which means "not computed"
            changed = [k for k, (a, b) in enumerate(zip(damaged, data, strict=True)) if a != b]
            assert all(damaged[k] == 0 for k in changed), (i, changed)
            assert len(changed) <= 4
            continue
        assert report.code in (LOSSY, UNUSABLE), (i, report)
        # channel and schema are there twice; where both survive nothing intact may be lost
        assert report.messages >= len(expected), (i, report.problems)
        if i % 20 == 0:
            assert expected <= set(seconds(bad)), i
            saved.unlink(missing_ok=True)
            assert salvage(bad, saved).code == report.code
            if report.code == LOSSY:
                assert inspect(saved).code == WHOLE, (i, inspect(saved).problems)
    assert slowest < 2.0


@pytest.mark.parametrize('count', [pytest.param(21, marks=pytest.mark.plain), 600])
def test_random_corruptions(count, tmp_path):
    corruptions(tmp_path, count, seed=1)


@pytest.mark.slow
def test_ten_thousand_random_corruptions(tmp_path):
    corruptions(tmp_path, 10_000, seed=2)


def hostile_chunk(size: int, packed: bytes, compression: str = 'zstd') -> bytes:
    return record(
        Op.CHUNK,
        CHUNK.pack(0, 0, size, 0),
        string(compression),
        struct.pack('<Q', len(packed)),
        packed,
    )


HOSTILE = {
    'zstd bomb': lambda: hostile_chunk(1 << 40, zstandard.compress(bytes(1 << 24))),
    'honest zstd bomb': lambda: hostile_chunk(1 << 24, zstandard.compress(bytes(1 << 24))),
    'wrong size': lambda: hostile_chunk(100, zstandard.compress(bytes(50))),
    'unknown compression': lambda: hostile_chunk(10, bytes(10), 'rar'),
    'huge record': lambda: struct.pack('<BQ', Op.CHUNK, 2**63),
    'huge string': lambda: record(Op.SCHEMA, b'\1\0' + struct.pack('<I', 2**31) + b'abc'),
    'unknown record': lambda: struct.pack('<BQ', 0x55, 4) + bytes(4),
    'zeros': lambda: bytes(1 << 20),
    'record heads': lambda: struct.pack('<BQ', Op.MESSAGE_INDEX, 100) * 50_000,
    'many channels': lambda: b''.join(
        record(
            Op.CHANNEL,
            struct.pack('<HH', i % 65536, 1),
            string(f'/t{i}'),
            string('cdr'),
            struct.pack('<I', 0),
        )
        for i in range(20_000)
    ),
}


@pytest.mark.plain
@pytest.mark.parametrize(
    'name', ['wrong size', 'unknown compression', 'huge record', 'huge string', 'unknown record']
)
def test_what_stands_between_two_chunks_costs_neither(tmp_path, name):
    small_bag(tmp_path / 'a.mcap')
    data = (tmp_path / 'a.mcap').read_bytes()
    with McapFile(tmp_path / 'a.mcap') as mcap:
        second = [batch.offset for batch in mcap.batches()][1]
    (tmp_path / 'bad.mcap').write_bytes(data[:second] + HOSTILE[name]() + data[second:])
    result = salvage(tmp_path / 'bad.mcap', tmp_path / 'saved.mcap')
    assert (result.code, result.found.messages) == (LOSSY, CHUNKS * ROWS)
    assert seconds(tmp_path / 'saved.mcap') == list(range(CHUNKS * ROWS))


@pytest.mark.parametrize('name', HOSTILE)
def test_hostile_files_cost_bounded_memory_and_time(tmp_path, name):
    small_bag(tmp_path / 'a.mcap')
    data, end = (tmp_path / 'a.mcap').read_bytes(), chunk_ends(tmp_path / 'a.mcap')[0]
    with McapFile(tmp_path / 'a.mcap') as mcap:
        second = [batch.offset for batch in mcap.batches()][1]
    assert end <= second
    (tmp_path / 'bad.mcap').write_bytes(data[:second] + HOSTILE[name]() + data[second:])
    inspect(tmp_path / 'a.mcap')  # whatever is compiled or imported once
    tracemalloc.start()
    began = time.process_time()
    report = inspect(tmp_path / 'bad.mcap')
    spent = time.process_time() - began
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert report.code == LOSSY
    assert report.messages == CHUNKS * ROWS  # the rest is intact
    assert spent < 10.0
    assert peak < 150e6
    if name not in ('many channels', 'zeros'):
        with pytest.raises(BagError, match='see verify and recover'):
            read_columns(tmp_path / 'bad.mcap')


@pytest.mark.plain
@pytest.mark.parametrize('index', [True, False])
def test_bags_with_and_without_message_index_are_whole(tmp_path, index):
    small_bag(tmp_path / 'a.mcap', index=index)
    assert inspect(tmp_path / 'a.mcap').code == WHOLE


@pytest.mark.plain
def test_stamps_that_go_back_or_roll_over_are_told(tmp_path):
    for name, times in {'back': [1, 2, 1], 'over': [1, 2, -5]}.items():
        data = messages(0, 3)
        data['sec'] = times
        with (tmp_path / name).open('wb') as stream:
            writer = McapWriter(stream)
            number = writer.add_schema('a/msg/B', 'ros2msg', SCHEMA)
            channel = writer.add_channel(number, '/measurement', 'cdr', {})
            writer.add_rows([channel], np.arange(3), [data])
            writer.finish()
        report = inspect(tmp_path / name)
        assert report.code == LOSSY
        assert ('rolled over' in str(report.problems)) == (name == 'over')
        assert 'stamps go back 1 times' in str(report.problems)


@pytest.mark.plain
def test_directories_are_recovered_with_metadata(tmp_path):
    with BagWriter(tmp_path / 'bag', split_seconds=1.0) as bag:
        topic = bag.add_topic('/a', 'std_msgs/msg/Float64')
        for i in range(35):
            bag.write(topic, b'\0\1\0\0' + np.float64(i).tobytes(), i * 10**8, i * 10**8)
    broken = tmp_path / 'bag' / 'bag_2.mcap'
    broken.write_bytes(broken.read_bytes()[:-200])
    (tmp_path / 'bag' / 'metadata.yaml').unlink()
    assert recover([str(tmp_path / 'bag'), '--out', str(tmp_path / 'saved')]) == LOSSY
    assert verify([str(tmp_path / 'saved')]) == WHOLE
    assert len(read_columns(tmp_path / 'saved', '/a')['data']) == 35
    assert 'version: 9' in (tmp_path / 'saved' / 'metadata.yaml').read_text()


@pytest.mark.plain
@pytest.mark.parametrize('content', [b'', b'nonsense' * 100, MAGIC, MAGIC + MAGIC])
def test_files_without_anything_are_unusable(tmp_path, content, capsys):
    (tmp_path / 'a.mcap').write_bytes(content)
    assert verify([str(tmp_path / 'a.mcap')]) == UNUSABLE
    out = tmp_path / 'b.mcap'
    assert recover([str(tmp_path / 'a.mcap'), '--out', str(out)]) == UNUSABLE
    assert not out.exists()
    assert 'unusable' in capsys.readouterr().out
    assert verify([str(tmp_path / 'nowhere.mcap')]) == UNUSABLE
