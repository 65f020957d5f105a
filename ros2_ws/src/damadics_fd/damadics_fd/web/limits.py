# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What one visitor can cost: sizes of requests, time for a head, number of connections."""

import asyncio
from asyncio import TimerHandle
from typing import TYPE_CHECKING

from damadics_fd.web.asgi import Application, Message, Receive, Scope, Send

if TYPE_CHECKING:  # the server takes a second to import: not before the arguments are checked
    from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol
else:
    try:
        from uvicorn.protocols.http.auto import AutoHTTPProtocol as HttpToolsProtocol
    except ImportError:  # pragma: no cover - nothing can be served, but the parts be tested
        HttpToolsProtocol = asyncio.Protocol

LARGEST_UPLOAD = 2 << 30  # B, of a recording to replay
LARGEST_REQUEST = 1 << 20  # B, of anything else
UPLOADS = '/_nicegui/client/'  # paths that take recordings
HEAD_TIME = 10.0  # s that the head of a request may take
MOST_CONNECTIONS = 200


class TooLargeError(Exception):
    """More came in than was allowed."""


class SizeLimit:
    """
    ASGI middleware: answers 413 to what is too large, as soon as that shows.

    :param app: the application.
    :param upload: bytes of a recording at most.
    :param request: bytes of another request at most.
    :param remedy: what to do instead, told after the limit.
    """

    def __init__(
        self,
        app: Application,
        upload: int = LARGEST_UPLOAD,
        request: int = LARGEST_REQUEST,
        remedy: str = 'ros2 run damadics_fd replay FILE',
    ) -> None:
        self._app = app
        self._remedy = remedy
        self._upload = upload
        self._request = request

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, and count."""
        if scope['type'] != 'http':
            await self._app(scope, receive, send)
            return
        limit = self._upload if str(scope['path']).startswith(UPLOADS) else self._request
        if _announced(scope) > limit:
            await self._refuse(send, limit)
            return
        taken, begun = 0, False

        async def counted() -> Message:
            nonlocal taken
            message = await receive()
            body = message.get('body', b'')
            taken += len(body) if isinstance(body, bytes) else 0
            if taken > limit:
                raise TooLargeError
            return message

        async def noted(message: Message) -> None:
            nonlocal begun
            if message['type'] == 'http.response.start':
                begun = True
                if taken > limit:  # the application took the broken body for a mistake of its own
                    message['status'] = 413
            await send(message)

        try:
            await self._app(scope, counted, noted)
        except TooLargeError:
            if not begun:
                await self._refuse(send, limit)

    async def _refuse(self, send: Send, limit: int) -> None:
        kind = [(b'content-type', b'text/plain; charset=utf-8'), (b'connection', b'close')]
        await send({'type': 'http.response.start', 'status': 413, 'headers': kind})
        text = f'larger than the {limit} bytes that are taken: {self._remedy}\n'
        await send({'type': 'http.response.body', 'body': text.encode()})


def _announced(scope: Scope) -> int:
    pairs = scope.get('headers')
    if isinstance(pairs, list | tuple):
        for key, value in pairs:
            if key == b'content-length':
                return int(value) if value.isdigit() else 0
    return 0


class PatientProtocol(HttpToolsProtocol):
    """uvicorn's protocol that gives the head of a request some seconds, and counts who is in."""

    _waiting: TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Let a visitor in, or close the door where the house is full."""
        super().connection_made(transport)
        if len(self.connections) > MOST_CONNECTIONS:
            transport.close()
            return
        self._wait()

    def data_received(self, data: bytes) -> None:
        """Take a piece of a request."""
        super().data_received(data)
        if self._in_head():
            if self._waiting is None:
                self._wait()
        elif self._waiting is not None:
            self._waiting.cancel()
            self._waiting = None

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget a visitor."""
        if self._waiting is not None:
            self._waiting.cancel()
            self._waiting = None
        super().connection_lost(exc)

    def _wait(self) -> None:
        self._waiting = asyncio.get_running_loop().call_later(HEAD_TIME, self._give_up)

    def _in_head(self) -> bool:
        """Whether no request is being answered; a socket has another protocol by then."""
        if self.transport.is_closing() or self.transport.get_protocol() is not self:
            return False
        return self.cycle is None or bool(self.cycle.response_complete)

    def _give_up(self) -> None:
        self._waiting = None
        if self._in_head():
            self.transport.close()
