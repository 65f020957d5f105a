# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What writers other than ours may put into a chunk or a schema."""

import struct
import zlib

import lz4.frame
import numpy as np
import pytest
import zstandard
from damadics_fd.bag import BagError, read_columns
from damadics_fd.bag.checking.inspection import inspect
from damadics_fd.bag.mcap.records import MAGIC
from damadics_fd.bag.mcap.writer import McapWriter
from damadics_fd.bag.recording import Recording
from damadics_fd.bag.salvage import salvage

pytestmark = pytest.mark.plain

ROWS = 200
X1 = np.arange(ROWS) / ROWS
SKIPPED = b'\x50\x2a\x4d\x18' + struct.pack('<I', 4) + b'abcd'  # a frame for others, both formats
TEXT = b'float64 cv\nfloat64 x1\n'


def string(text: bytes) -> bytes:
    return struct.pack('<I', len(text)) + text


def record(op: int, content: bytes) -> bytes:
    return bytes([op]) + struct.pack('<Q', len(content)) + content


def chunk(records: bytes, compression: str, packed: bytes) -> bytes:
    head = struct.pack('<QQQI', 0, ROWS, len(records), zlib.crc32(records))
    return record(6, head + string(compression.encode()) + struct.pack('<Q', len(packed)) + packed)


def messages(channel: int = 1) -> bytes:
    head = struct.Struct('<HIQQ4sdd')
    return b''.join(
        record(5, head.pack(channel, i, i, i, b'\0\1\0\0', 0.5, x1)) for i, x1 in enumerate(X1)
    )


def recording(path, compression: str, packed: bytes, text: bytes = TEXT):
    """Write a file without summary whose one chunk is given."""
    schema = record(
        3, struct.pack('<H', 1) + string(b'a/msg/B') + string(b'ros2msg') + string(text)
    )
    ids = struct.pack('<HH', 1, 1)
    channel = record(4, ids + string(b'/measurement') + string(b'cdr') + string(b''))
    end = record(15, bytes(4)) + record(2, bytes(20))
    body = chunk(messages(), compression, packed)
    path.write_bytes(MAGIC + record(1, string(b'ros2') + string(b'other')) + schema + channel)
    with path.open('ab') as file:
        file.write(body + end + MAGIC)
    return path


def zstd(data: bytes) -> bytes:
    return zstandard.compress(data)


def streamed(data: bytes) -> bytes:
    return zstandard.ZstdCompressor(write_content_size=False).compress(data)


FRAMES = {
    'zstd, two frames': ('zstd', lambda b: zstd(b[:999]) + zstd(b[999:])),
    'zstd, two frames without size': ('zstd', lambda b: streamed(b[:999]) + streamed(b[999:])),
    'zstd, an empty frame first': ('zstd', lambda b: zstd(b'') + zstd(b)),
    'zstd, a frame to be skipped first': ('zstd', lambda b: SKIPPED + zstd(b)),
    'zstd, a frame to be skipped last': ('zstd', lambda b: streamed(b) + SKIPPED),
    'lz4, two frames': (
        'lz4',
        lambda b: lz4.frame.compress(b[:999]) + lz4.frame.compress(b[999:]),
    ),
    'lz4, a frame to be skipped first': ('lz4', lambda b: SKIPPED + lz4.frame.compress(b)),
    'lz4, an empty frame first': (
        'lz4',
        lambda b: lz4.frame.compress(b'') + lz4.frame.compress(b),
    ),
}


@pytest.mark.parametrize('kind', FRAMES)
def test_a_chunk_may_consist_of_several_frames(kind, tmp_path):
    compression, pack = FRAMES[kind]
    path = recording(tmp_path / 'a.mcap', compression, pack(messages()))
    assert read_columns(path)['x1'].tolist() == X1.tolist()
    assert inspect(path).code == 0
    assert salvage(path, tmp_path / 'b.mcap').code == 0
    assert read_columns(tmp_path / 'b.mcap')['x1'].tolist() == X1.tolist()


@pytest.mark.parametrize('more', [b'\0', messages()])
@pytest.mark.parametrize('kind', FRAMES)
def test_frames_that_hold_more_or_less_than_the_chunk_says_are_damage(kind, more, tmp_path):
    compression, pack = FRAMES[kind]
    for packed in (pack(messages() + more), pack(messages()[:-1])):
        path = recording(tmp_path / 'a.mcap', compression, packed)
        with pytest.raises(BagError, match='size does not match'):
            read_columns(path)
        assert inspect(path).problems


@pytest.mark.parametrize('text', [b'\xef\xbb\xbf' + TEXT, b'# 1 \xb0C\n' + TEXT])
def test_the_encoding_of_comments_does_not_matter(text, tmp_path):
    path = recording(tmp_path / 'a.mcap', '', messages(), text)
    assert read_columns(path)['x1'].tolist() == X1.tolist()


def test_a_topic_of_two_types_is_no_column_of_either(tmp_path):
    with (tmp_path / 'a.mcap').open('wb') as stream:
        writer = McapWriter(stream)
        for name, text in (('a/msg/B', TEXT), ('a/msg/C', b'float64 data\n')):
            number = writer.add_channel(
                writer.add_schema(name, 'ros2msg', text), '/measurement', 'cdr', {}
            )
            for i in range(10):
                payload = struct.pack('<4sdd', b'\0\1\0\0', 0.5, 0.25)
                writer.add_message(number, payload, i, i)
        writer.finish()
    reason = 'holds messages of several types: a/msg/B, a/msg/C'
    with pytest.raises(BagError, match=reason):
        read_columns(tmp_path / 'a.mcap')
    with pytest.raises(BagError, match=reason):
        list(Recording(tmp_path / 'a.mcap').chunks(lambda text: None))
