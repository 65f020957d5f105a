# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A mail server in its own process: `python mail_server.py PORT FILE`; mails become JSON lines."""

import asyncio
import email
import email.policy
import json
import sys
from pathlib import Path

from aiosmtpd.controller import Controller
from aiosmtpd.smtp import AuthResult


class Sink:
    def __init__(self, path: Path) -> None:
        self._path = path

    async def handle_DATA(self, server, session, envelope):
        mail = email.message_from_bytes(envelope.content, policy=email.policy.default)
        body = mail.get_body(('plain', 'html')).get_content()
        row = {'to': envelope.rcpt_tos, 'subject': mail['subject'], 'body': body}
        with self._path.open('a') as file:
            file.write(json.dumps(row) + '\n')
        return '250 kept'


async def main() -> None:
    controller = Controller(
        Sink(Path(sys.argv[2])),
        hostname='127.0.0.1',
        port=int(sys.argv[1]),
        authenticator=lambda *given: AuthResult(success=True),
        auth_require_tls=False,
    )
    controller.start()
    await asyncio.Event().wait()


asyncio.run(main())
