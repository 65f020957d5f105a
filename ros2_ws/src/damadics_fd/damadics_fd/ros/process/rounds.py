# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the nodes of a process do again and again, each pace of it by one timer."""

from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from damadics_fd.ros.process.shared import Shared
from damadics_fd.ros.process.status_board import StatusBoard


class Round(Shared[Callable[[], object]]):
    """
    Call the turns of several nodes by one timer: each waking costs its share.

    :param period: between two rounds, of wall time [s].
    """

    def __init__(self, period: float) -> None:
        super().__init__()
        self._period = period

    def _make(self, keeper: Node) -> None:
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = keeper.create_timer(self._period, self._go, clock=steady)

    def _release(self, keeper: Node) -> None:
        keeper.destroy_timer(self._timer)

    def _go(self) -> None:
        for member in self._members:
            member.part()


class Rounds:
    """The rounds of a process, by their period, and its statuses."""

    def __init__(self) -> None:
        self._rounds: dict[float, Round] = {}
        self.board = StatusBoard()

    def at(self, period: float) -> Round:
        """
        Return the round of a pace.

        :param period: between two rounds [s].
        :return: one and the same for all nodes.
        """
        return self._rounds.setdefault(period, Round(period))
