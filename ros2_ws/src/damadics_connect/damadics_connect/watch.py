# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Follow the judgements of all valves in the graph, of single detectors and of fleets."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace

from damadics_fd.core.text import NAME, plain
from damadics_fd.ros import qos
from damadics_fd.ros.freshness import judged_stamp
from damadics_msgs.msg import FaultEvent, FaultFlag, FleetEvent, FleetLayout, FleetStatus
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from damadics_connect.ages import Ages
from damadics_connect.judgement import (
    STATES,
    Judgement,
    Transition,
    class_of,
    transition_of,
    with_flag,
    with_transition,
)

LOOK_AROUND = 0.5  # s between two looks at the graph
LOOK = 0.2  # s between two looks for silence
SILENT = 2.0  # s without a word after which a valve counts as not monitored
KEPT = 10_000  # transitions
FLAG_TYPE = 'damadics_msgs/msg/FaultFlag'
ROOT = 'root'  # how a valve without a namespace is called
OnState = Callable[[Judgement], None]
OnEvent = Callable[[Transition], None]


class Watch:
    """
    The valves of the graph.

    What it calls runs in the thread of ROS 2.

    :param node: that subscribes.
    :param on_state: called when what is shown of a valve has changed.
    :param on_event: called once for each transition.
    """

    def __init__(
        self,
        node: Node,
        on_state: OnState = lambda judgement: None,
        on_event: OnEvent = lambda event: None,
    ) -> None:
        self.valves: dict[str, Judgement] = {}
        self.events: deque[Transition] = deque(maxlen=KEPT)
        self.services: set[str] = set()
        self._node = node
        self._on_state = on_state
        self._on_event = on_event
        self._seen: set[tuple[str, int, int, str]] = set()
        self._met: set[str] = set()
        self._layouts: dict[int, FleetLayout] = {}
        self._ages = Ages()  # of those with a flag of their own
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(LOOK_AROUND, self._look_around, clock=steady)
        node.create_timer(LOOK, self._look, clock=steady)
        node.create_subscription(FleetLayout, '/fleet/layout', self._take_layout, qos.latched(10))
        node.create_subscription(FleetStatus, '/fleet/status', self._take_status, qos.latched(10))
        node.create_subscription(
            FleetEvent, '/fleet/fault_event', self._take_fleet_event, qos.latched(1000)
        )

    def tell(self, on_state: OnState, on_event: OnEvent) -> None:
        """
        Set who is told; call it before the node spins.

        :param on_state: called when what is shown of a valve has changed.
        :param on_event: called once for each transition.
        """
        self._on_state, self._on_event = on_state, on_event

    def _look_around(self) -> None:
        """Find new valves by their flags."""
        self.services = {name for name, _ in self._node.get_service_names_and_types()}
        for topic, kinds in self._node.get_topic_names_and_types():
            namespace, _, name = topic.rpartition('/')
            valve = namespace.lstrip('/') or ROOT
            new = name == 'fault_flag' and FLAG_TYPE in kinds and valve not in self._met
            if new and self._node.count_publishers(topic):
                self._meet(valve)

    def _meet(self, name: str) -> None:
        self._met.add(name)

        def take_flag(message: FaultFlag) -> None:
            now = time.monotonic()
            judgement = with_flag(self.valves.get(name, Judgement(name)), message, now)
            self._ages.heard(name, judged_stamp(message), now)
            old = self._ages.old(name, self._node.get_clock().now().nanoseconds, now)
            self._change(judgement.silent() if old else judgement)

        def take_event(message: FaultEvent) -> None:
            self._take_event(transition_of(name, message))

        self._node.create_subscription(
            FaultFlag, topic_of(name, 'fault_flag'), take_flag, qos.FLAG
        )
        self._node.create_subscription(
            FaultEvent, topic_of(name, 'fault_event'), take_event, qos.EVENTS
        )

    def _take_layout(self, message: FleetLayout) -> None:
        self._layouts[message.version] = message

    def _take_status(self, message: FleetStatus) -> None:
        layout = self._layouts.get(message.layout)
        if layout is None:
            return
        now = time.monotonic()
        own_clock = self._node.get_clock().now().nanoseconds
        for row, index in enumerate(message.valve):
            if index >= len(layout.valve):
                continue
            name = layout.valve[index].lstrip('/') or ROOT
            if name in self._met and now - self.valves.get(name, Judgement(name)).heard < SILENT:
                continue  # its own flag says more
            before = self.valves.get(name, Judgement(name))
            age = message.age[row]
            self._change(
                replace(
                    before,
                    actuator=plain(layout.actuator[index], NAME),
                    area=plain(layout.area[index], NAME) if index < len(layout.area) else '',
                    state=STATES.get(message.state[row], 'unknown'),
                    ne107=class_of(message.level[row]),
                    fault=message.fault[row],
                    residual=message.residual[row],
                    threshold=message.threshold[row],
                    stamp=own_clock - int(age * 1e9) if age == age else before.stamp,
                    since=message.since[row],
                    cause=plain(message.cause[row], NAME) if row < len(message.cause) else '',
                    heard=now,
                )
            )

    def _take_fleet_event(self, message: FleetEvent) -> None:
        self._take_event(transition_of(message.valve.lstrip('/') or ROOT, message.event))

    def _take_event(self, event: Transition) -> None:
        if event.key in self._seen:
            return
        if len(self._seen) > 2 * KEPT:
            self._seen = {each.key for each in self.events}
        self._seen.add(event.key)
        self.events.append(event)
        before = self.valves.get(event.valve, Judgement(event.valve, event.actuator))
        if event.occurrence >= before.occurrence:
            self._change(with_transition(before, event))
        self._on_event(event)

    def _look(self) -> None:
        """Turn to "not monitored" what nobody has repeated, or what rests on an old sample."""
        now, clock = time.monotonic(), self._node.get_clock().now().nanoseconds
        for judgement in list(self.valves.values()):
            if judgement.state != 'not_monitored' and (
                now - judgement.heard > SILENT or self._ages.old(judgement.valve, clock, now)
            ):
                self._change(judgement.silent())

    def _change(self, judgement: Judgement) -> None:
        before = self.valves.get(judgement.valve)
        self.valves[judgement.valve] = judgement
        if before is None or before.shown != judgement.shown:
            self._on_state(judgement)


def namespace_of(valve: str) -> str:
    """Return the namespace of a valve: '' or with a leading slash."""
    return '' if valve == ROOT else f'/{valve}'


def topic_of(valve: str, name: str) -> str:
    """
    Return a topic or service of a valve.

    :param valve: as `Watch` names it.
    :param name: within its namespace.
    :return: the full name.

    >>> topic_of('lv101', 'fault_flag'), topic_of('root', 'fault_flag')
    ('/lv101/fault_flag', '/fault_flag')
    """
    return f'{namespace_of(valve)}/{name}'
