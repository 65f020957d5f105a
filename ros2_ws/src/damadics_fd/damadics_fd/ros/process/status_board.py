# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The diagnostic statuses of the nodes of a process, in one message once a second."""

from collections.abc import Callable, Sequence

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from damadics_fd.ros import qos
from damadics_fd.ros.process.shared import Shared

PERIOD = 1.0  # s of wall time


class StatusBoard(Shared[Callable[[], DiagnosticStatus | None]]):
    """
    Publisher of `/diagnostics` for all nodes of a process.

    The part of a node returns its present status; None where it failed, which it tells itself.
    """

    def _make(self, keeper: Node) -> None:
        self._clock = keeper.get_clock()
        self._publisher = keeper.create_publisher(DiagnosticArray, '/diagnostics', qos.DIAGNOSTICS)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = keeper.create_timer(PERIOD, self._publish_all, clock=steady)

    def _release(self, keeper: Node) -> None:
        keeper.destroy_timer(self._timer)
        keeper.destroy_publisher(self._publisher)

    def _publish_all(self) -> None:
        found = [member.part() for member in self._members]
        self.publish([status for status in found if status])

    def publish(self, statuses: Sequence[DiagnosticStatus]) -> None:
        """
        Publish statuses at once.

        :param statuses: of nodes that take part.
        """
        array = DiagnosticArray(status=statuses)
        array.header.stamp = self._clock.now().to_msg()
        self._publisher.publish(array)
