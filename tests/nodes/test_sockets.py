# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Nodes listen on sockets: in shared memory they were, now and then, deaf for ever."""

import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from conftest import Peer, promised
from damadics_fd.ros import qos
from damadics_fd.ros.process.sockets import PROFILES, ROOM
from damadics_msgs.msg import FaultFlag
from rclpy.qos import QoSProfile
from std_msgs.msg import Int32

pytestmark = pytest.mark.ros
READER = """
import rclpy
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
RECORDER = """
import rclpy, time
from damadics_fd.ros.process.sockets import listen_on_sockets
from damadics_fd.ros.spin import spin_until
from rclpy.experimental import EventsExecutor
from rclpy.qos import QoSProfile
from std_msgs.msg import Int32
listen_on_sockets()
rclpy.init()
node = rclpy.create_node('recorder')
executor = EventsExecutor()
executor.add_node(node)
heard = {'sample': [], 'flag': []}
for topic, messages in heard.items():
    node.create_subscription(Int32, topic, messages.append, QoSProfile(depth=2000))
ending = []
def done():
    if not ending and any(flag.data < 0 for flag in heard['flag']):
        ending.append(time.monotonic() + 2.0)  # the other topic may have its turn later
    return ending and time.monotonic() > ending[0]
spin_until(done, executor, [node])
print({topic: len(messages) for topic, messages in heard.items()}, flush=True)
"""
LESS = int(Path('/proc/sys/net/core/rmem_max').read_text()) < ROOM


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


@pytest.mark.skipif(LESS, reason='the kernel lets less wait: sysctl net.core.rmem_max=4194304')
def test_who_was_held_up_hears_every_flag_that_was_replaced_meanwhile(domain, monkeypatch):
    """A recorder that the machine held up for a tenth of a second had not all edges of a flag."""
    monkeypatch.delenv(PROFILES)
    peer = Peer(domain, publishes=False)
    samples = peer.node.create_publisher(Int32, 'sample', QoSProfile(depth=2000))
    flags = peer.node.create_publisher(Int32, 'flag', QoSProfile(depth=1))
    with subprocess.Popen(
        [sys.executable, '-c', RECORDER], stdout=subprocess.PIPE, text=True
    ) as recorder:
        try:
            assert peer.wait(lambda: samples.get_subscription_count())
            assert peer.wait(lambda: flags.get_subscription_count())
            peer.wait(lambda: False, promised(1.0))  # the recorder has met the publishers, too
            recorder.send_signal(signal.SIGSTOP)
            for n in range(1500):
                samples.publish(Int32(data=n))
                if n % 50 == 0:
                    flags.publish(Int32(data=n))
            recorder.send_signal(signal.SIGCONT)
            peer.wait(lambda: False, 1.0)
            flags.publish(Int32(data=-1))
            assert recorder.stdout.readline() == "{'sample': 1500, 'flag': 31}\n"
        finally:
            recorder.kill()
            peer.close()
