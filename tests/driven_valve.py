# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A valve that a test drives in real time, before the running nodes."""

import time

from conftest import PATIENCE
from damadics_bringup.processes import parameters
from damadics_fd.ros import qos
from damadics_msgs.msg import FaultEvent, FaultFlag
from damadics_msgs.srv import ResetAlarm
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSProfile

PERIOD = 10_000_000  # ns
LATE = 0.5  # s
# the printed method, learning slowly, for it would soon take the test's throws of the stem as
# normal; with a latch, for its alarms are to be operated
SETTINGS = {'mode': 'paper', 'sample_rate': 100.0, 'latch': True, 'off_delay': 0.3, 'gw': 0.1}


class Valve:
    """A valve at rest whose stem can be thrown, sent by the test in real time."""

    def __init__(self, peer, node: str = '') -> None:
        self.peer = peer
        self.stamp = PERIOD
        self.next = self.zero = 0
        self.sent: list[int] = []  # stamps
        self.flags = peer.listen(FaultFlag, 'fault_flag', qos.FLAG)
        self.events = peer.listen(FaultEvent, 'fault_event', qos.EVENTS)
        self.reports = peer.listen(DiagnosticArray, '/diagnostics', QoSProfile(depth=100))

    def run(self, seconds: float, throw: bool = False, swing: bool = False) -> None:
        """Send samples for a while; their stamps keep up with the clock, as those of a plant."""
        end = time.monotonic() + seconds
        if self.stamp != self.next:  # set by the test
            self.zero = time.monotonic() - self.stamp * 1e-9
        while (now := time.monotonic()) < end:
            due = now - self.zero
            if due - self.stamp * 1e-9 > LATE:
                self.stamp = int(due / PERIOD * 1e9) * PERIOD  # it was paused
            while self.stamp * 1e-9 <= due:
                x1 = 0.5 + (0.1 * (self.stamp // (20 * PERIOD) % 2) if throw else 0.0)
                cv = 0.3 + 0.4 * (self.stamp // 10**9 % 2) if swing else 0.5
                self.peer.send(self.stamp, cv, x1)
                self.sent.append(self.stamp)
                self.stamp += PERIOD
            self.next = self.stamp
            self.peer.wait(lambda: False, PERIOD * 1e-9)

    def run_until(self, condition, throw: bool = False, patience: float = PATIENCE) -> bool:
        """Send samples until something has come about."""
        deadline = time.monotonic() + patience
        while not condition() and time.monotonic() < deadline:
            self.run(0.05, throw)
        return bool(condition())

    def raise_alarm(self) -> None:
        """Throw the stem until there is an alarm, then let its condition go."""
        self.run(0.3)
        assert self.run_until(lambda: self.flags and self.flags[-1].fault, throw=True)
        assert self.run_until(lambda: self.flags[-1].state == FaultFlag.STATE_LATCHED)

    def call(self, kind, name: str, **request):
        """Call a service, samples going on."""
        return self.peer.call(kind, name, self.run_until, **request)

    def told(self, node: str) -> list:
        """Return the diagnostic status of a node as often as it was told."""
        return [s for m in self.reports for s in m.status if s.name.startswith(f'{node}:')]

    def report(self, node: str):
        """Return the latest diagnostic status of a node; send samples until there is one."""
        assert self.run_until(lambda: self.told(node)), f'no diagnostics of {node}'
        return self.told(node)[-1]

    def says(self, node: str, text: str) -> bool:
        """Tell whether the latest status of a node has a text in its message."""
        return any(text in status.message for status in self.told(node)[-1:])

    def calm(self) -> None:
        """Bring the valve to health, whatever the test before has left."""
        assert self.run_until(
            lambda: self.flags[-1].state in (FaultFlag.STATE_HEALTHY, FaultFlag.STATE_LATCHED)
        )
        if self.flags[-1].state == FaultFlag.STATE_LATCHED:
            assert self.call(ResetAlarm, 'reset').success
        assert self.run_until(lambda: self.flags[-1].state == FaultFlag.STATE_HEALTHY)


def start(processes, peer, alarms='auto', **settings) -> Valve:
    settings = {**SETTINGS, **settings}
    processes.start('damadics_fd', 'estimator', parameters(**settings))
    processes.start(
        'damadics_fd',
        'detector',
        parameters(alarm_folder=alarms, allow_partial_stroke=True, **settings),
    )
    valve = Valve(peer)
    wait_until_monitored(peer, valve.flags)
    return valve


def wait_until_monitored(peer, flags: list) -> None:
    """Wait until estimator and detector of the peer's measurement take it and each other."""
    graph = peer.node
    assert peer.wait(lambda: flags), 'the detector did not start'
    assert peer.wait(lambda: graph.count_subscribers('/measurement') > 0)
    assert peer.wait(
        lambda: graph.count_publishers('/estimate') and graph.count_subscribers('/estimate')
    )
