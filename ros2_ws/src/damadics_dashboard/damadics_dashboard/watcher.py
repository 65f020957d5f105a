# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page's ROS 2 node: finds valves, takes their topics, calls their services."""

import asyncio
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
from damadics_fd.ros import qos
from damadics_fd.ros.spin import spin_until
from damadics_msgs.msg import Estimate, FaultEvent, FaultFlag, Float64Stamped, Measurement
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from damadics_dashboard.history import History
from damadics_dashboard.valve import Valve

FAST = {'measurement': Measurement, 'estimate': Estimate, 'threshold': Float64Stamped}
LOOK_AROUND = 0.5  # s between two looks at the graph
TICK = 0.05  # s between two collections of samples
LINGER = 300.0  # s for which a valve is followed after its page was closed
FLAG_TYPE = 'damadics_msgs/msg/FaultFlag'
MEASUREMENT_TYPE = 'damadics_msgs/msg/Measurement'


class ServiceError(Exception):
    """A service could not be called; the message says why."""


class Watcher:
    """
    Watch every valve of the graph in a thread of its own.

    :param history: takes the transitions.
    :param follow: valves up to this number have all their samples taken all the time; in a larger
        fleet only those that somebody looks at.
    :param ros_args: arguments of ROS 2, from `--ros-args` on.
    """

    def __init__(self, history: History, follow: int, ros_args: Sequence[str] = ()) -> None:
        self.history = history
        self.valves: dict[str, Valve] = {name: Valve(name) for name in history.valves()}
        for event in reversed(history.latest(count=1000)):
            self.valves[event['valve']].take_event(event)
        self._follow = follow
        self._ros_args = list(ros_args)
        self._wanted: dict[str, float] = {}
        self._subscriptions: dict[tuple[str, str], Any] = {}
        self._clients: dict[str, Any] = {}
        self._calls: deque[Callable[[], None]] = deque()
        self._second = 0.0
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
        """Whether the thread runs."""
        return self._thread.is_alive()

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
        self, valve: str, service: str, kind: Any, patience: float = 5.0, **request: Any
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
        if name not in self.services:
            raise ServiceError(f'nobody serves {name}: is the node running?')
        loop = asyncio.get_running_loop()
        answer: asyncio.Future[Any] = loop.create_future()

        def settle(response: Any) -> None:
            if not answer.done():
                answer.set_result(response)

        def send() -> None:
            if name not in self._clients:
                self._clients[name] = self._node.create_client(kind, name)
            self._send(
                name,
                kind.Request(**request),
                patience,
                lambda response: loop.call_soon_threadsafe(settle, response),
            )

        self._calls.append(send)
        try:
            response = await asyncio.wait_for(answer, patience)
        except TimeoutError:
            raise ServiceError(f'no answer from {name} within {patience:g} s') from None
        return response.success, response.message

    def _send(self, name: str, request: Any, patience: float, done: Callable[[Any], None]) -> None:
        """Send a request as soon as the service is there."""
        client = self._clients[name]
        deadline = time.monotonic() + patience

        def attempt() -> None:
            if client.service_is_ready():
                client.call_async(request).add_done_callback(lambda f: done(f.result()))
            elif time.monotonic() < deadline:
                self._calls.append(attempt)

        attempt()

    def _run(self) -> None:
        try:
            rclpy.init(args=self._ros_args, signal_handler_options=rclpy.SignalHandlerOptions.NO)
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
        now = time.monotonic()
        for valve in tuple(self.valves.values()):
            valve.collect(now)
        if now - self._second >= 1.0:
            self._second = now
            for valve in tuple(self.valves.values()):
                valve.second()
        for _ in range(len(self._calls)):
            self._calls.popleft()()

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
        now = time.monotonic()
        alive = [v for v in self.valves if (v, 'fault_flag') in self._subscriptions]
        for name in alive:
            self._take_up(name, 'threshold')
            if len(alive) <= self._follow or self._wanted.get(name, 0.0) > now:
                self._take_up(name, 'measurement')
                self._take_up(name, 'estimate')
            else:
                self._drop(name, 'measurement')
                self._drop(name, 'estimate')

    def _meet(self, name: str) -> None:
        if (name, 'fault_flag') in self._subscriptions:
            return
        valve = self.valves.setdefault(name, Valve(name))

        def take_flag(message: FaultFlag) -> None:
            valve.take_flag(message, time.monotonic())

        def take_event(message: FaultEvent) -> None:
            event = _plain(valve.name, message)
            if self.history.add(event):
                valve.take_event(event)

        self._subscriptions[name, 'fault_flag'] = self._node.create_subscription(
            FaultFlag, _topic(name, 'fault_flag'), take_flag, qos.FLAG
        )
        self._subscriptions[name, 'fault_event'] = self._node.create_subscription(
            FaultEvent, _topic(name, 'fault_event'), take_event, qos.EVENTS
        )

    def _take_up(self, name: str, topic: str) -> None:
        if (name, topic) in self._subscriptions:
            return
        valve = self.valves[name]

        def lost(event: Any) -> None:
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

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            node = status.name.partition(':')[0]
            parent, _, kind = node.rpartition('/')
            if kind in ('estimator', 'detector') and (valve := self.valves.get(parent)):
                valve.diagnostics[kind] = {v.key: v.value for v in status.values}
                valve.diagnostics[kind]['Message'] = status.message
                valve.levels[kind] = status.level[0]


def _topic(valve: str, name: str) -> str:
    return f'/{valve}/{name}' if valve else f'/{name}'


def _plain(valve: str, message: FaultEvent) -> dict[str, Any]:
    """Return an event as the history keeps it."""
    row: dict[str, Any] = {'valve': valve}
    for name in ('stamp', 'onset'):
        time_of = message.header.stamp if name == 'stamp' else message.onset
        row[name] = time_of.sec * 1_000_000_000 + time_of.nanosec
    for name in (
        'transition',
        'occurrence',
        'level',
        'residual',
        'threshold',
        'ratio',
        'duration',
        'cause',
        'confidence',
        'strength',
        'text',
        'advice',
    ):
        value = getattr(message, name)
        row[name] = None if isinstance(value, float) and not math.isfinite(value) else value
    return row
