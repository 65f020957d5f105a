# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Who may see the page: this machine, and beyond it who has the token."""

import hmac
import ipaddress
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

COOKIE = 'damadics_token'
LEAST_TOKEN = 16  # characters
LOOPBACK_NAMES = ('localhost', 'localhost.localdomain')


class AccessError(ValueError):
    """The page would be open to people without a token; the message says what to do."""


def loopback(host: str) -> bool:
    """
    Tell whether an address reaches this machine only.

    :param host: name or address.
    :return: True for loopback.

    >>> loopback('127.0.0.1'), loopback('::1'), loopback('0.0.0.0')
    (True, True, False)
    """
    host = host.strip('[]')
    if host in LOOPBACK_NAMES:
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def check_binding(host: str, token: str) -> None:
    """
    Refuse to serve the network without a token.

    :param host: the address that the page is to be served on.
    :param token: the token, '' for none.
    :raises AccessError: naming the remedy.
    """
    if token and len(token) < LEAST_TOKEN:
        raise AccessError(
            f'the token is too short: use {LEAST_TOKEN} characters or more, such as '
            'from: openssl rand -hex 16'
        )
    if not loopback(host) and not token:
        raise AccessError(
            f'--host {host} opens the page to the network: put a token into the file of '
            '--token-file or into DAMADICS_DASHBOARD_TOKEN (openssl rand -hex 16), or leave '
            '--host at 127.0.0.1'
        )


class Guard:
    """
    ASGI middleware: lets in who has the token, and refuses requests of foreign pages.

    A page of another site that the operator has open can send requests to this one; their
    `Origin` gives them away. Without a token only loopback names are answered, so that no foreign
    name can be bound to this address.

    :param app: the application.
    :param token: the token, '' for none.
    """

    def __init__(self, app: Any, token: str) -> None:
        self._app = app
        self._token = token

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Answer, or refuse."""
        if scope['type'] not in ('http', 'websocket'):
            await self._app(scope, receive, send)
            return
        headers = {k.decode('latin-1'): v.decode('latin-1') for k, v in scope['headers']}
        refusal = self._refusal(scope, headers)
        if refusal:
            await _refuse(scope, send, refusal)
        elif scope['type'] == 'http' and self._token and self._query(scope):
            await _redirect(scope, send, self._token)
        else:
            await self._app(scope, receive, send)

    def _refusal(self, scope: Any, headers: dict[str, str]) -> str:
        host = headers.get('host', '')
        origin = headers.get('origin', '')
        if origin and urlsplit(origin).netloc != host:
            return 'this request comes from another site'
        if not self._token:
            name = urlsplit(f'//{host}').hostname or ''
            return '' if loopback(name) else f'{name} is not a name of this machine'
        if self._query(scope) or self._same(_cookie(headers)):
            return ''
        return 'the token is missing: open the address with ?token=... once'

    def _query(self, scope: Any) -> bool:
        given = parse_qs(scope.get('query_string', b'').decode('latin-1')).get('token', [''])[0]
        return self._same(given)

    def _same(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), self._token.encode())


def _cookie(headers: dict[str, str]) -> str:
    try:
        morsel = SimpleCookie(headers.get('cookie', '')).get(COOKIE)
    except CookieError:
        return ''
    return morsel.value if morsel else ''


async def _refuse(scope: Any, send: Any, text: str) -> None:
    if scope['type'] == 'websocket':
        await send({'type': 'websocket.close', 'code': 1008})
        return
    await send(
        {
            'type': 'http.response.start',
            'status': 403,
            'headers': [(b'content-type', b'text/plain; charset=utf-8')],
        }
    )
    await send({'type': 'http.response.body', 'body': f'{text}\n'.encode()})


async def _redirect(scope: Any, send: Any, token: str) -> None:
    """Move the token from the address, where it would be seen and logged, into a cookie."""
    cookie = f'{COOKIE}={token}; Path=/; HttpOnly; SameSite=Strict'
    await send(
        {
            'type': 'http.response.start',
            'status': 303,
            'headers': [
                (b'location', scope['path'].encode()),
                (b'set-cookie', cookie.encode()),
            ],
        }
    )
    await send({'type': 'http.response.body', 'body': b''})
