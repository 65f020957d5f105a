# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""SQLite bags row by row: whatever a cell holds, each message comes once, and damage is told."""

import random
import sqlite3
import struct
from pathlib import Path

import pytest
from damadics_fd.bag.checking.inspection import LOSSY, WHOLE, inspect
from damadics_fd.bag.salvage import salvage
from damadics_fd.bag.sqlite.reader import SqliteFile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

pytestmark = pytest.mark.plain

Row = tuple[int, object, object, object]  # id, topic, time, data
HEAD = b'\0\1\0\0'


def write(path: Path, rows: list[Row], encoding: str = 'UTF-8', topics: int = 3) -> Path:
    path.unlink(missing_ok=True)
    database = sqlite3.connect(path)
    with database:
        database.execute(f"PRAGMA encoding = '{encoding}'")
        database.execute(
            'CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT,'
            ' serialization_format TEXT, offered_qos_profiles TEXT)'
        )
        database.execute(
            'CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data)'
        )
        database.execute('CREATE INDEX timestamp_idx ON messages(timestamp)')
        for i in range(topics):
            database.execute(
                "INSERT INTO topics VALUES(?, ?, 'a/B', 'cdr', '')", (7 * i + 1, f'/{i}')
            )
        database.executemany('INSERT INTO messages VALUES(?, ?, ?, ?)', rows)
    database.close()
    return path


def read(path: Path) -> list[tuple[str, int, bytes]]:
    with SqliteFile(path, tolerant=True) as file:
        return [
            (file.channels[number].topic, time, batch.message(row))
            for batch in file.batches()
            for row, (number, time) in enumerate(
                zip(batch.channels.tolist(), batch.log_times().tolist(), strict=True)
            )
        ]


sizes = st.one_of(st.integers(0, 200), st.integers(0, 200_000))


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    entries=st.lists(st.tuples(st.integers(1, 9), st.integers(0, 2), sizes), max_size=60),
    repeat=st.sampled_from([1, 40]),
    encoding=st.sampled_from(['UTF-8', 'UTF-16le']),
)
def test_every_message_comes_once_with_its_bytes(tmp_path_factory, entries, repeat, encoding):
    path = tmp_path_factory.mktemp('p') / 'a.db3'
    rng, rows, expected, number = random.Random(len(entries)), [], [], -5
    for step, topic, size in entries * repeat:
        number += step  # ids may have gaps
        data = HEAD + rng.randbytes(size if repeat == 1 else size % 300)
        time = rng.randrange(2**62)
        rows.append((number, 7 * topic + 1, time, data))
        expected.append((f'/{topic}', time, data))
    write(path, rows, encoding)
    assert read(path) == expected
    report = inspect(path)
    assert (report.code, report.messages) == (WHOLE, len(rows)), report.problems


@pytest.mark.parametrize(
    'odd',
    [
        (None, 5, b'x'),
        (99, 5, b'x'),
        ('one', 5, b'x'),
        (1, None, b'x'),
        (1, 'noon', b'x'),
        (1, 1.5, b'x'),
        (1, 5, None),
    ],
)
def test_a_row_that_is_no_message_is_told_and_costs_no_other(odd, tmp_path):
    rows: list[Row] = [(i, 1, i, HEAD + struct.pack('<d', i)) for i in range(1, 3000)]
    rows[1500] = (1501, *odd)
    path = write(tmp_path / 'a.db3', rows)
    assert [time for _, time, _ in read(path)] == [i for i in range(1, 3000) if i != 1501]
    report = inspect(path)
    assert report.code == LOSSY
    assert '1 rows are no messages' in str(report.problems)


def test_ids_far_apart_are_all_found(tmp_path):
    ids = [-(2**63), -1, 0, 1, 2**40, 2**40 + 1, 2**63 - 1]
    path = write(tmp_path / 'a.db3', [(i, 1, 5, HEAD) for i in ids])
    assert len(read(path)) == len(ids)
    assert inspect(path).code == WHOLE


def test_large_messages_are_read_one_by_one(tmp_path):
    data = [HEAD + bytes([i]) * 3_000_000 for i in range(12)]
    path = write(tmp_path / 'a.db3', [(i, 1, i, data[i]) for i in range(12)])
    assert [found for *_, found in read(path)] == data


@pytest.mark.parametrize('seed', range(20))
def test_a_damaged_page_costs_no_row_of_another(seed, tmp_path):
    rows: list[Row] = [(i, 1, i, HEAD + struct.pack('<dd', i, i)) for i in range(1, 5000)]
    path = write(tmp_path / 'a.db3', rows)
    data = bytearray(path.read_bytes())
    page = 4096
    leaves = [at for at in range(page, len(data), page) if data[at] == 0x0D]
    assert len(leaves) > 20
    at = random.Random(seed).choice(leaves[2:])
    data[at : at + page] = random.Random(seed).randbytes(page)
    path.write_bytes(data)
    found = [message for *_, message in read(path)]
    report = inspect(path)
    assert report.code == LOSSY
    assert len(set(found) & {row[3] for row in rows}) > 4700
    assert len(found) == len(set(found))
    result = salvage(path, tmp_path / 'b.mcap')
    assert result.saved.messages == len(found)
