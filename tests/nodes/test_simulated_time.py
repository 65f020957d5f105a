# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Nodes whose time is that of a simulation: it pauses, and begins anew."""

import time

import pytest
from conftest import PATIENCE
from damadics_fd.core.stamps import SECOND
from damadics_msgs.msg import FaultFlag
from diagnostic_msgs.msg import KeyValue
from driven_valve import Valve, start
from rosgraph_msgs.msg import Clock

pytestmark = pytest.mark.ros


class SimulatedTime:
    """Publishes /clock with the stamps of the samples."""

    def __init__(self, valve: Valve) -> None:
        self.valve = valve
        self.publisher = valve.peer.node.create_publisher(Clock, '/clock', 10)

    def run_until(self, condition) -> bool:
        """Send samples and their time until something has come about."""
        end = time.monotonic() + PATIENCE
        while not condition() and time.monotonic() < end:
            clock = Clock()
            clock.clock.sec, clock.clock.nanosec = divmod(self.valve.stamp, SECOND)
            self.publisher.publish(clock)
            self.valve.run(1e-3)
        return bool(condition())


def test_a_pause_and_a_jump_back_of_simulated_time_raise_no_alarm(processes, peer):
    valve = start(processes, peer, use_sim_time=True)
    valve.stamp = 50 * SECOND
    simulated = SimulatedTime(valve)

    def healthy_at(first: int, last: int) -> bool:
        flag = valve.flags[-1]
        return flag.state == FaultFlag.STATE_HEALTHY and first < flag.header.stamp.sec < last

    assert simulated.run_until(lambda: healthy_at(50, 60))
    # the clock and the samples pause
    assert peer.wait(lambda: valve.flags[-1].state == FaultFlag.STATE_NOT_MONITORING)
    pause = valve.flags[-1].header.stamp.sec
    assert simulated.run_until(lambda: healthy_at(pause, 120))
    valve.stamp = 10 * SECOND  # the bag begins anew
    assert simulated.run_until(lambda: healthy_at(10, 50))
    assert all(flag.occurrence == 0 for flag in valve.flags)
    counted = KeyValue(key='Samples clock jumps', value='1')
    assert simulated.run_until(lambda: counted in valve.told('estimator')[-1].values)
    assert valve.reports[-1].header.stamp.sec < 200, 'diagnostics carry simulated time'
