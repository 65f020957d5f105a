# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Types of ASGI, the interface between a web server and an application."""

from collections.abc import Awaitable, Callable, MutableMapping

Value = str | bytes | int | bool | list[tuple[bytes, bytes]]
Message = MutableMapping[str, Value]
Scope = MutableMapping[str, object]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Application = Callable[[Scope, Receive, Send], Awaitable[None]]
