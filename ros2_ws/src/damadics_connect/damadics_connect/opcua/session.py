# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Open a session with an OPC UA server: address, security policy, certificates, user."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import NamedTuple

from asyncua import Client, ua
from asyncua.crypto import security_policies

from damadics_connect.addresses import address_problem, shown
from damadics_connect.settings import Secret, Section

POLICIES = ('Basic256Sha256', 'Aes128Sha256RsaOaep', 'Aes256Sha256RsaPss')
MODES = ('Sign', 'SignAndEncrypt')
APPLICATION = 'urn:damadics:connect'
PATIENCE = 4.0  # s for an answer
LEAVE = 1.0  # s to take leave of a server
MOST_PATIENCE = 32.0  # s, after some failures: the server may only be slow
PAUSES = (0.2, 0.5, 1.0, 2.0, 5.0)  # s before a server is tried again
STANDSTILL = 5.0  # s that a server may stand still before the library ends the session
REMEDIES = {
    'BadUserAccessDenied': 'wrong user name or password',
    'BadIdentityTokenRejected': 'wrong user name or password',
    'BadIdentityTokenInvalid': 'the server does not take this kind of user',
    'BadSecurityChecksFailed': 'the server refuses our certificate, or ours is not trusted there',
    'BadCertificateUntrusted': 'have our certificate trusted on the server',
    'BadCertificateInvalid': 'the certificate is not valid',
    'BadCertificateTimeInvalid': 'a certificate has expired, or a clock is wrong',
    'BadCertificateUriInvalid': f'the certificate lacks the URI {APPLICATION}',
    'BadSecurityPolicyRejected': 'the server does not offer this security policy',
    'BadSecurityModeRejected': 'the server does not offer this security mode',
    'BadTooManySessions': 'the server has no session left for us',
    'BadServiceUnsupported': 'the server does not do this',
}


class Security(NamedTuple):
    """How the channel is secured; policy '' means not at all."""

    policy: str = ''
    mode: str = ''
    certificate: Path = Path()
    key: Path = Path()
    key_password: Secret = Secret()
    server_certificate: Path = Path()


class Endpoint(NamedTuple):
    """A server and who we are there."""

    url: str
    user: str = ''
    password: Secret = Secret()
    security: Security = Security()


class SessionError(Exception):
    """No session; the message names server, cause and remedy, and no secret."""


def read_endpoint(config: Section) -> Endpoint:
    """
    Read where the server is and how it is entered.

    :param config: with `server`, `user` and `security`.
    :return: the endpoint; mistakes are noted in `config`.
    """
    url = config.needed('server', 'opc.tcp://plc.example:4840')
    if url and (problem := address_problem(url, 'opc.tcp')):
        config.refuse('server', problem)
    user = config.section('user')
    name = user.text('name')
    password = user.secret('password')
    user.done()
    given = config.section('security')
    security = Security()
    if 'security' in config:
        policy = given.text('policy', POLICIES[0], choices=POLICIES)
        mode = given.text('mode', 'SignAndEncrypt', choices=MODES)
        files = {}
        for entry in ('certificate', 'key', 'server_certificate'):
            given.needed(entry, f'{entry}.der')
            files[entry] = given.path(entry) or Path()
        security = Security(
            policy,
            mode,
            files['certificate'],
            files['key'],
            given.secret('key_password'),
            files['server_certificate'],
        )
    given.done()
    return Endpoint(url, name, password, security)


def why(problem: BaseException) -> str:
    """
    Say in a few words what went wrong, with the remedy where there is one.

    :param problem: of the library or the network.
    :return: text without secrets.
    """
    if isinstance(problem, TimeoutError):
        return 'no answer: is the address right, and nothing between that blocks it?'
    if isinstance(problem, ConnectionRefusedError):
        return 'nobody listens there: is the server running?'
    if isinstance(problem, ua.UaStatusCodeError):
        name = type(problem).__name__
        return f'{name}: {REMEDIES.get(name, "the log of the server may say more")}'
    if isinstance(problem, OSError):
        return problem.strerror or type(problem).__name__
    return f'{type(problem).__name__}: the server broke the session off'


async def open_session(endpoint: Endpoint, patience: float = PATIENCE) -> Client:
    """
    Connect, secure the channel and activate a session.

    :param endpoint: the server.
    :param patience: time that each answer may take [s].
    :return: a connected client, to be closed with `close_session`.
    :raises SessionError: with cause and remedy.
    """
    client = Client(endpoint.url, timeout=patience, watchdog_intervall=STANDSTILL)
    client.name = client.description = 'DAMADICS FD'
    client.application_uri = APPLICATION
    security = endpoint.security
    try:
        if security.policy:
            await client.set_security(
                getattr(security_policies, f'SecurityPolicy{security.policy}'),
                security.certificate,
                security.key,
                security.key_password.reveal() or None,
                str(security.server_certificate),
                getattr(ua.MessageSecurityMode, security.mode),
            )
    except Exception as problem:  # the crypto library raises what it likes
        raise SessionError(
            f'{shown(endpoint.url)}: certificate or key cannot be used: {type(problem).__name__} '
            f'({security.certificate.name}, {security.key.name}, '
            f'{security.server_certificate.name}): give PEM or DER files that belong together'
        ) from None
    if endpoint.user:
        client.set_user(endpoint.user)
        client.set_password(endpoint.password.reveal())
    try:
        await client.connect()
    except asyncio.CancelledError:
        await close_session(client)
        raise
    except Exception as problem:
        await close_session(client)
        raise SessionError(f'{shown(endpoint.url)}: {why(problem)}') from None
    return client


async def close_session(client: Client) -> None:
    """
    Take leave of a server, or of one that no longer answers.

    :param client: connected or not.
    """
    with contextlib.suppress(Exception):
        await asyncio.wait_for(client.disconnect(), LEAVE)
    if client.uaclient.protocol is not None and client.uaclient.protocol.transport is not None:
        client.uaclient.protocol.transport.abort()


class Connection:
    """
    A session that is opened again, for ever, whenever it was lost.

    :param endpoint: the server.
    :param use: what is done with a session until it ends; it says `works` when all is set up.
    :param log: takes what a person should know.
    :param lost: what it means that there is no session, such as "not connected".
    """

    def __init__(
        self,
        endpoint: Endpoint,
        use: Callable[[Client], Awaitable[None]],
        log: Callable[[str], None],
        lost: str,
    ) -> None:
        self.fault = 'not connected yet'
        self.place = shown(endpoint.url)
        self._endpoint = endpoint
        self._use = use
        self._log = log
        self._lost = lost
        self._failures = 0

    def works(self) -> None:
        """Say that the session does what it was opened for."""
        self.fault = ''
        self._failures = 0

    def fails(self, cause: str) -> None:
        """
        Tell that it does not, once for each cause.

        :param cause: with the server's name.
        """
        if cause != self.fault:
            self._log(f'{self._lost}: {cause}')
        self.fault = cause

    async def run(self) -> None:
        """Have a session for ever."""
        while True:
            patience = min(PATIENCE * 2**self._failures, MOST_PATIENCE)
            try:
                client = await open_session(self._endpoint, patience)
                try:
                    await self._use(client)
                finally:
                    await close_session(client)
            except SessionError as problem:
                self.fails(str(problem))
            except (ua.UaError, OSError, TimeoutError) as problem:
                self.fails(f'{self.place}: {why(problem)}')
            await asyncio.sleep(PAUSES[min(self._failures, len(PAUSES) - 1)])
            self._failures = min(self._failures + 1, len(PAUSES))
