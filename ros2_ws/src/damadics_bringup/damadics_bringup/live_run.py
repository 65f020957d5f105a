# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""One scenario through plant, estimator, detector and recorder as real processes over DDS."""

import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import rclpy
from damadics_fd.core.settings import Settings
from damadics_fd.ros import qos
from damadics_fd.store.references import load_reference
from damadics_msgs.msg import FaultFlag
from damadics_msgs.srv import Reference
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
AGAIN = 0.3  # s between two looks at how far the estimator has learned
# Faster than real time, samples wait for their senders to be free: many then go in one packet.
BUNDLED = {'RMW_FASTRTPS_PUBLICATION_MODE': 'ASYNCHRONOUS'}


class Watcher:
    """
    A node that sees the graph, the scenario's clock and the detector's flag.

    :param domain: ROS domain of the run.
    :param on_time: called with the scenario time [s].
    """

    def __init__(self, domain: int, on_time: Callable[[float], None]) -> None:
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = rclpy.create_node('demo', context=self._context, enable_rosout=False)
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

    def save_reference(self, reference: Path) -> float:
        """
        Let the estimator save what it has learned.

        :param reference: where it does.
        :return: the time up to which it has learned [s].
        :raises ProcessError: where it does not save.
        """
        client = self._node.create_client(Reference, 'save_reference')
        if not self.spin_until(client.service_is_ready, PATIENCE):
            raise ProcessError('the estimator offers no save_reference: look at its log')
        answer = client.call_async(Reference.Request())
        self.spin_until(answer.done, PATIENCE)
        response = answer.result() if answer.done() else None
        if response is None or not response.success:
            why = response.message if response else 'no answer'
            raise ProcessError(f'the estimator did not save what it learned: {why}')
        kept = load_reference(reference, None, Settings.for_mode('paper'))
        return kept.last_stamp * 1e-9

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()


class LiveRun:
    """
    The processes of one scenario in paper mode, in steps: the next may start while this one ends.

    Close it whatever happens; that ends what still runs.

    :param scenario: name of the scenario.
    :param folder: for the bag and the logs; what is there is replaced.
    :param reference: what the estimator begins with; where it does not exist, zero weights.
    :param on_time: called with the scenario time [s] while it runs.
    :param recorded: judge and record, not only estimate.
    """

    def __init__(
        self,
        scenario: str,
        folder: Path,
        reference: Path,
        on_time: Callable[[float], None],
        *,
        recorded: bool,
    ) -> None:
        shutil.rmtree(folder, ignore_errors=True)
        self.bag = folder / 'bag'
        self._scenario = scenario
        self._reference = reference
        self._recorded = recorded
        domain = free_domain()
        os.environ.update(surroundings(domain))  # the watcher lives in this process
        self._watcher = Watcher(domain, on_time)
        self._processes = Processes(folder / 'logs', surroundings(domain))
        kept = {'reference': str(reference.resolve())}
        if recorded:
            self._processes.start('damadics_fd', 'recorder', ['--all', '--out', str(self.bag)])
        self._processes.start(
            'damadics_fd', 'estimator', parameters(mode='paper', **kept), more=BUNDLED
        )
        if recorded:
            self._processes.start(
                'damadics_fd', 'detector', parameters(mode='paper'), more=BUNDLED
            )

    def close(self) -> None:
        """End what still runs."""
        self._processes.end_all()
        self._watcher.close()

    def play(self, factor: float) -> None:
        """
        Simulate the scenario to its end, once everybody listens.

        :param factor: seconds of scenario per second of wall time; 0: as fast as it goes.
        :raises ProcessError: where a process fails, or the chain does not come about.
        """
        if self._recorded:
            _await_chain(self._watcher, self._processes)
        self._processes.start(
            'damadics_plant',
            'plant',
            parameters(
                scenario=self._scenario,
                rate=400.0,
                real_time_factor=factor,
                publish_clock=True,
                wait_for_subscribers=2 if self._recorded else 1,
            ),
        )
        self._watcher.spin_until(lambda: self._processes.ended('plant'), PATIENCE + 3600.0)
        self._processes.check()

    def finish(self) -> None:
        """
        Let the detector judge and the recorder write what the plant has sent.

        :raises ProcessError: where a process fails.
        """
        watcher = self._watcher
        watcher.spin_until(lambda: watcher.judged >= watcher.time, WRITING)
        watcher.spin_until(lambda: False, QUIET)
        for name in ('estimator', 'detector', 'recorder'):
            self._processes.end(name, WRITING)

    def keep_learned(self, until: float) -> None:
        """
        Have the estimator save what it has learned.

        :param until: end of the scenario [s].
        :raises ProcessError: where a process fails, or not all of the scenario is learned.
        """
        deadline = time.monotonic() + WRITING
        while self._watcher.save_reference(self._reference) < until:
            self._processes.check()
            if time.monotonic() > deadline:
                raise ProcessError(f'the estimator has not taken all {until:g} s: see its log')
            self._watcher.spin_until(lambda: False, AGAIN)
        self._processes.end('estimator', WRITING)


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
