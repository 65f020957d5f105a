# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the system tests share: a domain of their own, processes, a node of the test."""

import contextlib
import os
import random
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import rclpy
from damadics_bringup.processes import Processes, free_domain, surroundings
from damadics_fd.ros import qos
from damadics_fd.ros.process.sockets import let_messages_wait, listen_on_sockets
from damadics_msgs.msg import Measurement
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.client import Client
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.qos import QoSProfile

QUIET = 0.012  # s that the loop of `promised` takes on the machine that the times are promised on
PATIENCE = 120.0  # s for what takes a second or two: a busy machine is no failure
PYTEST = 'PYTEST_CURRENT_TEST'  # a page as a process takes it for a test of its own

listen_on_sockets()  # a busy machine holds up this process, too


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of the page and of OPC UA: they run beside those of the other nodes."""
    for item in items:
        if (folder := item.path.parent.name) in ('page', 'opcua'):
            item.add_marker(folder)


class Peer:
    """A node of the test in its own domain: publishes samples, keeps what the nodes publish."""

    def __init__(self, domain: int, publishes: bool = True) -> None:
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node('peer', context=self.context)
        let_messages_wait()
        self.executor = EventsExecutor(context=self.context)
        self.executor.add_node(self.node)
        if publishes:
            self.publisher = self.node.create_publisher(Measurement, 'measurement', qos.SAMPLES)
        self.got: dict[str, list] = {}
        self.clients: dict[str, Client] = {}

    def listen(self, kind, topic: str, profile: QoSProfile) -> list:
        messages = self.got[topic] = []
        self.node.create_subscription(kind, topic, messages.append, profile)
        return messages

    def wait(self, condition, patience: float = PATIENCE) -> bool:
        deadline = time.monotonic() + patience
        while not condition() and time.monotonic() < deadline:
            self.executor.spin_once(timeout_sec=0.02)
        return bool(condition())

    def await_met(self, *nodes: str) -> None:
        """
        Wait until nodes have met each other, which nobody else is told of.

        What one of them publishes before is lost; each has had a second to find the others when
        it reports on itself once more.
        """
        told: list[str] = []
        heard = self.node.create_subscription(
            DiagnosticArray,
            '/diagnostics',
            lambda message: told.extend(
                status.name.partition(':')[0] for status in message.status
            ),
            qos.DIAGNOSTICS,
        )
        assert self.wait(lambda: all(told.count(node) >= 2 for node in nodes)), told
        self.wait(lambda: False, promised(0.5))
        self.node.destroy_subscription(heard)

    def call(self, kind, name: str, wait=None, **request):
        """
        Call a service and return its answer; `wait`, as of the peer, lets samples go on.

        That the client has found the server does not say that the server has found the client,
        whose answer is lost before: it is given a moment, once.
        """
        wait = wait or self.wait
        known = name in self.clients
        if not known:
            self.clients[name] = self.node.create_client(kind, name)
        client = self.clients[name]
        assert wait(client.service_is_ready), f'{name} is not served'
        if not known:
            wait(lambda: False, patience=promised(0.2))
        future = client.call_async(kind.Request(**request))
        assert wait(future.done), f'{name} does not answer'
        return future.result()

    def send(self, stamp: int, cv: float, x1: float, **others: float) -> None:
        message = Measurement(cv=cv, x1=x1, p1=3.5e6, p2=2.6e6, t1=20.0, flow=5.0, ps=1e5)
        for name, value in others.items():
            setattr(message, name, value)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
        message.header.frame_id = 'LC74_20'
        self.publisher.publish(message)

    def send_columns(self, columns: dict[str, np.ndarray]) -> None:
        """Send samples no faster than the chain takes them: a queue holds 1000."""
        for n, values in enumerate(
            zip(*(columns[k].tolist() for k in ('stamp', 'cv', 'x1')), strict=True), 1
        ):
            self.send(*values)
            if n % 300 == 0:
                assert self.wait(lambda n=n: len(self.got['threshold']) >= n), 'samples were lost'

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@contextlib.contextmanager
def ended(process: subprocess.Popen) -> Iterator[subprocess.Popen]:
    """Let a test use a process that does not outlive it, also where the test fails."""
    with process:
        try:
            yield process
        finally:
            process.kill()


class Child(NamedTuple):
    """A process that another one has started."""

    name: str
    valve: str
    pid: int


def children(process: int) -> list[Child]:
    """List what a process, such as `run`, has started."""
    found = []
    for number in Path(f'/proc/{process}/task/{process}/children').read_text().split():
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):  # it has ended meanwhile
            words = Path(f'/proc/{number}/cmdline').read_bytes().decode().split('\0')
            valve = next((w.removeprefix('__ns:=/') for w in words if w.startswith('__ns:=')), '')
            if len(words) > 1:  # else it is just being started
                found.append(Child(Path(words[1]).name, valve, int(number)))
    return found


def promised(seconds: float) -> float:
    """Return what a promised time becomes on a slow machine, or where others take their share."""
    began = time.perf_counter()
    rest = 0
    for n in range(200_000):
        rest += n * n % 7
    slower = (time.perf_counter() - began) / QUIET
    return seconds * max(1.0, slower, os.getloadavg()[0] / (os.cpu_count() or 1))


def free_port() -> int:
    """Find a port for a server that starts later: no client is given one below 32768 meanwhile."""
    while True:
        port = random.SystemRandom().randrange(10_000, 32_000)
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(('127.0.0.1', port))
            return port


def alone(patch: pytest.MonkeyPatch, folder: Path) -> int:
    """Give this process and those it starts a ROS domain and a state folder of their own."""
    number = free_domain()
    for name, value in surroundings(number).items():
        patch.setenv(name, value)
    patch.setenv('XDG_STATE_HOME', str(folder / 'state'))
    return number


@pytest.fixture
def domain(monkeypatch, tmp_path):
    return alone(monkeypatch, tmp_path)


@pytest.fixture
def peer(domain):
    peer = Peer(domain)
    yield peer
    peer.close()


@pytest.fixture
def processes(tmp_path, domain):
    with Processes(tmp_path / 'logs', surroundings(domain)) as processes:
        yield processes
