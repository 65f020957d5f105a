# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a node has made: made together, released together; an error in a callback ends nothing."""

import math
import time
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.timer import Timer

from damadics_fd.ros.process.rounds import Rounds
from damadics_fd.ros.process.status_board import StatusBoard

REQUESTS = QoSProfile(depth=1000)  # that may wait for their answer
TOLD_EVERY = 10.0  # s
ASKED_EVERY = 0.1  # s

M = TypeVar('M')
P = ParamSpec('P')
Request = TypeVar('Request')
Response = TypeVar('Response')
Result = TypeVar('Result')


class Listeners:
    """
    How many subscribe to a topic of this node, as of a tenth of a second ago at most.

    The middleware is asked, but not for every sample, which would cost a tenth of it. While its
    events of matched publishers were used with rclpy's events executor, messages were lost and a
    process died at its end of a damaged heap.

    :param publisher: of the topic.
    """

    def __init__(self, publisher: Publisher) -> None:
        self._ask = publisher.handle.get_subscription_count
        self._asked, self._count = -math.inf, 0  # when [s], and the answer

    @property
    def count(self) -> int:
        """How many there are; who has just come is known within `ASKED_EVERY`."""
        now = time.monotonic()
        if now - self._asked >= ASKED_EVERY:
            self._asked, self._count = now, int(self._ask())
        return self._count


class Entities:
    """
    Publishers, subscriptions, services and timers of a node.

    An exception that leaves a callback would end the process, with every other node in it. It is
    logged, stands in `problem` until the callback succeeds, and the node goes on. A callback that
    was queued when its entity was released does nothing.

    :param node: the node.
    :param rounds: of the process, where many nodes share one.
    """

    def __init__(self, node: Node, rounds: Rounds | None = None) -> None:
        self._node = node
        self._rounds = rounds or Rounds()
        self._failing: dict[str, str] = {}
        self._undo: list[Callable[[], object]] = []
        self._alive = True

    @property
    def problem(self) -> str:
        """What a callback has failed with, '' where all is well."""
        return next(iter(self._failing.values()), '')

    def fails(self, name: str) -> bool:
        """
        Tell whether a callback raised when it was called last.

        :param name: topic or service.
        :return: True if so.
        """
        return name in self._failing

    def publisher(self, kind: type, topic: str, profile: QoSProfile) -> Publisher:
        """
        Make a publisher.

        :param kind: type of its messages.
        :param topic: its topic.
        :param profile: quality of service.
        :return: the publisher.
        """
        made = self._node.create_publisher(kind, topic, profile)
        self._undo.append(lambda: self._node.destroy_publisher(made))
        return made

    def publisher_on_request(
        self, kind: type, topic: str, profile: QoSProfile
    ) -> tuple[Callable[[bytes], None], Listeners]:
        """
        Make a publisher of serialised messages that is used while somebody subscribes.

        :param kind: type of its messages.
        :param topic: its topic.
        :param profile: quality of service.
        :return: sends a message, and how many listen to it.
        """
        made = self.publisher(kind, topic, profile)
        send: Callable[[bytes], None] = made.handle.publish_raw  # type: ignore[attr-defined]
        return send, Listeners(made)

    def subscription(
        self,
        kind: type,
        topic: str,
        take: Callable[[M], None],
        profile: QoSProfile,
        events: SubscriptionEventCallbacks | None = None,
        *,
        raw: bool = False,
    ) -> Callable[[], None]:
        """
        Make a subscription.

        :param kind: type of its messages.
        :param topic: its topic.
        :param take: called with each message.
        :param profile: quality of service.
        :param events: of the middleware.
        :param raw: `take` gets the serialised message.
        :return: ends it before all else is released.
        """
        ended = False

        def taken(message: M) -> None:  # as `contained`, for one argument: half the cost
            if self._alive and not ended:
                try:
                    take(message)
                except Exception as error:
                    self._failed(topic, error)
                else:
                    if self._failing:
                        self._failing.pop(topic, None)

        made = self._node.create_subscription(
            kind, topic, taken, profile, event_callbacks=events, raw=raw
        )

        def undo() -> None:
            self._node.destroy_subscription(made)

        def end() -> None:
            nonlocal ended
            ended = True
            self._undo.remove(undo)
            undo()

        self._undo.append(undo)
        return end

    def contained(self, name: str, take: Callable[P, None]) -> Callable[P, None]:
        """
        Contain the errors of a callback, as those of a subscription.

        :param name: by which `fails` tells of them.
        :param take: the callback.
        :return: what may be called in its place at any time.
        """

        def taken(*given: P.args, **named: P.kwargs) -> None:
            if self._alive:
                try:
                    take(*given, **named)
                except Exception as error:
                    self._failed(name, error)
                else:
                    if self._failing:
                        self._failing.pop(name, None)

        return taken

    def on_release(self, undo: Callable[[], object]) -> None:
        """
        Have something undone when the entities are released.

        :param undo: called once.
        """
        self._undo.append(undo)

    def service(
        self, kind: type, name: str, serve: Callable[[Request, Response], Response]
    ) -> None:
        """
        Make a service; where it fails, its answer is what an untouched response says: no success.

        :param kind: its type.
        :param name: its name.
        :param serve: fills in and returns the response.
        """

        def served(request: Request, response: Response) -> Response:
            try:
                return serve(request, response) if self._alive else response
            except Exception as error:
                self._failed(name, error)
                return response

        made = self._node.create_service(kind, name, served, qos_profile=REQUESTS)
        self._undo.append(lambda: self._node.destroy_service(made))

    def timer(self, period: float, act: Callable[[], object]) -> Timer:
        """
        Make a timer of wall time, which works while simulated time stands still.

        :param period: of its calls [s].
        :param act: called without arguments.
        :return: the timer.
        """
        made = self._node.create_timer(
            period, self._acting(act), clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        self._undo.append(lambda: self._node.destroy_timer(made))
        return made

    def every(self, period: float, act: Callable[[], object]) -> None:
        """
        Have something done again and again, as by `timer`; the nodes of a process share one.

        :param period: of its calls [s].
        :param act: called without arguments.
        """
        self._undo.append(self._rounds.at(period).join(self._node, self._acting(act)))

    def board(self, status: Callable[[], DiagnosticStatus]) -> StatusBoard:
        """
        Have a status published once a second of wall time, with those of the whole process.

        :param status: returns the present one.
        :return: publishes it at once.
        """
        told = self._acting(status)
        self._undo.append(self._rounds.board.join(self._node, told))
        return self._rounds.board

    def _acting(self, act: Callable[[], Result]) -> Callable[[], Result | None]:
        """Contain the errors of what is called again and again."""
        name = f'timer {act.__qualname__}'

        def acted() -> Result | None:
            if not self._alive:
                return None
            try:
                result = act()
            except Exception as error:
                self._failed(name, error)
                return None
            self._failing.pop(name, None)
            return result

        return acted

    def release(self) -> None:
        """Destroy all that was made; what is still queued for it does nothing."""
        self._alive = False
        while self._undo:
            self._undo.pop()()

    def _failed(self, name: str, error: Exception) -> None:
        place = error.__traceback__
        while place and place.tb_next:
            place = place.tb_next
        where = f' ({place.tb_frame.f_code.co_name}, line {place.tb_lineno})' if place else ''
        text = f'internal error in {name}: {type(error).__name__}: {error}{where}'
        self._failing[name] = text
        self._node.get_logger().error(text, throttle_duration_sec=TOLD_EVERY)
