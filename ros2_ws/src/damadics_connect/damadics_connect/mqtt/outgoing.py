# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Judgements out, to the topics of a broker.

`PREFIX/status` says `monitored` once a second while we are connected; it is retained, and the
broker itself turns it to `not_monitored` when it loses us. A broker whose network is gone notices
that after many seconds, and one that went down together with us never: a status that is not said
again for two seconds counts no more. `PREFIX/VALVE/state` is retained: the present judgement.
`PREFIX/VALVE/event` carries each transition in order, also those of a time without a broker.
"""

import asyncio
import json
import time
from collections import deque
from collections.abc import Callable

from aiomqtt import Client, MqttError, Will

from damadics_connect.judgement import Judgement, Transition, as_json
from damadics_connect.mqtt.broker import PAUSES, Broker, Pulse, why

WAITING = 10_000  # transitions kept while there is no broker
LOST, PRESENT = b'not_monitored', b'monitored'
REPEAT = 1.0  # s between two states of a valve whose running numbers alone have changed


class Outgoing:
    """
    Publishes judgements.

    :param broker: the broker.
    :param prefix: of the topics.
    :param valves: what is known of the valves, by name.
    :param log: takes what a person should know.
    """

    def __init__(
        self,
        broker: Broker,
        prefix: str,
        valves: dict[str, Judgement],
        log: Callable[[str], None],
    ) -> None:
        self._broker = broker
        self._prefix = prefix
        self._valves = valves
        self._log = log
        self._loop = asyncio.get_running_loop()
        self._events: deque[Transition] = deque(maxlen=WAITING)
        self._changed: set[str] = set()
        self._wake = asyncio.Event()
        self.connected = False
        self.fault = 'not connected yet'
        self.published = 0

    def state(self, judgement: Judgement) -> None:
        """Have a valve's state published; call it from any thread."""
        self._later(lambda: self._changed.add(judgement.valve))

    def event(self, event: Transition) -> None:
        """Have a transition published; call it from any thread."""
        self._later(lambda: self._events.append(event))

    async def run(self) -> None:
        """Publish for ever."""
        failures = 0
        status = f'{self._prefix}/status'
        will = Will(status, LOST, qos=1, retain=True)
        while True:
            try:
                async with self._broker.client(will) as client:
                    failures = 0
                    self._changed.update(self._valves)
                    self.connected, self.fault = True, ''
                    self._log(f'publishing to {self._broker.shown}: {self._prefix}/...')
                    pulse = asyncio.create_task(Pulse().keep(client))
                    try:
                        await self._publish(client, pulse)
                    except asyncio.CancelledError:
                        await client.publish(status, LOST, qos=1, retain=True)
                        raise
                    finally:
                        pulse.cancel()
                        await asyncio.gather(pulse, return_exceptions=True)
            except (MqttError, OSError) as problem:
                reason = f'{self._broker.shown}: {why(problem)}'
                if reason != self.fault:
                    self._log(f'not connected: {reason}')
                self.fault = reason
            self.connected = False
            await asyncio.sleep(PAUSES[min(failures, len(PAUSES) - 1)])
            failures += 1

    async def _publish(self, client: Client, pulse: asyncio.Task[None]) -> None:
        due = 0.0
        while True:
            if pulse.done():
                pulse.result()  # the broker has dropped us, though there was nothing to publish
            if (now := time.monotonic()) >= due:
                due = now + REPEAT
                await client.publish(f'{self._prefix}/status', PRESENT, qos=1, retain=True)
            while self._events:
                event = self._events[0]
                topic = f'{self._prefix}/{event.valve}/event'
                await client.publish(topic, json.dumps(as_json(event)), qos=1)
                self._events.popleft()  # not before the broker has it
                self.published += 1
            for name in sorted(self._changed):
                self._changed.discard(name)
                state = json.dumps(as_json(self._valves[name]))
                await client.publish(f'{self._prefix}/{name}/state', state, qos=1, retain=True)
                self.published += 1
            self._wake.clear()
            try:
                await asyncio.wait_for(self._wake.wait(), REPEAT)
            except TimeoutError:
                self._changed.update(self._valves)

    def _later(self, what: Callable[[], None]) -> None:
        def now() -> None:
            what()
            self._wake.set()

        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(now)
