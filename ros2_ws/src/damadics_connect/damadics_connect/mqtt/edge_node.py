# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Judgements out as a Sparkplug B edge node: one device per valve, births, data and deaths."""

import asyncio
import time
from collections.abc import Callable

from aiomqtt import Client, MqttError, Will

from damadics_connect.judgement import Judgement
from damadics_connect.mqtt.broker import PAUSES, Broker, why
from damadics_connect.mqtt.sparkplug import (
    NAMESPACE,
    REBIRTH,
    PayloadError,
    read_payload,
    write_payload,
)

REPEAT = 1.0  # s between two looks at the valves
SEQUENCE = 256


class EdgeNode:
    """
    An edge node.

    :param broker: the broker.
    :param group: group identifier.
    :param node: edge node identifier.
    :param valves: what is known of the valves, by name.
    :param log: takes what a person should know.
    """

    def __init__(
        self,
        broker: Broker,
        group: str,
        node: str,
        valves: dict[str, Judgement],
        log: Callable[[str], None],
    ) -> None:
        self._broker = broker
        self._group = group
        self._node = node
        self._valves = valves
        self._log = log
        self._birth = 0
        self._sequence = 0
        self._rebirth = False
        self._sent: dict[str, dict[str, str | float | bool | int]] = {}

    async def run(self) -> None:
        """Publish for ever."""
        failures = 0
        while True:
            death = write_payload({'bdSeq': self._birth}, _now(), None)
            will = Will(self._topic('NDEATH'), death, qos=1, retain=False)
            try:
                async with self._broker.client(will) as client:
                    failures = 0
                    await client.subscribe(self._topic('NCMD'), qos=1)
                    listening = asyncio.create_task(self._listen(client))
                    try:
                        await self._publish(client, listening)
                    finally:
                        listening.cancel()
                        task = asyncio.current_task()
                        if task is not None and task.cancelling():
                            await client.publish(self._topic('NDEATH'), death, qos=1)
            except (MqttError, OSError) as problem:
                if not failures:
                    self._log(f'Sparkplug B: {self._broker.shown}: {why(problem)}')
            self._birth = (self._birth + 1) % SEQUENCE
            await asyncio.sleep(PAUSES[min(failures, len(PAUSES) - 1)])
            failures += 1

    async def _listen(self, client: Client) -> None:
        async for message in client.messages:
            try:
                payload = read_payload(bytes(message.payload)[:100_000])
            except PayloadError:
                continue
            self._rebirth |= any(m.name == REBIRTH and m.boolean_value for m in payload.metrics)

    async def _publish(self, client: Client, listening: asyncio.Task[None]) -> None:
        self._rebirth = True
        while True:
            if listening.done():
                listening.result()
            if self._rebirth:
                self._rebirth = False
                self._sequence = 0
                self._sent.clear()
                born: dict[str, str | float | bool | int] = {'bdSeq': self._birth, REBIRTH: False}
                await self._send(client, 'NBIRTH', '', born)
            for name, judgement in sorted(self._valves.items()):
                device = name.replace('/', '_')
                metrics = metrics_of(judgement)
                before = self._sent.get(name)
                if before is None:
                    await self._send(client, 'DBIRTH', device, metrics)
                elif changed := {k: v for k, v in metrics.items() if not _same(v, before[k])}:
                    await self._send(client, 'DDATA', device, changed)
                self._sent[name] = metrics
            await asyncio.sleep(REPEAT / 4.0)

    async def _send(
        self,
        client: Client,
        kind: str,
        device: str,
        metrics: dict[str, str | float | bool | int],
    ) -> None:
        data = write_payload(metrics, _now(), self._sequence)
        self._sequence = (self._sequence + 1) % SEQUENCE
        await client.publish(self._topic(kind, device), data, qos=0)

    def _topic(self, kind: str, device: str = '') -> str:
        below = f'/{device}' if device else ''
        return f'{NAMESPACE}/{self._group}/{kind}/{self._node}{below}'


def metrics_of(judgement: Judgement) -> dict[str, str | float | bool | int]:
    """
    Return the metrics of a valve.

    :param judgement: of the valve.
    :return: values by name; numbers that are not known are NaN.
    """
    return {
        'State': judgement.state,
        'DeviceHealth': judgement.ne107,
        'Fault': judgement.fault,
        'Acknowledged': judgement.acknowledged,
        'Residual': float(judgement.residual),
        'Limit': float(judgement.threshold),
        'Ratio': float(judgement.ratio),
        'Occurrence': int(judgement.occurrence),
        'Cause': judgement.cause,
        'Confidence': float(judgement.confidence),
        'Text': judgement.text,
        'SourceTime': int(judgement.stamp),
    }


def _same(a: str | float | bool | int, b: str | float | bool | int) -> bool:
    return a == b or (a != a and b != b)


def _now() -> int:
    return time.time_ns() // 1_000_000
