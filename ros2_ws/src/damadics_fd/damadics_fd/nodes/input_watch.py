# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Take an input and watch it: silence, a second publisher, refused QoS, lost messages."""

import math
import time
from collections.abc import Callable
from typing import Generic, NamedTuple, Protocol, TypeVar

from rclpy.event_handler import QoSMessageLostInfo as Lost
from rclpy.event_handler import QoSRequestedIncompatibleQoSInfo as Incompatible
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSPolicyKind, QoSProfile

from damadics_fd.core.text import NAME, plain
from damadics_fd.ros.entities import Entities
from damadics_fd.ros.freshness import ForwardJumps, Freshness

FIRST_WORD = 0.8  # s of wall time after the start
NEXT_WORDS = 30.0  # s
HISTORY = 3600.0  # s; older samples are a replay
COUNTED_EVERY = 0.5  # s
PERIODS = 3.0  # slower samples than the timeout allows for may be late by so many periods


class Stamped(Protocol):
    """What a message carries, with the stamp of its header."""

    @property
    def stamp(self) -> int:
        """Instant of the measurement [ns]."""


S = TypeVar('S', bound=Stamped)


class Input(NamedTuple, Generic[S]):
    """What an input is taken by."""

    hand: Callable[[S, str], None]  # takes what a watch in this process has let through
    subscribe: Callable[[], Callable[[], None]]  # takes what DDS brings; returns what ends that


class InputWatch:
    """
    Subscribe to an input and watch whether it arrives.

    Age is counted on ROS time, so that a slow or fast replay is judged as it was live. Where ROS
    time itself stands still, wall time counts: a stopped clock is silence too.

    :param node: the node that needs the input.
    :param topic: its topic, as the node names it.
    :param command: the command that starts its publisher.
    :param timeout: age [s] from which the input counts as silent; may be set later.
    :param period: nominal time between two messages [s].
    """

    def __init__(
        self,
        node: Node,
        entities: Entities,
        topic: str,
        command: str,
        timeout: float,
        period: float = 0.0,
    ) -> None:
        self.timeout = timeout
        self.max_age = float('inf')  # [s] from which a judgement is not healthy
        self._entities = entities
        self._node = node
        self._topic, self._name = topic, node.resolve_topic_name(topic)
        self._command = command
        self._slow = PERIODS * period
        self._clock = node.get_clock()
        self._simulated = bool(node.get_parameter('use_sim_time').value)
        self.wall = -math.inf  # monotonic time of the last message [s]
        self._ros = 0  # ROS time of the last message [ns]
        self._ros_seen = 0
        self._ros_moved = 0.0  # monotonic time of the last motion of ROS time [s]
        self._fresh = self._own = Freshness(self._simulated)
        self._far: Callable[[], int] = lambda: 0  # messages whose stamp alone ran far ahead
        self._tag = ''  # that came last
        self._lost = 0
        self._publishers, self._counted = 0, -COUNTED_EVERY  # how many, and when [s]
        self._mismatch = ''
        self._timer = entities.timer(FIRST_WORD, self._remind)

    def input(
        self,
        kind: type,
        read: Callable[[bytes], tuple[S, str] | None],
        take: Callable[[S, str], None],
        profile: QoSProfile,
    ) -> Input[S]:
        """
        Say what the input is and who takes it.

        :param kind: type of its messages, which have a header.
        :param read: returns what a serialised message carries and its tag; None: ignore it.
        :param take: called with each; not with one whose stamp alone runs far ahead.
        :param profile: quality of service; no deadline, for a publisher that offers none would
            then not be heard at all.
        :return: what it is taken by; nothing is subscribed to as yet.
        """
        jumps: ForwardJumps[S] = ForwardJumps()
        self._far = lambda: jumps.refused
        fresh = self._own.waiting.append

        def handed(item: S, tag: str) -> None:
            self.wall = now = time.monotonic()
            if self._simulated:
                self._ros = self._clock.now().nanoseconds
            if tag != self._tag:
                self._tag = plain(tag, NAME)
            self._fresh = self._own
            fresh((item.stamp, now))
            take(item, self._tag)

        def arrived(data: bytes) -> None:  # as little as may be: it is called for each sample
            found = read(data)
            if not found:
                return
            item, tag = found
            self.wall = now = time.monotonic()
            self._fresh = self._own
            if self._simulated:
                self._ros = self._clock.now().nanoseconds
            if tag != self._tag:
                self._tag = plain(tag, NAME)
            stamp = item.stamp
            if jumps.passes(stamp, now):
                fresh((stamp, now))
                take(item, self._tag)
                return
            for admitted in jumps.admit(stamp, item, now):
                fresh((admitted.stamp, now))
                take(admitted, self._tag)

        events = SubscriptionEventCallbacks(
            incompatible_qos=self._incompatible, message_lost=self._count_lost
        )
        subscription = self._entities.subscription
        return Input(
            handed, lambda: subscription(kind, self._topic, arrived, profile, events, raw=True)
        )

    def heard_beside(self, other: 'InputWatch') -> None:
        """
        Note that what this watch waits for was made of what another one in the process heard.

        :param other: it has just heard it.
        """
        self.wall, self._ros, self._fresh = other.wall, other._ros, other._fresh

    @property
    def age(self) -> float:
        """Time since the last message [s], infinite before the first."""
        if self.wall == -math.inf:
            return float('inf')
        now = time.monotonic()
        if not self._simulated:
            return now - self.wall
        ros = self._clock.now().nanoseconds
        if ros != self._ros_seen:
            self._ros_seen, self._ros_moved = ros, now
        stopped = now - max(self._ros_moved, self.wall)
        return max(max(ros - self._ros, 0) * 1e-9, stopped)

    @property
    def silent(self) -> bool:
        """Whether nothing has arrived for longer than the timeout."""
        return self.age > max(self.timeout, self._slow)

    @property
    def lag(self) -> float:
        """Age of the newest sample by its stamp [s]; below 0 in the future, 0 before any."""
        if self.wall == -math.inf:
            return 0.0
        return self._fresh.age(self._clock.now().nanoseconds, time.monotonic())

    @property
    def stale(self) -> bool:
        """Whether the newest sample is too old for a judgement to be healthy."""
        return self.lag > max(self.max_age, self.timeout)

    @property
    def lateness(self) -> str:
        """What the stamps of the samples say against the clock."""
        lag = self.lag
        if lag < 0.0:
            return f'samples are stamped {-lag:.3g} s in the future: set the clocks right'
        if lag > HISTORY:
            return (
                f'samples are {lag / 86400.0:.3g} days old: for a replay publish /clock and set '
                'use_sim_time'
            )
        return (
            f'samples are {lag:.3g} s old when they are judged: this machine is too slow, or a '
            'clock is wrong'
        )

    @property
    def publishers(self) -> int:
        """Number of publishers of the input, as of lately: to ask the graph is costly."""
        now = time.monotonic()
        if now - self._counted > COUNTED_EVERY:
            with self._node.handle:  # the name is resolved: half the cost
                count = self._node.handle.get_count_publishers(self._name)
            self._publishers, self._counted = count, now
        return self._publishers

    @property
    def problem(self) -> str:
        """What is wrong with the input beside silence, '' if nothing."""
        if self._mismatch:
            return self._mismatch
        if self.publishers > 1:
            return f'{self.publishers} publishers on {self._name}: only one may send'
        return ''

    def values(self) -> dict[str, object]:
        """
        Return what a diagnostic status should tell.

        :return: values by name with unit.
        """
        age = self.age
        return {
            'Age of the last message (s)': age if age < float('inf') else 'never',
            'Lag of its stamp (s)': self.lag,
            'Messages stamped far ahead': self._far(),
            'Publishers': self.publishers,
            'Messages lost': self._lost,
        }

    def _incompatible(self, event: Incompatible) -> None:
        policy = QoSPolicyKind(event.last_policy_kind).name.lower()
        self._mismatch = (
            f'a publisher of {self._name} offers an incompatible quality of service ({policy}): '
            'it has to be reliable'
        )
        self._node.get_logger().error(self._mismatch)

    def _count_lost(self, event: Lost) -> None:
        self._lost = event.total_count
        self._node.get_logger().warning(
            f'{self._lost} messages lost on {self._name}: this machine is too slow',
            throttle_duration_sec=5.0,
        )

    def _remind(self) -> None:
        if self.silent:
            self._timer.timer_period_ns = int(NEXT_WORDS * 1e9)
            self._timer.reset()  # the turn that is under way would still be the short one
            since = 'waiting for' if self.wall == -math.inf else 'nothing comes any more on'
            self._node.get_logger().warning(f'{since} {self._name}: {self._command}')
        else:
            self._timer.timer_period_ns = int(FIRST_WORD * 1e9)
