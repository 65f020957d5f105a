# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files made to hurt cost bounded time and end in a verdict, never in a traceback."""

import struct
import time
from pathlib import Path

import pytest
import zstandard
from damadics_fd.bag import BagError
from damadics_fd.bag.checking.inspection import LOSSY, UNUSABLE, WHOLE, inspect
from damadics_fd.bag.mcap.reader import McapFile
from damadics_fd.bag.mcap.records import CHUNK, MAGIC, Op, record, string
from damadics_fd.bag.mcap.writer import McapWriter
from damadics_fd.bag.recording import Recording, find_recordings
from damadics_fd.bag.rosbag2 import METADATA_FILE, METADATA_ROOT, load_yaml, parse_qos
from damadics_fd.bag.salvage import salvage
from damadics_fd.commands.replay.replay import main as replay
from damadics_fd.commands.replay.replay import unique_stems

SECONDS = 10.0  # of the processor, for each command
BILLION = 'a0: &a0 [x,x,x,x,x,x,x,x,x,x]\n' + ''.join(
    f'a{i}: &a{i} [{",".join([f"*a{i - 1}"] * 10)}]\n' for i in range(1, 10)
)


def bag(path: Path, definition: str, name: str = 'a/msg/B', metadata: dict | None = None) -> None:
    with path.open('wb') as stream:
        writer = McapWriter(stream)
        schema = writer.add_schema(name, 'ros2msg', definition.encode())
        channel = writer.add_channel(schema, '/measurement', 'cdr', metadata or {})
        for i in range(10):
            writer.add_message(channel, b'\0\1\0\0' + bytes(64), i, i)
        writer.finish()


def channels(count: int, messages: bool) -> bytes:
    parts = [MAGIC, record(Op.HEADER, string('ros2'), string(''))]
    parts.append(
        record(Op.SCHEMA, struct.pack('<H', 1), *map(string, ('a/B', 'ros2msg', 'int8 a')))
    )
    for i in range(1, count + 1):
        head = struct.pack('<HH', i, 1)
        parts.append(
            record(Op.CHANNEL, head, string(f'/v{i}/measurement'), string('cdr'), bytes(4))
        )
        if messages:
            parts.append(record(Op.MESSAGE, struct.pack('<HIQQ', i, 0, 1, 1), b'\0\1\0\0\1'))
    parts += [record(Op.DATA_END, bytes(4)), record(Op.FOOTER, bytes(20)), MAGIC]
    return b''.join(parts)


def bombs(count: int, size: int) -> bytes:
    packed = zstandard.compress(bytes(size))
    chunk = record(
        Op.CHUNK,
        CHUNK.pack(0, 0, size, 0),
        string('zstd'),
        struct.pack('<Q', len(packed)),
        packed,
    )
    head = MAGIC + record(Op.HEADER, string('ros2'), string(''))
    return (
        head + chunk * count + record(Op.DATA_END, bytes(4)) + record(Op.FOOTER, bytes(20)) + MAGIC
    )


def layouts(path: Path) -> None:
    """Thousands of messages, no two with their fields at the same places."""
    text = 'std_msgs/Header header\nstring a\nfloat64 x1\n' + '=' * 80 + '\nMSG: std_msgs/Header\n'
    text += 'builtin_interfaces/Time stamp\nstring frame_id\n' + '=' * 80
    text += '\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n'
    with path.open('wb') as stream:
        writer = McapWriter(stream)
        channel = writer.add_channel(
            writer.add_schema('a/B', 'ros2msg', text.encode()), '/measurement', 'cdr', {}
        )
        for i in range(3000):
            body = (
                bytes(8)
                + struct.pack('<I', 1)
                + bytes(4)
                + struct.pack('<I', i + 1)
                + bytes(i + 1)
            )
            body += bytes(-len(body) % 8) + bytes(8)
            writer.add_message(channel, b'\0\1\0\0' + body, i, i)
        writer.finish()


DEFINITIONS = {
    'a type within itself': 'B b',
    'a type within itself, twice over': 'B[2] b',
    'an endless number': 'float64[1000' + '0' * 5000 + '] a',
    'a long array': 'float64[99999999] a',
    'many members': '\n'.join(f'float64 f{i}' for i in range(60_000)),
    'many types': '\n'.join(f'{"=" * 80}\nMSG: a/T{i}\nint8 a' for i in range(5000)),
    'a tree of types': 'T0 a\n'
    + '\n'.join(f'{"=" * 80}\nMSG: a/T{i}\n' + f'T{i + 1} a\nT{i + 1} b' for i in range(40))
    + f'\n{"=" * 80}\nMSG: a/T40\nint8 a',
    'no stamp in the header': 'std_msgs/Header header\nfloat64 x1\n'
    + f'{"=" * 80}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time time\nstring frame_id\n'
    + f'{"=" * 80}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec',
}
YAMLS = {
    'an impossible date': '[2001-99-99]',
    'an integer that is none': '[!!int abc]',
    'a deep nest': '[' * 20_000,
    'a billion laughs': BILLION + 'relative_file_paths: [*a9]',
    'itself': '&a {x: *a}',
    'an object of Python': '!!python/object/apply:os.system [touch /tmp/x]',
    'much': 'x: [' + 'a,' * 800_000 + ']',
}


def read_all(path: Path) -> int:
    """Read every valve as replay does; only the one typed error may come."""
    told: list[BagError] = []
    count = 0
    for recording in find_recordings([path], on_problem=told.append):
        try:
            count += sum(len(columns['log_time']) for columns in recording.chunks(lambda _: None))
        except BagError as error:
            told.append(error)
    return count


def commands(path: Path, tmp_path: Path) -> list[int]:
    """Do what verify, recover and replay do; return the codes of the first two."""
    codes = []
    for run in (
        lambda: inspect(path).code,
        lambda: salvage(path, tmp_path / 'saved').code,
        lambda: read_all(path),
    ):
        began = time.process_time()
        codes.append(run())
        assert time.process_time() - began < SECONDS
    return codes[:2]


@pytest.mark.parametrize('name', DEFINITIONS)
def test_hostile_definitions(name, tmp_path):
    bag(tmp_path / 'a.mcap', DEFINITIONS[name])
    codes = commands(tmp_path / 'a.mcap', tmp_path)
    assert codes == [WHOLE, WHOLE]  # the messages are as they were written


@pytest.mark.parametrize('name', YAMLS)
def test_hostile_yaml(name, tmp_path):
    folder = tmp_path / 'bag'
    folder.mkdir()
    text = YAMLS[name]
    bag(folder / 'a.mcap', 'float64 cv\nfloat64 x1', metadata={'offered_qos_profiles': text})
    indented = '\n'.join('  ' + line for line in text.splitlines())
    (folder / METADATA_FILE).write_text(f'{METADATA_ROOT}:\n{indented}\n')
    assert commands(folder, tmp_path) == [WHOLE, WHOLE]
    began = time.process_time()
    load_yaml(text)
    parse_qos(text)
    assert time.process_time() - began < SECONDS


@pytest.mark.parametrize('name', ['x', '', '../../../etc/passwd'])
def test_hostile_names_of_types(name, tmp_path):
    bag(tmp_path / 'a.mcap', 'float64 cv\nfloat64 x1', name)
    assert commands(tmp_path / 'a.mcap', tmp_path) == [WHOLE, WHOLE]


@pytest.mark.plain
def test_files_for_a_topic_with_a_nul_stay_in_their_folder(tmp_path):
    stems = unique_stems([Recording(tmp_path / 'a.mcap', '/a\0b/../measurement')] * 2)
    assert all('/' not in stem and '\0' not in stem for stem in stems)


@pytest.mark.parametrize(('count', 'messages'), [(65_535, False), (5000, True)])
def test_many_channels(count, messages, tmp_path, capsys):
    (tmp_path / 'a.mcap').write_bytes(channels(count, messages))
    commands(tmp_path / 'a.mcap', tmp_path)
    assert replay([str(tmp_path / 'a.mcap'), '--mode', 'paper', '--jobs', '1']) == 1
    assert len(capsys.readouterr().err) < 1000, 'one line, not one for each valve'


def test_a_message_between_declarations_costs_no_look_at_the_whole_file(tmp_path, monkeypatch):
    count, read = 2000, []
    file = tmp_path / 'a.mcap'
    file.write_bytes(channels(count, messages=True))
    original = McapFile.read_bytes

    def counted(self, at, size):
        data = original(self, at, size)
        read.append(len(data))
        return data

    monkeypatch.setattr(McapFile, 'read_bytes', counted)
    assert salvage(file, tmp_path / 'saved.mcap').saved.messages == count
    assert sum(read) / count < 50_000  # was a megabyte, or all that follows


def test_many_layouts(tmp_path):
    layouts(tmp_path / 'a.mcap')
    assert commands(tmp_path / 'a.mcap', tmp_path) == [WHOLE, WHOLE]


def test_chunks_that_unpack_to_gigabytes(tmp_path):
    (tmp_path / 'a.mcap').write_bytes(bombs(60, 1 << 28))
    assert commands(tmp_path / 'a.mcap', tmp_path)[0] in (LOSSY, UNUSABLE)


@pytest.mark.parametrize('name', ['a.mcap.zstd', 'a.mcap', 'a.db3.zstd'])
def test_a_file_that_unpacks_to_gigabytes(name, tmp_path):
    packer = zstandard.ZstdCompressor().compressobj()
    start = b'SQLite format 3\0' if 'db3' in name else MAGIC
    data = packer.compress(start) + b''.join(packer.compress(bytes(1 << 24)) for _ in range(128))
    (tmp_path / name).write_bytes(data + packer.flush())
    report = inspect(tmp_path / name)
    assert report.code == UNUSABLE
    assert 'decompress it first' in report.problems[0]
