# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Who may see the page: this machine, and beyond it who has a token."""

import ipaddress
from collections.abc import Mapping
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qsl, quote, urlencode, urlsplit

from damadics_fd.store.access import Access, AccessError, Grant, Role
from damadics_fd.web.asgi import Application, Message, Receive, Scope, Send

from damadics_dashboard.words.templates import render
from damadics_dashboard.words.texts import preferred, texts

COOKIE = 'damadics_token'
LOOPBACK_NAMES = ('localhost', 'localhost.localdomain')
GRANT = 'damadics.grant'  # in the scope of a request: what its token allows
NOBODY = Grant(Role.OPERATOR, '')  # where no token is asked for
HEADERS = (
    (b'x-frame-options', b'DENY'),
    (b'x-content-type-options', b'nosniff'),
    (b'referrer-policy', b'no-referrer'),
    (b'cross-origin-opener-policy', b'same-origin'),
    (b'permissions-policy', b'camera=(), microphone=(), geolocation=()'),
    (
        b'content-security-policy',
        b"default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
        b"style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
        b"connect-src 'self' ws: wss:; object-src 'none'; base-uri 'none'; form-action 'self'; "
        b"frame-ancestors 'none'",
    ),
)


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


def check_binding(host: str, access: Access) -> None:
    """
    Refuse to serve the network without a token.

    :param host: the address that the page is to be served on.
    :param access: the tokens that are accepted.
    :raises AccessError: naming the remedy.
    """
    if not loopback(host) and access.open:
        raise AccessError(
            f'--host {host} opens the page to the network: put a token into the file of '
            '--token-file or into DAMADICS_DASHBOARD_TOKEN (openssl rand -hex 16), or leave '
            '--host at 127.0.0.1'
        )


class Guard:
    """
    ASGI middleware: lets in who has a token, and refuses requests of foreign pages.

    A page of another site that the operator has open can send requests to this one; their
    `Origin` gives them away, and no other page may frame this one. Without a token only loopback
    names are answered, so that no foreign name can be bound to this address.

    :param app: the application.
    :param access: the tokens that are accepted.
    """

    def __init__(self, app: Application, access: Access) -> None:
        self._app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or refuse."""
        if scope['type'] not in ('http', 'websocket'):
            await self._app(scope, receive, send)
            return
        headers = _headers(scope)
        refusal = self._foreign(headers)
        asked = _query(scope)
        grant = self._grant(dict(asked).get('token', ''), headers)
        if not refusal and grant is None:
            refusal = 'the token is missing: open the address with ?token=... once'
            if scope['type'] == 'http' and 'text/html' in headers.get('accept', ''):
                await _ask(send, headers.get('accept-language', ''), 'token' in dict(asked))
                return
        if refusal or grant is None:
            await _refuse(scope, send, refusal)
        elif scope['type'] == 'http' and not self._access.open and 'token' in dict(asked):
            await _redirect(scope, send, asked)
        else:
            scope[GRANT] = grant
            await self._app(scope, receive, _with_headers(send))

    def _foreign(self, headers: Mapping[str, str]) -> str:
        """Tell why a request is not one of this page's own."""
        host, origin = headers.get('host', ''), headers.get('origin', '')
        try:
            if origin and urlsplit(origin).netloc != host:
                return 'this request comes from another site'
            name = urlsplit(f'//{host}').hostname or ''
        except ValueError:
            return 'Host or Origin of this request cannot be read'
        if self._access.open and not loopback(name):
            return 'this is not a name of this machine'
        return ''

    def _grant(self, given: str, headers: Mapping[str, str]) -> Grant | None:
        if self._access.open:
            return NOBODY
        return self._access.of(given) or self._access.of(_cookie(headers))


def _headers(scope: Scope) -> dict[str, str]:
    pairs = scope.get('headers')
    if not isinstance(pairs, list | tuple):
        return {}
    return {key.decode('latin-1'): value.decode('latin-1') for key, value in pairs}


def _query(scope: Scope) -> list[tuple[str, str]]:
    text = scope.get('query_string', b'')
    try:
        return parse_qsl(text.decode('latin-1') if isinstance(text, bytes) else '')
    except ValueError:  # more fields than any page of ours has
        return []


def _cookie(headers: Mapping[str, str]) -> str:
    try:
        morsel = SimpleCookie(headers.get('cookie', '')).get(COOKIE)
    except CookieError:
        return ''
    return morsel.value if morsel else ''


def _with_headers(send: Send) -> Send:
    async def answer(message: Message) -> None:
        given = message.get('headers', [])
        if message['type'] == 'http.response.start' and isinstance(given, list):
            present = {key.lower() for key, _ in given}
            message['headers'] = [*given, *(h for h in HEADERS if h[0] not in present)]
        await send(message)

    return answer


async def _answer(
    send: Send,
    status: int,
    text: str,
    headers: tuple[tuple[bytes, bytes], ...] = (),
    kind: bytes = b'text/plain; charset=utf-8',
) -> None:
    own = [(b'content-type', kind), *headers, *HEADERS]
    await send({'type': 'http.response.start', 'status': status, 'headers': own})
    await send({'type': 'http.response.body', 'body': text.encode()})


async def _ask(send: Send, languages: str, wrong: bool) -> None:
    """Ask a person for a token."""
    t = texts(preferred(languages))
    page = render('token.html', t=t, language=t.language, wrong=wrong)
    await _answer(send, 403, page, kind=b'text/html; charset=utf-8')


async def _refuse(scope: Scope, send: Send, text: str) -> None:
    if scope['type'] == 'websocket':
        await send({'type': 'websocket.close', 'code': 1008})
    else:
        await _answer(send, 403, f'{text}\n')


async def _redirect(scope: Scope, send: Send, asked: list[tuple[str, str]]) -> None:
    """Move the token from the address, where it would be seen and logged, into a cookie."""
    token = dict(asked)['token']
    rest = urlencode([(name, value) for name, value in asked if name != 'token'])
    path = '/' + quote(str(scope['path']).lstrip('/\\'), safe='/~')
    place = path + (f'?{rest}' if rest else '')
    cookie = f'{COOKIE}={token}; Path=/; HttpOnly; SameSite=Strict'
    await _answer(send, 303, '', ((b'location', place.encode()), (b'set-cookie', cookie.encode())))
