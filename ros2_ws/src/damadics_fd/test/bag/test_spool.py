# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Full disks and quotas: recording goes on, nothing that was written is harmed."""

import errno
import os
import time

import numpy as np
import pytest
from damadics_fd.bag import BagWriter, read_columns
from damadics_fd.bag.cdr.definition import type_hash
from damadics_fd.bag.checking.inspection import WHOLE, inspect
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.writing.spool import Spool

pytestmark = pytest.mark.plain

try:
    type_hash('std_msgs/msg/Float64')
except BagError:
    pytest.skip('std_msgs is not installed', allow_module_level=True)


def number(value: float) -> bytes:
    return b'\0\1\0\0' + np.float64(value).tobytes()


class Disk:
    """A disk that is full from some number of bytes on; it takes half of the last write."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.free = 1 << 60
        self._write = os.write
        monkeypatch.setattr(os, 'write', self.write)

    def write(self, descriptor: int, data: bytes) -> int:
        if self.free <= 0:
            raise OSError(errno.ENOSPC, 'No space left on device')
        part = data[: max(1, min(len(data), self.free))]
        self.free -= len(part)
        return self._write(descriptor, part)


def wait_until(condition, seconds: float = 60.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_a_full_disk_is_told_and_costs_nothing_once_there_is_room(tmp_path, monkeypatch):
    disk = Disk(monkeypatch)
    bag = BagWriter(tmp_path / 'bag', chunk_size=2000, flush_period=0.1)
    spool = Spool(bag)
    topic = bag.add_topic('/a', 'std_msgs/msg/Float64')
    for i in range(500):
        spool.put((topic, number(i), i, i))
    wait_until(lambda: spool.waiting == 0)
    disk.free = 100
    for i in range(500, 1000):
        spool.put((topic, number(i), i, i))
    wait_until(lambda: 'No space left' in spool.error)
    disk.free = 1 << 60
    wait_until(lambda: not spool.error and not spool.waiting)
    spool.close()
    assert read_columns(tmp_path / 'bag', '/a')['data'].tolist() == list(range(1000))
    report = inspect(tmp_path / 'bag')
    assert (report.code, report.messages) == (WHOLE, 1000)
    assert spool.dropped == 0


def test_the_queue_is_bounded_while_the_disk_is_full(tmp_path, monkeypatch):
    disk = Disk(monkeypatch)
    bag = BagWriter(tmp_path / 'bag', chunk_size=2000, flush_period=0.1)
    spool = Spool(bag, most_waiting=100)
    topic = bag.add_topic('/a', 'std_msgs/msg/Float64')
    for i in range(100):
        spool.put((topic, number(i), i, i))
    wait_until(lambda: spool.waiting == 0)
    disk.free = 0
    for i in range(100, 5000):
        spool.put((topic, number(i), i, i))
    wait_until(lambda: spool.error and spool.waiting <= 100)
    assert spool.dropped > 4000
    disk.free = 1 << 60
    spool.close()
    data = read_columns(tmp_path / 'bag', '/a')['data']
    assert data.tolist() == list(range(len(data)))
    assert len(data) + spool.dropped == 5000


def test_a_quota_removes_the_oldest_files(tmp_path):
    quota = 40_000
    with BagWriter(tmp_path / 'bag', quota_bytes=quota, chunk_size=1000) as bag:
        topic = bag.add_topic('/a', 'std_msgs/msg/Float64')
        rng = np.random.default_rng(0)
        for i in range(20_000):
            bag.write(topic, number(rng.random()), i, i)
    files = list((tmp_path / 'bag').glob('*.mcap'))
    assert sum(file.stat().st_size for file in files) < 1.3 * quota
    assert len(files) > 3
    columns = read_columns(tmp_path / 'bag', '/a')
    times = columns['log_time']
    assert times.tolist() == list(range(20_000 - len(times), 20_000))
    report = inspect(tmp_path / 'bag')
    assert (report.code, report.messages) == (WHOLE, len(times))
    assert f'message_count: {len(times)}' in (tmp_path / 'bag' / 'metadata.yaml').read_text()
