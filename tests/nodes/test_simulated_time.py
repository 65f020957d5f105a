# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Nodes whose time is that of a simulation: it pauses, and begins anew."""

import time

import pytest
from damadics_msgs.msg import FaultFlag
from driven_valve import Valve, start
from rosgraph_msgs.msg import Clock

pytestmark = pytest.mark.ros


class SimulatedTime:
    """Publishes /clock with the stamps of the samples."""

    def __init__(self, valve: Valve) -> None:
        self.valve = valve
        self.publisher = valve.peer.node.create_publisher(Clock, '/clock', 10)

    def run(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            clock = Clock()
            clock.clock.sec, clock.clock.nanosec = divmod(self.valve.stamp, 1_000_000_000)
            self.publisher.publish(clock)
            self.valve.run(1e-3)


def test_a_pause_and_a_jump_back_of_simulated_time_raise_no_alarm(processes, peer):
    valve = start(processes, peer, use_sim_time=True)
    valve.stamp = 50 * 1_000_000_000
    simulated = SimulatedTime(valve)
    simulated.run(1.0)
    assert valve.flags[-1].state == FaultFlag.STATE_HEALTHY
    peer.wait(lambda: False, 1.2)  # the clock and the samples pause
    assert valve.flags[-1].state == FaultFlag.STATE_NOT_MONITORING, 'silence is not health'
    simulated.run(1.0)
    assert valve.flags[-1].state == FaultFlag.STATE_HEALTHY
    valve.stamp = 10 * 1_000_000_000  # the bag begins anew
    simulated.run(1.5)
    assert valve.flags[-1].state == FaultFlag.STATE_HEALTHY
    assert valve.flags[-1].header.stamp.sec < 20
    assert valve.flags[-1].occurrence == 0
    values = {v.key: v.value for v in valve.report('estimator').values}
    assert values['Samples clock jumps'] == '1'
    stamp = valve.reports[-1].header.stamp
    assert stamp.sec < 60, 'diagnostics carry simulated time'
