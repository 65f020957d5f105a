# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Do what a person outside ROS 2 asks for: acknowledge, reset, shelve, partial strokes."""

import asyncio
from typing import NamedTuple

from damadics_fd.core.text import COMMENT, NAME, plain
from damadics_msgs.srv import (
    Acknowledge,
    FleetAcknowledge,
    FleetReset,
    FleetShelve,
    PartialStroke,
    ResetAlarm,
    Shelve,
)
from rclpy.client import Client
from rclpy.node import Node

from damadics_connect.watch import Watch, namespace_of, topic_of

KINDS = {
    'acknowledge': (Acknowledge, FleetAcknowledge),
    'reset': (ResetAlarm, FleetReset),
    'shelve': (Shelve, FleetShelve),
    'partial_stroke': (PartialStroke, None),  # only a detector of its own follows the stem
}
PATIENCE = 5.0  # s for an answer
LONGEST_SHELF = 30 * 86_400.0  # s


class Answer(NamedTuple):
    """Whether it was done, and the sentence of who did it."""

    done: bool
    text: str


class Actions:
    """
    Call the services of valves and fleets.

    :param node: that calls.
    :param watch: knows which services there are.
    """

    def __init__(self, node: Node, watch: Watch) -> None:
        self._node = node
        self._watch = watch
        self._clients: dict[str, Client] = {}

    async def do(
        self,
        action: str,
        valve: str,
        user: str,
        comment: str = '',
        *,
        occurrence: int = 0,
        duration: float = 0.0,
        amplitude: float = 0.0,
        count: int = 0,
    ) -> Answer:
        """
        Have something done to a valve's alarm.

        :param action: one of KINDS.
        :param valve: its namespace.
        :param user: who wants it.
        :param comment: why.
        :param occurrence: number of the alarm to acknowledge, 0: the present one.
        :param duration: of a shelf [s], 0: end it.
        :param amplitude: of partial strokes, to each side, share of full travel.
        :param count: of partial strokes, 0: end them.
        :return: what was done, or why not.
        """
        single, fleet = KINDS[action]
        own = topic_of(valve, action)
        name, kind = own, single
        if own not in self._watch.services and fleet is not None:
            name, kind = f'/fleet/{action}', fleet
        if name not in self._watch.services:
            return Answer(False, f'nobody serves {own}: is the detector running?')
        request = kind.Request(user=plain(user, NAME), comment=plain(comment, COMMENT))
        if kind is fleet:
            request.valves = [namespace_of(valve) or '/']
        if action == 'acknowledge':
            request.occurrence = occurrence
        elif action == 'shelve':
            request.duration = min(max(duration, 0.0), LONGEST_SHELF)
        elif action == 'partial_stroke':
            request.amplitude, request.count = amplitude, count
        if name not in self._clients:
            self._clients[name] = self._node.create_client(kind, name)
        client = self._clients[name]
        loop = asyncio.get_running_loop()
        answer: asyncio.Future[Answer] = loop.create_future()

        def settle(result: Answer) -> None:
            if not answer.done():
                answer.set_result(result)

        for _ in range(int(PATIENCE / 0.05)):
            if client.service_is_ready():
                break
            await asyncio.sleep(0.05)
        client.call_async(request).add_done_callback(
            lambda future: loop.call_soon_threadsafe(
                settle, Answer(future.result().success, plain(future.result().message, COMMENT))
            )
        )
        try:
            return await asyncio.wait_for(answer, PATIENCE)
        except TimeoutError:
            return Answer(False, f'no answer from {name} within {PATIENCE:g} s')
