# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sparkplug B edge nodes that behave as nodes do and as they should not."""

import asyncio
import contextlib
import math
import time

import pytest

pytest.importorskip('aiomqtt')
from aiomqtt import Message
from damadics_connect.mqtt.incoming import Incoming
from damadics_connect.mqtt.sparkplug import REBIRTH, Payload, read_payload, write_payload
from damadics_connect.valve_list import Signal, ValveSource
from damadics_fd.bag.mapping import Scale

EDGE = 'spBv1.0/G/{}/N'
SIGNALS = (Signal(0, 'SP', Scale()), Signal(1, 'POS', Scale()))


class Samples:
    """Keeps what it is sent."""

    samples = 0
    zero: frozenset[str] = frozenset()

    def __init__(self):
        self.got = []

    def send(self, valve, stamp, values):
        self.got.append((stamp, values[:2]))

    def flush(self):
        """Keep it."""


class Broker:
    """A broker in this process that has one client."""

    shown = 'broker:1883'

    def __init__(self):
        self._queue = asyncio.Queue()
        self.births_asked = 0
        self.sequence = -1

    @contextlib.asynccontextmanager
    async def client(self, will=None):
        yield self

    async def subscribe(self, topic, qos=0):
        """Send everything."""

    unsubscribe = subscribe

    async def publish(self, topic, payload, qos=0, retain=False):
        assert topic == EDGE.format('NCMD')
        assert read_payload(payload).metrics[0].name == REBIRTH
        self.births_asked += 1

    @property
    def messages(self):
        async def each():
            while True:
                yield await self._queue.get()
                self._queue.task_done()

        return each()

    async def send(self, kind, payload, retain=False):
        """Have a message taken."""
        topic = EDGE.format(kind) + '/D' * kind.startswith('D')
        self._queue.put_nowait(Message(topic, payload, 0, retain, 1, None))
        await self._queue.join()

    async def birth(self, number=0, retain=False, **values):
        """Have node and device born."""
        await self.send('NBIRTH', write_payload({'bdSeq': number}, now(), 0), retain)
        self.sequence = 1
        payload = write_payload({'SP': 0.5, 'POS': 0.5} | values, now(), 1)
        await self.send('DBIRTH', payload, retain)

    async def data(self, **values):
        """Have the device tell values."""
        self.sequence += 1
        await self.send('DDATA', write_payload(values, now(), self.sequence % 256))


def now():
    return time.time_ns() // 1_000_000


def with_broker(scenario):
    """Run a scenario with broker, samples and connector."""

    async def whole():
        broker, samples = Broker(), Samples()
        valve = ValveSource('lv1', 'LV-1', 0.05, SIGNALS, 'spBv1.0/G/N/D')
        incoming = Incoming(broker, [valve], ('ts', 'ms'), samples, lambda line: None)
        task = asyncio.create_task(incoming.run())
        try:
            await eventually(lambda: broker.births_asked == 1)
            await scenario(broker, samples, incoming)
        finally:
            task.cancel()

    asyncio.run(whole())


async def eventually(condition):
    """Wait until it holds, as long as a busy machine may take."""
    end = time.monotonic() + 30.0
    while not condition():
        assert time.monotonic() < end, 'it never came true'
        await asyncio.sleep(0.01)


def test_a_death_of_an_earlier_connection_is_not_that_of_the_present_one():
    """The broker sends the will of a connection that it lost when the node is back already."""

    async def scenario(broker, samples, incoming):
        await broker.birth(number=7)
        await broker.send('NDEATH', write_payload({'bdSeq': 6}, now(), None))
        held = len(samples.got) + 3
        await eventually(lambda: len(samples.got) >= held)

    with_broker(scenario)


@pytest.mark.parametrize('number', [7, None])
def test_whoever_is_said_to_be_dead_is_asked(number):
    """A node at rest that lives in spite of it would be silent for ever."""

    async def scenario(broker, samples, incoming):
        await broker.birth(number=7)
        before = broker.births_asked
        death = {} if number is None else {'bdSeq': number}
        await broker.send('NDEATH', write_payload(death, now(), None))
        await eventually(lambda: broker.births_asked > before)
        held = len(samples.got)
        await asyncio.sleep(0.3)
        assert len(samples.got) == held, 'nothing is made up for the dead'
        await broker.birth(number=8)
        await eventually(lambda: len(samples.got) > held)

    with_broker(scenario)


def test_a_birth_that_the_broker_has_kept_says_nothing():
    async def scenario(broker, samples, incoming):
        await broker.birth(retain=True)
        await asyncio.sleep(0.3)
        assert samples.got == []
        await broker.birth()
        await eventually(lambda: samples.got)

    with_broker(scenario)


def test_values_without_a_time_are_taken_when_they_come_and_that_is_told():
    async def scenario(broker, samples, incoming):
        born = Payload(seq=0)
        await broker.send('NBIRTH', born.SerializeToString())
        born = Payload(seq=1)
        for name in ('SP', 'POS'):
            born.metrics.add(name=name, datatype=10).double_value = 0.25
        await broker.send('DBIRTH', born.SerializeToString())
        await eventually(lambda: samples.got)
        stamp, values = samples.got[0]
        assert values == [0.25, 0.25] and abs(stamp - time.time_ns()) < 60e9
        assert 'no time in messages, that of arrival is taken: lv1' in incoming.report()[1]

    with_broker(scenario)


def test_an_alias_that_no_birth_has_told_asks_for_one():
    async def scenario(broker, samples, incoming):
        await broker.birth()
        before = broker.births_asked
        data = Payload(timestamp=now(), seq=2)
        data.metrics.add(alias=99, datatype=10).double_value = 0.25
        await broker.send('DDATA', data.SerializeToString())
        await eventually(lambda: broker.births_asked > before)

    with_broker(scenario)


def test_a_second_loss_soon_after_the_first_is_mended_too(monkeypatch):
    """What was lost would else be held as it was before."""
    from damadics_connect.mqtt import devices

    monkeypatch.setattr(devices, 'AGAIN', 0.5)

    async def scenario(broker, samples, incoming):
        await broker.birth()
        for times in (2, 3):
            broker.sequence += 1  # nobody has got it
            await broker.data(SP=0.25 * times)
            if times == 2:
                await eventually(lambda: broker.births_asked == 2)
        await eventually(lambda: broker.births_asked == 3)
        _, _, values = incoming.report()
        assert values['Messages lost by edge nodes'] == 2

    with_broker(scenario)


def test_a_node_that_numbers_nothing_has_lost_nothing():
    async def scenario(broker, samples, incoming):
        await broker.birth()
        before = broker.births_asked
        for n in range(5):
            await broker.send('DDATA', write_payload({'POS': 0.01 * n}, now(), None))
        _, _, values = incoming.report()
        assert values['Messages lost by edge nodes'] == 0
        assert broker.births_asked == before

    with_broker(scenario)


def test_a_node_that_is_born_again_has_no_device_until_that_is_born():
    async def scenario(broker, samples, incoming):
        await broker.birth()
        await eventually(lambda: len(samples.got) > 3)  # values are held
        await broker.send('NBIRTH', write_payload({'bdSeq': 1}, now(), 0))
        held = len(samples.got)
        await asyncio.sleep(0.3)
        assert len(samples.got) == held

    with_broker(scenario)


def test_null_historical_and_beyond_all_measure():
    async def scenario(broker, samples, incoming):
        await broker.birth()
        await broker.data(SP=math.nan)
        await broker.data(POS=0.75)
        await eventually(lambda: any(v[1] == 0.75 for _, v in samples.got))
        values = next(v for _, v in samples.got if v[1] == 0.75)
        assert math.isnan(values[0])
        old = Payload(timestamp=now(), seq=4)
        metric = old.metrics.add(name='POS', timestamp=now() - 10_000, datatype=10)
        metric.is_historical, metric.double_value = True, 0.125
        await broker.send('DDATA', old.SerializeToString())
        late = Payload(timestamp=now(), seq=5)
        late.metrics.add(name='POS', timestamp=2**63, datatype=10).double_value = 0.0625
        await broker.send('DDATA', late.SerializeToString())
        assert 'a time beyond all measure' in incoming.report()[1]
        held = len(samples.got) + 3
        await eventually(lambda: len(samples.got) >= held)
        assert {v[1] for _, v in samples.got} == {0.5, 0.75}

    with_broker(scenario)
