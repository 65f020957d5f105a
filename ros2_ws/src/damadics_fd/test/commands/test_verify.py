# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The report of verify: one verdict per recording, timing, JSON, expectations."""

import json

import numpy as np
import pytest
from damadics_fd.bag import BagWriter
from damadics_fd.bag.checking.timing import Timing
from damadics_fd.commands.verify import main

pytestmark = pytest.mark.plain
MILLISECOND = 1_000_000
FLOAT = 'std_msgs/msg/Float64'


def write(path, stamps, late=()) -> None:
    with BagWriter(path) as bag:
        topic, other = bag.add_topic('/a', FLOAT), bag.add_topic('/late', FLOAT)
        for stamp in stamps:
            bag.write(topic, b'\0\1\0\0' + bytes(8), stamp, stamp)
        for stamp in late:
            bag.write(other, b'\0\1\0\0' + bytes(8), stamp, stamp)


def steady(n: int = 1000) -> list[int]:
    return [10**12 + i * 5 * MILLISECOND for i in range(n)]


def test_a_folder_gets_one_verdict_per_recording(tmp_path, capsys):
    write(tmp_path / 'in/a.mcap', steady())
    write(tmp_path / 'in/deeper/b.mcap', steady(10))
    write(tmp_path / 'in/split', steady(20))
    data = (tmp_path / 'in/a.mcap').read_bytes()
    (tmp_path / 'in/cut.mcap').write_bytes(data[:-300])
    assert main([str(tmp_path / 'in')]) == 3
    told = capsys.readouterr().out
    assert 'cut.mcap: lossy' in told
    for name in ('a.mcap', 'b.mcap', 'split'):
        assert f'{name}: whole' in told


def test_timing_tells_rate_gaps_duplicates_zero_stamps_and_a_late_start(tmp_path, capsys):
    stamps = steady()
    del stamps[500:520]
    stamps.insert(10, stamps[9])
    late = [stamps[400], stamps[401]]
    write(tmp_path / 'a.mcap', stamps, late)
    assert main([str(tmp_path / 'a.mcap'), '--json']) == 0
    ((report),) = json.loads(capsys.readouterr().out)
    topic = report['topics']['/a']
    assert (report['verdict'], report['messages']) == ('whole', 983)
    assert topic['count'] == 981
    assert topic['rate'] == pytest.approx(980 / 4.995)
    assert topic['period'] == pytest.approx(0.005, rel=0.05)
    assert topic['max_gap'] == pytest.approx(0.105)
    assert (topic['gaps'], topic['duplicates'], topic['zero_stamps']) == (1, 1, 0)
    assert topic['late_start'] == 0.0
    assert report['topics']['/late']['late_start'] == pytest.approx((late[0] - stamps[0]) / 1e9)


@pytest.mark.parametrize('pieces', [1, 7])
def test_timing_does_not_depend_on_how_the_messages_are_parted(pieces):
    rng = np.random.default_rng(3)
    stamp = np.cumsum(rng.integers(0, 10_000_000, 5000))
    timing = Timing()
    for part in np.array_split(stamp, pieces):
        timing.note(part, part)
    interval = np.diff(stamp)
    forward = interval[interval > 0]
    assert timing.jitter == pytest.approx(forward.std() / 1e9)
    assert timing.period == pytest.approx(np.median(forward) / 1e9, rel=0.05)
    assert timing.duplicates == (interval == 0).sum()
    assert timing.max_gap == interval.max()


def test_stamps_of_zero_are_counted_and_one_message_has_no_rate():
    timing = Timing()
    timing.note(np.array([5]), np.array([0]))
    assert (timing.zero_stamps, timing.rate, timing.period, timing.gaps) == (1, 0.0, 0.0, 0)


@pytest.mark.parametrize(
    ('asked', 'code', 'told'),
    [
        ('{count: 1000, rate: [195, 205], max_gap: 0.01}', 0, ''),
        (f'{{type: {FLOAT}, duplicates: 0, late_start: 1}}', 0, ''),
        ('{count: 999}', 1, '/a: count 1000, expected 999'),
        ('{count: [1001, .inf]}', 1, 'count 1000, expected 1001 to inf'),
        ('{max_gap: 0.001}', 1, '/a: max_gap 0.005, expected at most 0.001'),
        ('{type: a/msg/B}', 1, f'/a: type {FLOAT}, expected a/msg/B'),
        ('{speed: 1}', 2, 'there is no speed; there are type, count'),
        ('{rate: fast}', 2, 'write a number'),
        ('5', 2, 'write measures below it'),
    ],
)
def test_expectations_serve_in_ci(asked, code, told, tmp_path, capsys):
    write(tmp_path / 'a.mcap', steady())
    (tmp_path / 'e.yaml').write_text(f'topics:\n  /a: {asked}\n')
    assert main([str(tmp_path / 'a.mcap'), '--expect', str(tmp_path / 'e.yaml')]) == code
    assert told in capsys.readouterr().err


def test_a_missing_topic_and_a_useless_file_of_expectations_are_told(tmp_path, capsys):
    write(tmp_path / 'a.mcap', steady(3))
    (tmp_path / 'e.yaml').write_text('topics: {/b: {count: 1}}')
    assert main([str(tmp_path / 'a.mcap'), '--expect', str(tmp_path / 'e.yaml')]) == 1
    assert '/b: expected, and not there' in capsys.readouterr().err
    (tmp_path / 'e.yaml').write_text('- nothing')
    assert main([str(tmp_path / 'a.mcap'), '--expect', str(tmp_path / 'e.yaml')]) == 2
    assert main([str(tmp_path / 'a.mcap'), '--expect', str(tmp_path / 'no.yaml')]) == 2


def test_control_characters_of_a_file_never_reach_the_terminal(tmp_path, capsys):
    from damadics_fd.bag.mcap.writer import McapWriter

    path = tmp_path / 'a.mcap'
    with path.open('wb') as stream:
        writer = McapWriter(stream)
        schema = writer.add_schema('a/msg/\x1b]0;B', 'ros2msg', b'float64 v')
        writer.add_channel(schema, '/a\x1b[31m\r\nb\u202e\x9b', 'cdr', {})
        writer.finish()
    path.write_bytes(path.read_bytes()[:-40])
    main([str(path)])
    told = capsys.readouterr()
    for text in (told.out, told.err):
        assert not set('\x1b\r\u202e\x9b') & set(text)
    assert '\\x1b[31m' in told.out
