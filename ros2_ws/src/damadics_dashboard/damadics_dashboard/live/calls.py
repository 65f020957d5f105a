# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Calls of services from the page's loop, carried out in the thread of ROS 2."""

import asyncio
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Protocol

from rclpy.client import Client
from rclpy.node import Node

Field = str | float | bool | list[str]


class ServiceError(Exception):
    """A service could not be called; the message says why."""


class Answer(Protocol):
    """What every service answers."""

    success: bool
    message: str


class Service(Protocol):
    """A type of service, for which rclpy has no name."""

    @property
    def Request(self) -> Callable[..., object]:
        """Make a request of its fields."""


class Calls:
    """Requests that wait for the thread of ROS 2, and the clients that send them."""

    def __init__(self) -> None:
        self._waiting: deque[Callable[[], None]] = deque()
        self._clients: dict[str, Client] = {}

    async def call(
        self, name: str, kind: Service, patience: float, request: Mapping[str, Field]
    ) -> tuple[bool, str]:
        """
        Call a service.

        :param name: full name of the service.
        :param kind: type of the service.
        :param patience: time that the answer may take [s].
        :param request: fields of the request.
        :return: whether it was done, and the answer's sentence.
        :raises ServiceError: where nobody answers.
        """
        loop = asyncio.get_running_loop()
        answer: asyncio.Future[Answer] = loop.create_future()

        def settle(response: Answer) -> None:
            if not answer.done():
                answer.set_result(response)

        deadline = time.monotonic() + patience
        message = kind.Request(**request)

        def attempt(node: Node) -> None:
            if name not in self._clients:
                self._clients[name] = node.create_client(kind, name)
            client = self._clients[name]
            if client.service_is_ready():
                client.call_async(message).add_done_callback(
                    lambda done: loop.call_soon_threadsafe(settle, done.result())
                )
            elif time.monotonic() < deadline:
                self._waiting.append(lambda: attempt(self._node))

        self._waiting.append(lambda: attempt(self._node))
        try:
            response = await asyncio.wait_for(answer, patience)
        except TimeoutError:
            raise ServiceError(f'no answer from {name} within {patience:g} s') from None
        return response.success, response.message

    def carry_out(self, node: Node) -> None:
        """
        Send what waits; in the thread of ROS 2.

        :param node: that sends it.
        """
        self._node = node
        for _ in range(len(self._waiting)):
            self._waiting.popleft()()
