# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Say what a node waits for while its input is missing."""

import time

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

FIRST_WORD = 0.8  # s of wall time after the start
NEXT_WORDS = 30.0  # s


class InputWatch:
    """
    Watch whether an input arrives, on wall time.

    :param node: the node that needs the input.
    :param topic: its topic, as the node names it.
    :param command: the command that starts its publisher.
    :param timeout: age [s] from which the input counts as silent.
    """

    def __init__(self, node: Node, topic: str, command: str, timeout: float) -> None:
        self._node = node
        self._topic = topic
        self._command = command
        self._timeout = timeout
        self._last: float | None = None
        self._timer = node.create_timer(
            FIRST_WORD, self._remind, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def arrived(self) -> None:
        """Note that a message has arrived."""
        self._last = time.monotonic()

    @property
    def silent(self) -> bool:
        """Whether nothing has arrived for longer than the timeout."""
        return self._last is None or time.monotonic() - self._last > self._timeout

    def _remind(self) -> None:
        period = FIRST_WORD
        if self.silent:
            period = NEXT_WORDS
            topic = self._node.resolve_topic_name(self._topic)
            since = 'waiting for' if self._last is None else 'nothing comes any more on'
            self._node.get_logger().warning(f'{since} {topic}: {self._command}')
        self._timer.timer_period_ns = int(period * 1e9)
        self._timer.reset()
