# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where the broker is and how it is entered."""

import asyncio
import errno
import ssl
import time
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlsplit

from aiomqtt import Client, Will
from aiomqtt.exceptions import MqttConnectError

from damadics_connect.addresses import address_problem
from damadics_connect.settings import Secret, Section
from damadics_connect.source_clock import NANO

SCHEMES = {'mqtt': 1883, 'mqtts': 8883}
KEEP_ALIVE = 2  # s: a network that is gone is known within three of them
PATIENCE = 5.0  # s for an answer
QUIET = 1.6  # s without an answer after which the broker counts as gone
PULSE = 0.25  # s between an answer and the next question
NOWHERE = 'damadics/nowhere'  # a topic that nobody has subscribed to
PAUSES = (0.2, 0.5, 1.0, 2.0, 5.0)  # s before a lost broker is tried again
REMEDIES = {
    4: 'wrong user name or password',
    5: 'wrong user name or password',
    134: 'wrong user name or password',
    135: 'wrong user name or password',
}


class Broker(NamedTuple):
    """A broker and who we are there."""

    host: str
    port: int
    user: str
    password: Secret
    encrypted: bool
    authority: Path | None

    @property
    def shown(self) -> str:
        """Address without secrets."""
        return f'{self.host}:{self.port}'

    def client(self, will: Will | None = None) -> Client:
        """
        Make a client.

        :param will: sent by the broker when we are lost.
        :return: not yet connected.
        :raises RuntimeError: outside an event loop.
        """
        asyncio.get_running_loop().set_exception_handler(_without_closed_sockets)
        context = None
        if self.encrypted:
            context = ssl.create_default_context(
                cafile=str(self.authority) if self.authority else None
            )
        return Client(
            self.host,
            self.port,
            username=self.user or None,
            password=self.password.reveal() or None,
            will=will,
            keepalive=KEEP_ALIVE,
            timeout=PATIENCE,
            tls_context=context,
        )


def _without_closed_sockets(loop: asyncio.AbstractEventLoop, problem: dict[str, object]) -> None:
    """
    Pass over a socket that the client has closed before the loop came to watch it.

    :param loop: of the client, whose thread asks the loop to watch its socket.
    :param problem: what the loop says; that the connection is lost is told by itself.
    """
    cause = problem.get('exception')
    if not (isinstance(cause, OSError) and cause.errno == errno.EBADF):
        loop.default_exception_handler(problem)


class Pulse:
    """
    Asks a broker, again and again, for what changes nothing: to end a subscription that is none.

    Every broker answers that, whatever a user may publish or read there, and after the messages
    that it had before the question. A network that is gone is known so before the connection is.
    """

    def __init__(self) -> None:
        self.known = 0  # up to when all messages have come, on a clock that nobody sets [ns]

    @property
    def silent(self) -> bool:
        """Whether the broker has not answered for longer than it may."""
        return time.monotonic_ns() - self.known > (QUIET + PULSE) * NANO

    async def keep(self, client: Client) -> None:
        """
        Ask until cancelled.

        :param client: connected.
        :raises MqttError: where there is no answer for `PATIENCE`.
        """
        self.known = time.monotonic_ns()
        while True:
            asked = time.monotonic_ns()
            await client.unsubscribe(NOWHERE)
            self.known = asked
            await asyncio.sleep(PULSE)


def read_broker(config: Section) -> Broker:
    """
    Read where the broker is.

    :param config: with `broker`, `user` and `tls`.
    :return: the broker; mistakes are noted in `config`.
    """
    url = config.needed('broker', 'mqtt://broker.example:1883')
    if url and (problem := address_problem(url, *SCHEMES)):
        config.refuse('broker', problem)
        url = ''
    parts = urlsplit(url)
    port = parts.port or SCHEMES.get(parts.scheme, 1883)
    user = config.section('user')
    tls = config.section('tls')
    broker = Broker(
        parts.hostname or '',
        port,
        user.text('name'),
        user.secret('password'),
        parts.scheme == 'mqtts',
        tls.path('ca'),
    )
    user.done()
    tls.done()
    return broker


def why(problem: BaseException) -> str:
    """
    Say in a few words what went wrong.

    :param problem: of the library or the network.
    :return: text without secrets.
    """
    code = getattr(problem, 'rc', None)
    number = getattr(code, 'value', code)
    if isinstance(problem, MqttConnectError) and number in REMEDIES:  # else: numbers of paho
        return REMEDIES[number]
    behind = problem.__cause__ or problem.__context__  # the client raises its own "from None"
    if isinstance(behind, OSError) and behind is not problem:
        return why(behind)
    if isinstance(problem, ssl.SSLError):
        return f'the certificate of the broker is refused: {problem.reason}: give tls.ca'
    if isinstance(problem, ConnectionRefusedError):
        return 'nobody listens there: is the broker running?'
    if isinstance(problem, OSError) and problem.strerror:
        return problem.strerror
    text = str(problem)
    if 'not authori' in text.lower() or 'bad user name' in text.lower():
        return REMEDIES[5]
    if 'Connection refused' in text:
        return 'nobody listens there: is the broker running?'
    return 'the connection was lost'
