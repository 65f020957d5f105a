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

from damadics_connect.health import report, some
from damadics_connect.mqtt.broker import PAUSES, QUIET, Broker, Pulse, why
from damadics_connect.mqtt.devices import Devices
from damadics_connect.mqtt.followed_valve import FollowedValve
from damadics_connect.mqtt.json_sample import field_at, number_or_word, parsed, stamp_of
from damadics_connect.mqtt.sparkplug import NAMESPACE
from damadics_connect.publishing import Output
from damadics_connect.valve_list import ValveSource


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
        self._valves: dict[str, list[FollowedValve]] = {}
        self._all: dict[str, FollowedValve] = {}
        for number, source in enumerate(valves):
            valve = FollowedValve(source, partial(output.send, number))
            self._all[source.name] = valve
            self._valves.setdefault(source.place, []).append(valve)
        self._devices = Devices(self._valves)
        self._fault = 'not connected yet'
        self._messages = 0

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
            self._devices.end()
            await asyncio.sleep(PAUSES[min(failures, len(PAUSES) - 1)])
            failures += 1

    def report(self) -> Report:
        """Say how the broker and the valves are."""
        refused = [f'{n}: {v.refused}' for n, v in self._all.items() if v.refused]
        problems = [f'messages refused: {"; ".join(refused[:5])}'] if refused else []
        if unstamped := [name for name, valve in self._all.items() if valve.unstamped]:
            problems.append(f'no time in messages, that of arrival is taken: {some(unstamped)}')
        return report(
            self._fault,
            {name: valve.joiner for name, valve in self._all.items()},
            self._output,
            {
                'Broker': self._broker.shown,
                'Messages': self._messages,
                'Messages lost by edge nodes': self._devices.lost,
            },
            problems,
            time.monotonic_ns(),
        )

    async def _follow(self, client: Client) -> None:
        now = time.monotonic_ns()
        for valve in self._all.values():
            valve.joiner.begin(now)
        self._devices.begin()
        topics = {topic for topic in self._valves if not topic.startswith(f'{NAMESPACE}/')}
        for topic in sorted(topics | self._devices.topics()):
            await client.subscribe(topic, qos=1)
        self._fault = ''
        self._log(f'connected to {self._broker.shown}: {len(self._all)} valve(s)')
        await self._devices.ask(client, at_first=True)
        pulse = Pulse()
        jobs = [
            asyncio.create_task(job)
            for job in (self._take(client), pulse.keep(client), self._hold(client, pulse))
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
                self._devices.take(message)
                await self._devices.ask(client)
            else:
                self._take_json(message)
            self._output.flush()

    async def _hold(self, client: Client, pulse: Pulse) -> None:
        """
        Hold what does not change, for devices that tell when they die.

        The broker tells it on their behalf: what it has not said up to its last answer is not
        known, and where it is silent nothing is made up.
        """
        while True:
            await asyncio.sleep(0.05)
            self._tell_silence(pulse.silent)
            await self._devices.ask(client)
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
                stamp = self._stamp_of(valve, content)
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

    def _stamp_of(self, valve: FollowedValve, content: dict[str, object]) -> int:
        field, unit = self._stamp
        given = field_at(content, field)
        if given is None:
            valve.unstamped += 1
            return time.time_ns()
        return stamp_of(given, field, unit)
