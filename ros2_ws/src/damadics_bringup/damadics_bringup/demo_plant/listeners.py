# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Who hears of the fault in the demonstration: one listener for each way out."""

import asyncio
import json
import time
from collections.abc import Callable

from aiomqtt import Client as MqttClient
from aiomqtt import MqttError
from asyncua import Client as OpcuaClient
from asyncua import ua

Heard = Callable[[str, str], None]  # way out, valve
PAUSE = 0.5  # s before a listener tries again


class Journal:
    """The first instant at which each way out has told of a valve's alarm."""

    def __init__(self) -> None:
        self.at: dict[str, float] = {}
        self.states: dict[str, str] = {}
        self.armed = False

    def alarm(self, way: str, valve: str) -> None:
        """Note that an alarm of a valve was heard."""
        if self.armed and valve.lower().endswith('103'):
            self.at.setdefault(way, time.time())


async def again_and_again(listen: Callable[[], object]) -> None:
    """
    Keep a listener running until what it listens to is there.

    :param listen: makes the coroutine.
    """
    while True:
        try:
            await listen()  # type: ignore[misc]
        except (OSError, MqttError, ua.UaError, TimeoutError, asyncio.IncompleteReadError):
            await asyncio.sleep(PAUSE)


async def server_sent_events(port: int, journal: Journal) -> None:
    """
    Listen to the event stream, as a browser does.

    :param port: of the HTTP connector.
    :param journal: takes what was heard.
    """
    reader, writer = await asyncio.open_connection('127.0.0.1', port)
    try:
        writer.write(
            b'GET /api/events HTTP/1.1\r\nHost: 127.0.0.1\r\nLast-Event-ID: 0\r\n'
            b'Accept: text/event-stream\r\n\r\n'
        )
        await writer.drain()
        kind = ''
        while line := (await reader.readline()).decode().strip('\r\n') or not reader.at_eof():
            if not isinstance(line, str):
                continue
            if line.startswith('event: '):
                kind = line.removeprefix('event: ')
            elif line.startswith('data: '):
                content = json.loads(line.removeprefix('data: '))
                if kind == 'valve':
                    journal.states[content['valve']] = content['state']
                elif content['transition'] == 'raised':
                    journal.alarm('server-sent event', content['valve'])
    finally:
        writer.close()
    raise OSError('the stream has ended')


async def mqtt_messages(port: int, journal: Journal) -> None:
    """
    Listen to the broker.

    :param port: of the broker.
    :param journal: takes what was heard.
    """
    async with MqttClient('127.0.0.1', port) as client:
        await client.subscribe('damadics/+/event', qos=1)
        async for message in client.messages:
            content = json.loads(bytes(message.payload))
            if content['transition'] == 'raised':
                journal.alarm('MQTT message', content['valve'])


class ConditionListener:
    """
    Takes conditions of the OPC UA server.

    :param journal: takes what was heard.
    """

    def __init__(self, journal: Journal) -> None:
        self._journal = journal

    def event_notification(self, event: object) -> None:
        """Take one event."""
        if getattr(event, 'ActiveState/Id', False):
            self._journal.alarm('OPC UA condition', str(getattr(event, 'SourceName', '')))


async def conditions(port: int, journal: Journal) -> None:
    """
    Listen to the conditions of our OPC UA server.

    :param port: of the server.
    :param journal: takes what was heard.
    """
    async with OpcuaClient(f'opc.tcp://127.0.0.1:{port}') as client:
        subscription = await client.create_subscription(100, ConditionListener(journal))
        await subscription.subscribe_alarms_and_conditions(evtypes=ua.ObjectIds.AlarmConditionType)
        while True:
            await client.check_connection()
            await asyncio.sleep(1.0)


async def webhook(port: int, journal: Journal) -> None:
    """
    Be the webhook that notifications go to.

    :param port: to listen on.
    :param journal: takes what was heard.
    """

    async def take(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = (await reader.readuntil(b'\r\n\r\n')).decode('latin-1').lower()
        length = int(head.partition('content-length:')[2].split('\r\n')[0] or 0)
        body = await reader.readexactly(length)
        if b'LV-103' in body:
            journal.alarm('notification', 'lv103')
        writer.write(b'HTTP/1.1 200 OK\r\nContent-Length: 0\r\nConnection: close\r\n\r\n')
        await writer.drain()
        writer.close()

    server = await asyncio.start_server(take, '127.0.0.1', port)
    async with server:
        await server.serve_forever()
