# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Server-sent events: every change of state and every transition, to everybody who listens."""

import asyncio
import contextlib
import json
import time
from collections import deque
from collections.abc import AsyncIterator, Mapping

from damadics_connect.judgement import Judgement, Transition, as_json

KEPT = 1000  # messages for who comes back with Last-Event-ID
WAITING = 1000  # messages for one listener who does not take them
BEAT = 1.0  # s between two signs of life

Message = tuple[int, str, str]  # number, name, data


class Stream:
    """
    Hands messages from the thread of ROS 2 to listeners in the event loop.

    :param loop: of the listeners.
    :param valves: the present judgements by valve.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, valves: Mapping[str, Judgement]) -> None:
        self._loop = loop
        self._valves = valves
        # beyond all that a process of before has given out: who was there goes on, and misses none
        self._number = time.time_ns() // 1_000_000
        self._kept: deque[Message] = deque(maxlen=KEPT)
        self._last: dict[str, int] = {}  # number of the last message on each valve's state
        self._listeners: set[asyncio.Queue[Message | None]] = set()

    def state(self, judgement: Judgement) -> None:
        """Send a valve's new state; call it from any thread."""
        self._send('valve', json.dumps(as_json(judgement)), judgement.valve)

    def event(self, event: Transition) -> None:
        """Send a transition; call it from any thread."""
        self._send('event', json.dumps(as_json(event)))

    def close(self) -> None:
        """End all listeners."""
        for queue in self._listeners:
            with contextlib.suppress(asyncio.QueueFull):
                queue.put_nowait(None)

    async def listen(self, after: int | None) -> AsyncIterator[str]:
        """
        Yield messages as the standard for server-sent events writes them.

        Who comes for the first time is told the present state of every valve, who comes again
        what was missed.

        :param after: number of the last message that the listener has; None: it comes first.
        :return: an endless iterator; a comment every second says that the connection lives.
        """
        queue: asyncio.Queue[Message | None] = asyncio.Queue(WAITING)
        missed = self._missed(after)
        self._listeners.add(queue)
        try:
            yield 'retry: 1000\n\n'
            for message in missed:
                yield _written(message)
            while True:
                try:
                    message_or_end = await asyncio.wait_for(queue.get(), BEAT)
                except TimeoutError:
                    yield ': alive\n\n'
                    continue
                if message_or_end is None:
                    return
                yield _written(message_or_end)
        finally:
            self._listeners.discard(queue)

    def _missed(self, after: int | None) -> list[Message]:
        if after is not None and after > self._number:
            after = 0  # of a process of before, whose clock was ahead
        kept = {} if after is None else {m[0]: m for m in self._kept if m[0] > after}
        present = {
            number: (number, 'valve', json.dumps(as_json(self._valves[valve])))
            for valve, number in self._last.items()
            if number > (after or 0)
        }
        return [message for _, message in sorted((present | kept).items())]

    def _send(self, name: str, data: str, state_of: str = '') -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended before the node
            self._loop.call_soon_threadsafe(self._spread, name, data, state_of)

    def _spread(self, name: str, data: str, state_of: str) -> None:
        self._number += 1
        message = (self._number, name, data)
        self._kept.append(message)
        if state_of:
            self._last[state_of] = self._number
        for queue in list(self._listeners):
            try:
                queue.put_nowait(message)
            except asyncio.QueueFull:
                self._listeners.discard(queue)  # it comes back with Last-Event-ID
                queue.get_nowait()
                queue.put_nowait(None)


def _written(message: Message) -> str:
    number, name, data = message
    return f'id: {number}\nevent: {name}\ndata: {data}\n\n'
