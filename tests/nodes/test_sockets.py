# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Nodes listen on sockets: in shared memory they were, now and then, deaf for ever."""

import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from conftest import Peer
from damadics_fd.ros import qos
from damadics_fd.ros.process.sockets import PROFILES
from damadics_msgs.msg import FaultFlag

pytestmark = pytest.mark.ros
READER = """
import os, rclpy
from damadics_fd.ros import qos
from damadics_msgs.msg import FaultFlag
rclpy.init()
node = rclpy.create_node('reader')
heard = []
node.create_subscription(FaultFlag, '/fault_flag', heard.append, qos.FLAG)
while not heard:
    rclpy.spin_once(node)
print('heard', flush=True)
input()
"""


def memory_of(number: int) -> list[str]:
    """Return the shared memory in which a process listens."""
    opened = []
    for file in Path(f'/proc/{number}/fd').iterdir():
        with suppress(FileNotFoundError):  # closed meanwhile
            opened.append(file.readlink().name)
    return [name for name in opened if name.startswith('fastrtps_port')]


@pytest.fixture
def detector(domain, processes):
    """A detector as a user starts it, who has said its first word; its process."""
    processes.forget(PROFILES)
    processes.start('damadics_fd', 'detector', [])
    peer = Peer(domain, publishes=False)
    try:
        flags = peer.listen(FaultFlag, '/fault_flag', qos.FLAG)
        assert peer.wait(lambda: flags)
    finally:
        peer.close()
    return processes.pid('detector')


def test_a_node_listens_in_no_shared_memory(detector):
    assert memory_of(detector) == []


def test_it_is_heard_by_who_listens_in_shared_memory(detector, monkeypatch):
    """Subscribers of the user's own do, where nothing is set."""
    monkeypatch.delenv(PROFILES)
    with subprocess.Popen(
        [sys.executable, '-c', READER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as reader:
        try:
            assert reader.stdout.readline() == 'heard\n'
            assert memory_of(reader.pid)
        finally:
            reader.kill()
