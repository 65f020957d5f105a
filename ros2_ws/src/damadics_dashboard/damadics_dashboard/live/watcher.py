# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page's ROS 2 node: finds valves, takes their topics, calls their services."""

import threading
import time
from collections.abc import Mapping, Sequence

import rclpy
from damadics_fd.core.text import NAME, plain
from damadics_fd.ros import qos
from damadics_fd.ros.spin import spin_until
from damadics_msgs.msg import (
    Estimate,
    FaultEvent,
    FaultFlag,
    Float64Stamped,
    Isolation,
    Measurement,
    OperatorAction,
    Signature,
)
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import QoSMessageLostInfo, SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription

from damadics_dashboard.live.calls import Calls, Field, Service, ServiceError
from damadics_dashboard.live.fleet import SERVICES, FleetReport, shared
from damadics_dashboard.live.late_size import SizeKeeper
from damadics_dashboard.live.overview import Overview
from damadics_dashboard.live.record import action_row, event_row
from damadics_dashboard.live.trend_points import TrendPoints
from damadics_dashboard.live.valve import Valve
from damadics_dashboard.store.history import History

FAST = {'measurement': Measurement, 'estimate': Estimate, 'threshold': Float64Stamped}
LOOK_AROUND = 0.5  # s between two looks at the graph
TICK = 0.05  # s between two collections of samples
STUCK = 1.5  # s without a round of the ROS thread
LINGER = 300.0  # s for which a valve is followed after its page was closed
FLAG_TYPE = 'damadics_msgs/msg/FaultFlag'
STATUS_TYPE = 'damadics_msgs/msg/FleetStatus'
MEASUREMENT_TYPE = 'damadics_msgs/msg/Measurement'


class Watcher:
    """
    Watch every valve of the graph in a thread of its own.

    :param history: takes the transitions.
    :param trends: takes what changes over days.
    :param follow: valves up to this number have all their samples taken all the time; in a larger
        fleet only those that somebody looks at.
    :param ros_args: arguments of ROS 2, from `--ros-args` on.
    """

    def __init__(
        self, history: History, trends: TrendPoints, follow: int, ros_args: Sequence[str] = ()
    ) -> None:
        self.history = history
        self.trends = trends
        self._simulated = any('use_sim_time:=true' in word for word in ros_args)
        self._clock = 0  # ns
        self.valves: dict[str, Valve] = {}
        self.overview = Overview(self.valves, lambda: self.clock)
        for name in history.valves():
            self._valve(name)
        self._tags = history.tags()
        for name, tag in self._tags.items():
            self._valve(name).tag = tag
        for event in reversed(history.latest(count=1000)):
            self.valves[event['valve']].take_event(event)
        self._follow = follow
        self._ros_args = list(ros_args)
        self._wanted: dict[str, float] = {}
        self._subscriptions: dict[tuple[str, str], Subscription] = {}
        self._followed: set[str] = set()  # valves whose samples are taken
        self._calls = Calls()
        self._fleets: dict[str, FleetReport] = {}
        self._second = 0.0
        self._ticked = -1e9
        self.services: set[str] = set()
        self.failure: BaseException | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='ros', daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Leave the graph and end the thread."""
        self._stop.set()
        self._thread.join(5.0)

    @property
    def alive(self) -> bool:
        """Whether the thread runs and comes round."""
        return self._thread.is_alive() and time.monotonic() - self._ticked < STUCK

    @property
    def clock(self) -> int:
        """Present ROS time [ns]: of the machine, or of `/clock` with use_sim_time."""
        return self._clock if self._simulated else time.time_ns()

    def note_action(
        self,
        valve: str,
        action: str,
        *,
        user: str,
        role: str,
        comment: str,
        done: bool,
        result: str,
    ) -> None:
        """
        Keep what a person has done.

        :param valve: name of the valve.
        :param action: name of the service.
        :param user: who.
        :param role: of the token.
        :param comment: why.
        :param done: whether it was done.
        :param result: the answer.
        """
        self.history.add_action(
            {
                'valve': valve,
                'action': action,
                'user': plain(user, NAME),
                'role': role,
                'comment': plain(comment),
                'done': int(done),
                'result': plain(result),
            }
        )

    def want(self, name: str) -> None:
        """
        Have all samples of a valve taken, as its page is open.

        :param name: name of the valve.
        """
        self._wanted[name] = time.monotonic() + LINGER

    def offers(self, valve: str, service: str) -> bool:
        """
        Tell whether a service of a valve is there.

        :param valve: name of the valve.
        :param service: name of the service.
        :return: True where somebody serves it.
        """
        return _topic(valve, service) in self.services

    async def call(
        self,
        valve: str,
        service: str,
        kind: Service,
        request: Mapping[str, Field],
        patience: float = 5.0,
    ) -> tuple[bool, str]:
        """
        Call a service of a valve.

        :param valve: name of the valve.
        :param service: name of the service, relative to the valve.
        :param kind: type of the service.
        :param patience: time that the answer may take [s].
        :param request: fields of the request.
        :return: whether it was done, and the answer's sentence.
        :raises ServiceError: where nobody answers.
        """
        name = _topic(valve, service)
        known = self.valves.get(valve)
        if name not in self.services and known and known.fleet and service in SERVICES:
            name, kind, more = shared(known.fleet, service)
            request = {**request, **more}
        if name not in self.services:
            raise ServiceError(f'nobody serves {name}: is the node running?')
        return await self._calls.call(name, kind, patience, request)

    def _run(self) -> None:
        try:
            rclpy.init(args=self._ros_args, signal_handler_options=SignalHandlerOptions.NO)
            self._node = Node('dashboard')
            executor = EventsExecutor()
            executor.add_node(self._node)
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self._node.create_timer(TICK, self._tick, clock=steady)
            self._node.create_timer(LOOK_AROUND, self._look_around, clock=steady)
            profile = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
            self._node.create_subscription(
                DiagnosticArray, '/diagnostics', self._take_diagnostics, profile
            )
            spin_until(lambda: self._stop.is_set() or not rclpy.ok(), executor, [self._node])
            executor.shutdown()
            self._node.destroy_node()
        except ExternalShutdownException:
            pass
        except BaseException as problem:
            self.failure = problem
            raise
        finally:
            rclpy.try_shutdown()

    def _tick(self) -> None:
        now = self._ticked = time.monotonic()
        if self._simulated:
            self._clock = self._node.get_clock().now().nanoseconds
        for name in self._followed:
            self.valves[name].collect(now)
        if now - self._second >= 1.0:
            self._second = now
            for valve in tuple(self.valves.values()):
                valve.second()
                self.trends.take(valve)
                if valve.tag and self._tags.get(valve.name) != valve.tag:
                    self._tags[valve.name] = valve.tag
                    self.history.keep_tag(valve.name, valve.tag)
            self.trends.keep(now)
            self.history.retry()
        self._calls.carry_out(self._node)

    def _look_around(self) -> None:
        """Find valves, and take up or drop their topics."""
        self.services = {name for name, _ in self._node.get_service_names_and_types()}
        for topic, kinds in self._node.get_topic_names_and_types():
            parent, _, name = topic.rpartition('/')
            if (
                (name == 'fault_flag' and FLAG_TYPE in kinds)
                or (name == 'measurement' and MEASUREMENT_TYPE in kinds)
            ) and self._node.count_publishers(topic):
                self._meet(parent.lstrip('/'))
            if name == 'status' and STATUS_TYPE in kinds and topic not in self._fleets:
                self._meet_fleet(topic, parent)
        now = time.monotonic()
        alive = [v for v in self.valves if (v, 'fault_flag') in self._subscriptions]
        for name in alive:
            followed = len(alive) <= self._follow or self._wanted.get(name, 0.0) > now
            for topic in FAST:
                if followed:
                    self._take_up(name, topic)
                else:
                    self._drop(name, topic)

    def _meet(self, name: str) -> None:
        if (name, 'fault_flag') in self._subscriptions:
            return
        valve = self._valve(name)
        sizes = SizeKeeper(self.history)

        def take_flag(message: FaultFlag) -> None:
            valve.take_flag(message, time.monotonic())

        def take_event(message: FaultEvent) -> None:
            self._note_event(name, message)

        def take_action(message: OperatorAction) -> None:
            self._note_action(name, message)

        def take_signature(message: Signature) -> None:
            valve.signature = message
            sizes.keep(valve.events, message)

        def take_isolation(message: Isolation) -> None:
            valve.isolation = message

        for kind, topic, act, profile in (
            (FaultFlag, 'fault_flag', take_flag, qos.FLAG),
            (FaultEvent, 'fault_event', take_event, qos.EVENTS),
            (OperatorAction, 'operator_action', take_action, qos.EVENTS),
            (Signature, 'signature', take_signature, qos.FLAG),
            (Isolation, 'isolation', take_isolation, qos.FLAG),
        ):
            self._subscriptions[name, topic] = self._node.create_subscription(
                kind, _topic(name, topic), act, profile
            )

    def _valve(self, name: str) -> Valve:
        return self.valves.setdefault(name, Valve(name, self._simulated))

    def _note_action(self, name: str, message: OperatorAction) -> None:
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        self.history.add_action(action_row(name, message), stamp)

    def _note_event(self, name: str, message: FaultEvent) -> None:
        event, valve = event_row(name, message), self._valve(name)
        valve.unseen.tell(event)
        if self.history.add(event):
            valve.take_event(event)

    def _meet_fleet(self, topic: str, parent: str) -> None:
        """Take what one process says of its many valves."""
        report = self._fleets[topic] = FleetReport(self._valve, parent, self.valves.get)
        report.subscribe(self._node, self._note_event, self._note_action)

    def _take_up(self, name: str, topic: str) -> None:
        if (name, topic) in self._subscriptions:
            return
        valve = self.valves[name]
        self._followed.add(name)

        def lost(event: QoSMessageLostInfo) -> None:
            valve.lost += event.total_count_change

        self._subscriptions[name, topic] = self._node.create_subscription(
            FAST[topic],
            _topic(name, topic),
            valve.batches[topic].take,
            qos.SAMPLES,
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(message_lost=lost),
        )

    def _drop(self, name: str, topic: str) -> None:
        subscription = self._subscriptions.pop((name, topic), None)
        if subscription is not None:
            self._node.destroy_subscription(subscription)
            self.valves[name].forget(topic)
            if not any((name, other) in self._subscriptions for other in FAST):
                self._followed.discard(name)

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            node = status.name.partition(':')[0]
            parent, _, kind = node.rpartition('/')
            if report := self._fleets.get(f'/{node}/status'):
                report.take_diagnostics({v.key: v.value for v in status.values})
            if kind in ('estimator', 'detector') and (valve := self.valves.get(parent)):
                valve.diagnostics[kind] = {v.key: v.value for v in status.values}
                valve.diagnostics[kind]['Message'] = status.message
                valve.levels[kind] = status.level[0]
                valve.told_at[kind] = time.monotonic()
                valve.take_tag(status.hardware_id)


def _topic(valve: str, name: str) -> str:
    return f'/{valve}/{name}' if valve else f'/{name}'
