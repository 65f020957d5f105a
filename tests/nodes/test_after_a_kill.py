# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A node that is started in place of a killed one, in memory that nobody has cleared away."""

from contextlib import suppress
from pathlib import Path

import pytest
from conftest import Peer
from damadics_fd.ros import qos
from damadics_fd.ros.process.sockets import left_by_killed
from damadics_msgs.msg import FaultFlag

pytestmark = pytest.mark.ros


def memory_of(number: int) -> list[str]:
    """Return the shared memory in which a process listens."""
    opened = []
    for file in Path(f'/proc/{number}/fd').iterdir():
        with suppress(FileNotFoundError):  # closed meanwhile
            opened.append(file.readlink().name)
    return [name for name in opened if name.startswith('fastrtps_port')]


def test_it_listens_on_sockets(domain, processes):
    """In shared memory it was deaf for ever, now and then: see damadics_fd.ros.process.sockets."""
    for lock in left_by_killed(domain):
        lock.unlink()  # of whoever had this domain before
    assert memory_of(started(domain, processes)), 'where nobody was killed all is as ever'
    processes.kill('detector')
    assert left_by_killed(domain), 'it leaves the lock of its memory'
    assert memory_of(started(domain, processes)) == []


def started(domain, processes) -> int:
    """Start a detector, wait for its word, and return its process."""
    processes.start('damadics_fd', 'detector', [])
    peer = Peer(domain, publishes=False)
    try:
        flags = peer.listen(FaultFlag, '/fault_flag', qos.FLAG)
        assert peer.wait(lambda: flags)
    finally:
        peer.close()
    return processes.pid('detector')
