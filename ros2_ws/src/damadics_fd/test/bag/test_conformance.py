# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every form that the MCAP specification allows is whole, and recovered byte for byte."""

import itertools
import struct
from pathlib import Path

import pytest
from damadics_fd.bag.checking.inspection import WHOLE, inspect
from damadics_fd.bag.mcap.crc import crc32
from damadics_fd.bag.mcap.records import HEAD, MAGIC, Op, record, string, string_map
from damadics_fd.bag.salvage import salvage

SHARED = Path(__file__).parents[5].parent / 'shared' / 'data' / 'bags'
CONFORMANCE = sorted((SHARED / 'mcap_conformance').glob('*/*.mcap'))
FEATURES = (
    'chunk',
    'chunk_index',
    'message_index',
    'statistics',
    'offsets',
    'repeat',
    'pad',
    'crc',
)
CONTENTS = ('nothing', 'messages', 'schemaless', 'attachment', 'metadata', 'all')

needs_shared = pytest.mark.skipif(not CONFORMANCE, reason='the shared bags are not here')


def content(path: Path) -> tuple:
    """Return everything that a file holds, as the reference library reads it."""
    records = pytest.importorskip('mcap.records')
    from mcap.stream_reader import StreamReader

    messages, attachments, metadata, channels, schemas = [], [], [], {}, {}
    with path.open('rb') as stream:
        for r in StreamReader(stream).records:
            if isinstance(r, records.Message):
                where = (r.channel_id, r.sequence, r.log_time, r.publish_time)
                messages.append((*where, r.data))
            elif isinstance(r, records.Attachment):
                attachments.append((r.name, r.media_type, r.create_time, r.log_time, r.data))
            elif isinstance(r, records.Metadata):
                metadata.append((r.name, r.metadata))
            elif isinstance(r, records.Channel):
                channels[r.id] = (r.topic, r.schema_id, r.message_encoding, r.metadata)
            elif isinstance(r, records.Schema):
                schemas[r.id] = (r.name, r.encoding, r.data)
    return messages, attachments, metadata, channels, schemas


def raw(path: Path, op: Op) -> list[bytes]:
    """Return the records of a kind in the data section as they stand in the file."""
    data, at, found = path.read_bytes(), len(MAGIC), []
    while at < len(data) - len(MAGIC):
        kind, length = HEAD.unpack_from(data, at)
        end = at + HEAD.size + length
        if kind == op:
            found.append(data[at:end])
        if kind == Op.DATA_END:
            break
        at = end
    return found


def assert_whole_and_recovered(path: Path, out: Path) -> None:
    report = inspect(path)
    expected = content(path)
    assert report.code == WHOLE, report.problems
    assert report.messages == len(expected[0])
    result = salvage(path, out)
    assert result.code == WHOLE
    assert content(out) == expected
    for op in (Op.ATTACHMENT, Op.METADATA):
        assert raw(out, op) == raw(path, op)
    out.unlink()


@needs_shared
@pytest.mark.parametrize('family', sorted({path.parent.name for path in CONFORMANCE}))
def test_the_official_set_is_whole_and_recovered(family, tmp_path):
    paths = [path for path in CONFORMANCE if path.parent.name == family]
    assert paths
    for path in paths:
        assert_whole_and_recovered(path, tmp_path / 'saved.mcap')


class Maker:
    """Write a file with some of the features of the format."""

    def __init__(self, features: set[str], what: str):
        self.features, self.what = features, what
        self.data = bytearray(MAGIC)
        self.groups: dict[Op, list[bytes]] = {}

    def record(self, op: Op, *parts: bytes) -> bytes:
        fixed = op in (Op.MESSAGE, Op.DATA_END, Op.FOOTER)
        if 'chunk' in self.features and 'everywhere' not in self.features:
            # the Python library cannot read these where they are longer
            fixed = fixed or op in (Op.CHUNK, Op.SCHEMA, Op.CHANNEL)
        return record(op, *parts, b'' if fixed or 'pad' not in self.features else b'\1\2\3')

    def build(self) -> bytes:
        has = self.what in ('messages', 'all')
        bare = self.what in ('schemaless', 'all')
        self.data += self.record(Op.HEADER, string('x'), string('maker'))
        schema = self.record(Op.SCHEMA, struct.pack('<H', 1), *map(string, ('S', 'text', 'abc')))
        channels = []
        for number, wanted, of in ((1, has, 1), (2, bare, 0)):
            if wanted:
                head = struct.pack('<HH', number, of)
                texts = (string(f't{number}'), string('a'), string_map({'k': 'v'}))
                channels.append((number, self.record(Op.CHANNEL, head, *texts)))
        defined = (schema if has else b'') + b''.join(data for _, data in channels)
        messages, index = bytearray(), {}
        for i in range(7 if channels else 0):
            number, _ = channels[i % len(channels)]
            time = (3 - i) % 7  # not in order
            index.setdefault(number, []).append((time, len(defined) + len(messages)))
            head = struct.pack('<HIQQ', number, i, time, i)
            messages += self.record(Op.MESSAGE, head, bytes([i]) * i)
        if 'chunk' in self.features and channels:
            self.chunk(defined + messages, index)
        else:
            self.data += defined + messages
        if self.what in ('attachment', 'all'):
            self.attachment()
        if self.what in ('metadata', 'all'):
            entry = self.record(Op.METADATA, string('m'), string_map({'a': 'b'}))
            place = struct.pack('<QQ', len(self.data), len(entry))
            self.group(Op.METADATA_INDEX, place, string('m'))
            self.data += entry
        crc = crc32(bytes(self.data)) if 'crc' in self.features else 0
        self.data += record(Op.DATA_END, struct.pack('<I', crc))
        if 'repeat' in self.features:
            self.groups[Op.SCHEMA] = [schema] if has else []
            self.groups[Op.CHANNEL] = [data for _, data in channels]
        if 'statistics' in self.features:
            counts = {number: len(entries) for number, entries in index.items()}
            self.statistics(counts, has, len(channels))
        return self.finish()

    def group(self, op: Op, *parts: bytes) -> None:
        self.groups.setdefault(op, []).append(self.record(op, *parts))

    def chunk(self, content: bytes, index: dict[int, list[tuple[int, int]]]) -> None:
        times = [time for entries in index.values() for time, _ in entries]
        head = struct.pack('<QQQI', min(times), max(times), len(content), crc32(content))
        data = self.record(Op.CHUNK, head, string(''), struct.pack('<Q', len(content)), content)
        start = len(self.data)
        self.data += data
        offsets, begin = b'', len(self.data)
        for number, entries in index.items() if 'message_index' in self.features else ():
            offsets += struct.pack('<HQ', number, len(self.data))
            pairs = b''.join(struct.pack('<QQ', *entry) for entry in sorted(entries))
            self.data += self.record(Op.MESSAGE_INDEX, struct.pack('<H', number), string(pairs))
        if 'chunk_index' in self.features:
            place = struct.pack('<QQQQ', min(times), max(times), start, len(data))
            sizes = struct.pack('<QQ', len(content), len(content))
            length = struct.pack('<Q', len(self.data) - begin)
            self.group(Op.CHUNK_INDEX, place, string(offsets), length, string(''), sizes)

    def attachment(self) -> None:
        fields = struct.pack('<QQ', 5, 6) + string('n') + string('text/plain')
        fields += struct.pack('<Q', 4) + b'data'
        entry = self.record(Op.ATTACHMENT, fields, struct.pack('<I', crc32(fields)))
        place = struct.pack('<QQQQQ', len(self.data), len(entry), 5, 6, 4)
        self.group(Op.ATTACHMENT_INDEX, place, string('n'), string('text/plain'))
        self.data += entry

    def statistics(self, counts: dict[int, int], schemas: int, channels: int) -> None:
        attached = int(self.what in ('attachment', 'all'))
        described = int(self.what in ('metadata', 'all'))
        chunks = int('chunk' in self.features and bool(counts))
        total = sum(counts.values())
        head = (total, int(schemas), channels, attached, described, chunks, 0, 6 if total else 0)
        pairs = b''.join(struct.pack('<HQ', *entry) for entry in counts.items())
        self.group(Op.STATISTICS, struct.pack('<QHIIIIQQ', *head), string(pairs))

    def finish(self) -> bytes:
        start, summary, offsets = len(self.data), b'', b''
        for op, members in self.groups.items():
            if members:
                group = b''.join(members)
                where = struct.pack('<BQQ', op, start + len(summary), len(group))
                offsets += self.record(Op.SUMMARY_OFFSET, where)
                summary += group
        has = 'offsets' in self.features and bool(summary)
        places = (start if summary else 0, start + len(summary) if has else 0)
        tail = summary + (offsets if has else b'')
        tail += HEAD.pack(Op.FOOTER, 20) + struct.pack('<QQ', *places)
        crc = crc32(tail) if 'crc' in self.features else 0
        return bytes(self.data) + tail + struct.pack('<I', crc) + MAGIC


@pytest.mark.parametrize('what', CONTENTS)
def test_every_combination_of_features_is_whole_and_recovered(what, tmp_path):
    for chosen in itertools.product((False, True), repeat=len(FEATURES)):
        features = {name for name, on in zip(FEATURES, chosen, strict=True) if on}
        if features & {'chunk_index', 'message_index'} and 'chunk' not in features:
            continue
        path = tmp_path / 'a.mcap'
        path.write_bytes(Maker(features, what).build())
        try:
            assert_whole_and_recovered(path, tmp_path / 'saved.mcap')
        except AssertionError as error:
            raise AssertionError(f'{what} {sorted(features)}: {error}') from error


@pytest.mark.plain
@pytest.mark.parametrize('what', ['schemaless', 'all'])
@pytest.mark.parametrize('features', [set(), {'chunk', 'crc'}, {*FEATURES}])
def test_the_barest_and_the_fullest_form_are_whole_and_recovered(what, features, tmp_path):
    path = tmp_path / 'a.mcap'
    path.write_bytes(Maker(features, what).build())
    assert_whole_and_recovered(path, tmp_path / 'saved.mcap')


@pytest.mark.plain
def test_longer_chunks_and_longer_records_within_them_are_read(tmp_path):
    features = {'chunk', 'chunk_index', 'message_index', 'statistics', 'pad', 'everywhere', 'crc'}
    (tmp_path / 'a.mcap').write_bytes(Maker(features, 'all').build())
    report = inspect(tmp_path / 'a.mcap')
    assert (report.code, report.messages) == (WHOLE, 7), report.problems
    assert salvage(tmp_path / 'a.mcap', tmp_path / 'b.mcap').saved.messages == 7


@needs_shared
@pytest.mark.parametrize(
    ('bag', 'twin'),
    [
        ('tests_sqlite3/cdr_test', 'tests_mcap/cdr_test'),
        ('tests_sqlite3/wrong_rmw_test', 'tests_mcap/wrong_rmw_test'),
        ('py_sqlite3/talker', 'py_mcap/talker'),
        ('py_sqlite3/wbag', 'py_mcap/wbag'),
        ('py_sqlite3/convert_a', 'py_mcap/convert_a'),
        (
            'py_sqlite3/reindex_test_bags/multiple_files',
            'py_mcap/reindex_test_bags/multiple_files',
        ),
        ('transport_sqlite3/test_bag_for_seek', 'transport_mcap/test_bag_for_seek'),
        ('cpp_bags/topics_and_services.db3', 'cpp_bags/topics_and_services.mcap'),
    ],
)
def test_sqlite_bags_equal_their_mcap_twins(bag, twin, tmp_path):
    found, expected = (inspect(SHARED / 'rosbag2' / name) for name in (bag, twin))
    assert found.code == expected.code == WHOLE, found.problems
    counts = [{t.name: t.count for t in r.topics.values() if t.count} for r in (found, expected)]
    assert counts[0] == counts[1]
    out = tmp_path / ('saved' if (SHARED / 'rosbag2' / bag).is_dir() else 'saved.mcap')
    result = salvage(SHARED / 'rosbag2' / bag, out)
    assert (result.code, result.saved.messages) == (WHOLE, expected.messages)


@needs_shared
def test_bags_of_other_makers_are_judged_as_they_are():
    for folder in ('nav2_cm_moving_obstacle', 'plotjuggler/rosbag2_test', 'rosbag2/empty_bag'):
        assert inspect(SHARED / folder).code == WHOLE
    for path in sorted((SHARED / 'lichtblick').glob('*.mcap')):
        assert inspect(path).code == WHOLE
    assert inspect(SHARED / 'foxglove-sdk' / 'empty.mcap').code == WHOLE
    assert inspect(SHARED / 'resurrector' / 'ros2_dir_bag').code == 1
