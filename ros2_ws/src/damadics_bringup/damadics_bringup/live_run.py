# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""One scenario through plant, estimator, detector and recorder as real processes over DDS."""

import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import rclpy
from damadics_fd.ros import qos
from damadics_msgs.msg import FaultFlag
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from damadics_bringup.processes import (
    ProcessError,
    Processes,
    free_domain,
    parameters,
    surroundings,
)

CHAIN = {  # the number of subscribers of each topic before the plant starts
    '/estimate': 2,
    '/residual': 1,
    '/threshold': 1,
    '/fault_flag': 2,
    '/fault_event': 1,
}
PATIENCE = 30.0  # s for the processes to discover each other
WRITING = 120.0  # s for the queues to empty, and for the recorder to write what it has
QUIET = 1.0  # s from the detector's last word to the end of the processes


class Watcher:
    """
    A node that sees the graph, the scenario's clock and the detector's flag.

    :param domain: ROS domain of the run.
    :param on_time: called with the scenario time [s].
    """

    def __init__(self, domain: int, on_time: Callable[[float], None]) -> None:
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = rclpy.create_node('demo', context=self._context)
        self._executor = EventsExecutor(context=self._context)
        self._executor.add_node(self._node)
        self.time = 0.0
        self.judged = 0.0  # scenario time of the detector's last word [s]

        def heed(flag: FaultFlag) -> None:
            self.judged = flag.header.stamp.sec + 1e-9 * flag.header.stamp.nanosec

        def take(message: Clock) -> None:
            self.time = message.clock.sec + 1e-9 * message.clock.nanosec
            on_time(self.time)

        profile = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._node.create_subscription(Clock, '/clock', take, profile)
        self._node.create_subscription(FaultFlag, 'fault_flag', heed, qos.FLAG)

    def spin_until(self, condition: Callable[[], bool], patience: float) -> bool:
        """
        Take messages until a condition holds.

        :param condition: what is waited for.
        :param patience: time it may take [s].
        :return: whether it came about.
        """
        deadline = time.monotonic() + patience
        while not condition():
            if time.monotonic() > deadline:
                return False
            try:
                self._executor.spin_once(timeout_sec=0.05)
            except ExternalShutdownException:
                raise KeyboardInterrupt from None
        return True

    def subscribers(self, topic: str) -> int:
        """Return the number of subscribers of a topic."""
        return self._node.count_subscribers(topic)

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()


def run(
    scenario: str,
    folder: Path,
    *,
    factor: float,
    on_time: Callable[[float], None],
) -> Path:
    """
    Run a scenario live in paper mode and record it.

    :param scenario: name of the scenario.
    :param folder: for the bag and the logs; what is there is replaced.
    :param factor: seconds of scenario per second of wall time.
    :param on_time: called with the scenario time [s] while it runs.
    :return: the bag.
    :raises ProcessError: where a process fails, or the chain does not come about.
    """
    shutil.rmtree(folder, ignore_errors=True)
    bag = folder / 'bag'
    domain = free_domain()
    os.environ.update(surroundings(domain))  # the watcher lives in this process
    with Processes(folder / 'logs', surroundings(domain)) as processes:
        watcher = Watcher(domain, on_time)
        try:
            processes.start('damadics_fd', 'recorder', ['--all', '--out', str(bag)])
            for name in ('estimator', 'detector'):
                processes.start('damadics_fd', name, parameters(mode='paper'))
            _await_chain(watcher, processes)
            processes.start(
                'damadics_plant',
                'plant',
                parameters(
                    scenario=scenario,
                    rate=400.0,
                    real_time_factor=factor,
                    publish_clock=True,
                    wait_for_subscribers=2,
                ),
            )
            watcher.spin_until(lambda: processes.ended('plant'), PATIENCE + 3600.0)
            processes.check()
            watcher.spin_until(lambda: watcher.judged >= watcher.time, WRITING)
            watcher.spin_until(lambda: False, QUIET)
            for name in ('estimator', 'detector', 'recorder'):
                processes.end(name, WRITING)
        finally:
            watcher.close()
    return bag


def _await_chain(watcher: Watcher, processes: Processes) -> None:
    """Wait until every subscriber of the chain has found its topic."""

    def complete() -> bool:
        processes.check()
        return all(watcher.subscribers(t) >= count for t, count in CHAIN.items())

    if not watcher.spin_until(complete, PATIENCE):
        missing = [t for t, count in CHAIN.items() if watcher.subscribers(t) < count]
        raise ProcessError(
            f'after {PATIENCE:g} s nobody takes {", ".join(missing)}: is localhost multicast off? '
            'Set ROS_STATIC_PEERS=127.0.0.1, or look at the logs.'
        )
