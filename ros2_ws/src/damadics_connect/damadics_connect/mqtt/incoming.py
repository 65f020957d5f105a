# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Samples in: JSON objects and Sparkplug B devices, from the topics of a broker."""

import asyncio
import math
import time
from collections.abc import Callable, Sequence
from functools import partial

from aiomqtt import Client, Message, MqttError
from damadics_fd.core.sample import SIGNALS
from damadics_fd.ros.diagnostics import Report

from damadics_connect.health import report
from damadics_connect.joining import Joiner
from damadics_connect.mqtt.broker import PAUSES, QUIET, Broker, Pulse, why
from damadics_connect.mqtt.json_sample import (
    LATEST,
    UNITS,
    field_at,
    limited,
    number_or_word,
    parsed,
    stamp_of,
)
from damadics_connect.mqtt.sparkplug import (
    NAMESPACE,
    REBIRTH,
    number_of,
    read_payload,
    write_payload,
)
from damadics_connect.publishing import Output
from damadics_connect.source_clock import NANO
from damadics_connect.valve_list import ValveSource

AGAIN = 5.0  # s between two requests for a birth certificate


class Valve:
    """One valve: its joiner and what its messages are called."""

    def __init__(self, source: ValveSource, emit: Callable[[int, list[float]], None]) -> None:
        self.source = source
        self.joiner = Joiner(
            int(source.period * NANO),
            int(0.3 * source.period * NANO),
            tuple(signal.slot for signal in source.signals),
            emit,
        )
        self.fields = {signal.source: signal for signal in source.signals}
        self.aliases: dict[int, str] = {}
        self.alive = False
        self.refused = ''


class Incoming:
    """
    The valves whose samples come from a broker.

    :param broker: the broker.
    :param valves: in the order of the output's numbers.
    :param stamp: field and unit of the source time in JSON; the unit `iso` is a text.
    :param output: takes the samples.
    :param log: takes what a person should know.
    """

    def __init__(
        self,
        broker: Broker,
        valves: Sequence[ValveSource],
        stamp: tuple[str, str],
        output: Output,
        log: Callable[[str], None],
    ) -> None:
        self._broker = broker
        self._stamp = stamp
        self._output = output
        self._log = log
        self._valves: dict[str, list[Valve]] = {}
        self._all: dict[str, Valve] = {}
        for number, source in enumerate(valves):
            valve = Valve(source, partial(output.send, number))
            self._all[source.name] = valve
            self._valves.setdefault(source.place, []).append(valve)
        self._sequence: dict[str, int] = {}
        self._asked: dict[str, float] = {}
        self._fault = 'not connected yet'
        self._messages = self._unstamped = 0

    async def run(self) -> None:
        """Follow the broker for ever."""
        failures = 0
        while True:
            try:
                async with self._broker.client() as client:
                    failures = 0
                    await self._follow(client)
            except (MqttError, OSError) as problem:
                reason = f'{self._broker.shown}: {why(problem)}'
                if reason != self._fault:
                    self._log(f'not connected: {reason}')
                self._fault = reason
            for valve in self._all.values():
                valve.alive = False
            await asyncio.sleep(PAUSES[min(failures, len(PAUSES) - 1)])
            failures += 1

    def report(self) -> Report:
        """Say how the broker and the valves are."""
        refused = [f'{n}: {v.refused}' for n, v in self._all.items() if v.refused]
        problems = [f'messages refused: {"; ".join(refused[:5])}'] if refused else []
        if self._unstamped:
            problems.append(f'no {self._stamp[0]} in messages: the time of arrival is taken')
        return report(
            self._fault,
            {name: valve.joiner for name, valve in self._all.items()},
            self._output,
            {'Broker': self._broker.shown, 'Messages': self._messages},
            problems,
            time.monotonic_ns(),
        )

    async def _follow(self, client: Client) -> None:
        now = time.monotonic_ns()
        for valve in self._all.values():
            valve.joiner.begin(now)
        self._sequence.clear()
        topics, edges = set(), set()
        for topic in self._valves:
            space, *parts = topic.split('/')
            if space == NAMESPACE:
                group, node, device = parts
                edges.add((group, node))
                topics |= {
                    f'{NAMESPACE}/{group}/+/{node}/{device}',
                    f'{NAMESPACE}/{group}/+/{node}',
                }
            else:
                topics.add(topic)
        for topic in sorted(topics):
            await client.subscribe(topic, qos=1)
        self._fault = ''
        self._log(f'connected to {self._broker.shown}: {len(self._all)} valve(s)')
        self._asked.clear()
        for group, node in sorted(edges):  # a device at rest says nothing by itself
            await self._ask_for_birth(client, group, node)
        self._asked.clear()  # whoever was not there to hear it is asked once more
        pulse = Pulse()
        jobs = [
            asyncio.create_task(job)
            for job in (self._take(client), pulse.keep(client), self._hold(pulse))
        ]
        try:
            done, _ = await asyncio.wait(jobs, return_when=asyncio.FIRST_COMPLETED)
            for job in done:
                job.result()
        finally:
            for job in jobs:
                job.cancel()
            await asyncio.gather(*jobs, return_exceptions=True)

    async def _take(self, client: Client) -> None:
        """Take what comes."""
        async for message in client.messages:
            self._messages += 1
            if str(message.topic).startswith(f'{NAMESPACE}/'):
                await self._take_sparkplug(client, message)
            else:
                self._take_json(message)
            self._output.flush()

    async def _hold(self, pulse: Pulse) -> None:
        """
        Hold what does not change, for devices that tell when they die.

        The broker tells it on their behalf: what it has not said up to its last answer is not
        known, and where it is silent nothing is made up.
        """
        while True:
            await asyncio.sleep(0.05)
            self._tell_silence(pulse.silent)
            now = time.monotonic_ns()
            for valve in self._all.values():
                if valve.alive:
                    valve.joiner.look(now, pulse.known)
            self._output.flush()

    def _tell_silence(self, silent: bool) -> None:
        if silent and not self._fault:
            self._fault = (
                f'{self._broker.shown}: silent for {QUIET:g} s and more: broker or network is gone'
            )
            self._log(f'not connected: {self._fault}')
        elif self._fault and not silent:
            self._fault = ''
            self._log(f'connected to {self._broker.shown} again')

    def _take_json(self, message: Message) -> None:
        """Take one sample: a field that is not there is not measured."""
        if message.retain:
            return  # of a time before ours
        now = time.monotonic_ns()
        for valve in self._valves.get(str(message.topic), ()):
            try:
                content = parsed(message.payload)
                stamp = self._stamp_of(content)
                values = {name: number_or_word(field_at(content, name)) for name in valve.fields}
            except ValueError as problem:
                if valve.refused != str(problem):
                    self._log(f'{valve.source.name}: message refused: {problem}')
                valve.refused = str(problem)
                continue
            valve.refused = ''
            for name, signal in valve.fields.items():
                tally, value = valve.joiner.tally, values[name]
                key = SIGNALS[signal.slot]
                if isinstance(value, str):
                    tally.bad[key] = value
                    value = math.nan
                else:
                    tally.bad.pop(key, None)
                valve.joiner.take(signal.slot, stamp, signal.scale(value), now)

    def _stamp_of(self, content: dict[str, object]) -> int:
        field, unit = self._stamp
        given = field_at(content, field)
        if given is None:
            self._unstamped += 1
            return time.time_ns()
        return stamp_of(given, field, unit)

    async def _take_sparkplug(self, client: Client, message: Message) -> None:
        """Take one message of an edge node or one of its devices."""
        _, group, kind, node, *device = str(message.topic).split('/')
        edge = f'{NAMESPACE}/{group}/{node}'
        valves = self._valves.get(f'{edge}/{device[0]}', []) if device else []
        if kind == 'NDEATH' or (kind == 'DDEATH' and device):
            for topic, those in self._valves.items():
                if topic.startswith(f'{edge}/') and (not device or those is valves):
                    for valve in those:
                        valve.alive = False
                        valve.aliases.clear()
            return
        if kind not in ('NBIRTH', 'DBIRTH', 'NDATA', 'DDATA'):
            return
        try:
            payload = read_payload(limited(message.payload))
        except ValueError as problem:
            for valve in valves:
                valve.refused = str(problem)
            return
        last = self._sequence.get(edge)
        self._sequence[edge] = payload.seq
        lost = kind[1:] == 'DATA' and last is not None and payload.seq != (last + 1) % 256
        now = time.monotonic_ns()
        for valve in valves:
            valve.refused = ''
            if kind == 'DBIRTH':
                valve.aliases = {m.alias: m.name for m in payload.metrics if m.HasField('alias')}
                valve.joiner.begin(now)
                valve.alive = True
            lost |= not valve.alive
            self._take_metrics(valve, payload, now)
        if lost:
            await self._ask_for_birth(client, group, node)

    def _take_metrics(self, valve: Valve, payload, now: int) -> None:  # type: ignore[no-untyped-def]
        rows = []
        for metric in payload.metrics:
            name = metric.name or valve.aliases.get(metric.alias, '')
            if metric.is_historical or name not in valve.fields:
                continue
            stamp = (metric.timestamp or payload.timestamp) * UNITS['ms']
            if 0 < stamp < LATEST:
                rows.append((stamp, name, number_of(metric)))
        for stamp, name, value in sorted(rows, key=lambda row: row[0]):
            signal = valve.fields[name]
            key = SIGNALS[signal.slot]
            if math.isnan(value):
                valve.joiner.tally.bad[key] = 'null, of bad quality or no number'
            else:
                valve.joiner.tally.bad.pop(key, None)
            valve.joiner.source_clock(payload.timestamp * UNITS['ms'] or stamp, now)
            valve.joiner.take(signal.slot, stamp, signal.scale(value), now)

    async def _ask_for_birth(self, client: Client, group: str, node: str) -> None:
        """Ask an edge node for its names and values, as we have missed them."""
        key, now = f'{group}/{node}', time.monotonic()
        if now - self._asked.get(key, -math.inf) < AGAIN:
            return
        self._asked[key] = now
        request = write_payload({REBIRTH: True}, time.time_ns() // UNITS['ms'], None)
        await client.publish(f'{NAMESPACE}/{group}/NCMD/{node}', request, qos=0)
