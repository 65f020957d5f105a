# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Find a second detector of the same valve: two judgements on one topic are none."""

import time
from collections.abc import Callable

from damadics_msgs.msg import FaultFlag
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from damadics_fd.ros.entities import Entities

RECENT = 10.0  # s for which another is told
NEWCOMER = 4.0  # s after its start in which a node gives way to the one that was there


class RivalWatch:
    """
    Listen to the node's own `fault_flag`: more messages than it has sent come from another.

    A dead node, which discovery keeps for a while, sends none and is no rival.

    :param node: the node.
    :param entities: of the node.
    :param refuse: called with the cause where the node has to give way.
    """

    def __init__(self, node: Node, entities: Entities, refuse: Callable[[str], None]) -> None:
        self._node = node
        self._refuse = refuse
        self._since = time.monotonic()
        self._sent = self._heard = 0
        self._met = -RECENT  # monotonic time when another was heard last [s]
        profile = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
        entities.subscription(FaultFlag, 'fault_flag', self._hear, profile)

    @property
    def problem(self) -> str:
        """That another detector judges this valve too, '' if none does."""
        if time.monotonic() - self._met > RECENT:
            return ''
        return 'another detector judges this valve too: end one of them'

    def sent(self) -> None:
        """Note that the node itself has sent a flag."""
        self._sent += 1

    def _hear(self, flag: FaultFlag) -> None:
        self._heard += 1
        if self._heard <= self._sent:
            return
        self._heard = self._sent
        self._met = time.monotonic()
        topic = self._node.resolve_topic_name('fault_flag')
        cause = (
            f'another detector sends on {topic}: give each valve a namespace of its own '
            '(--ros-args -r __ns:=/lv101), or end the other'
        )
        if time.monotonic() - self._since < NEWCOMER:
            self._refuse(cause)
        else:
            self._node.get_logger().error(cause, throttle_duration_sec=30.0)
