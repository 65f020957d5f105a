# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""An MQTT broker in its own process: `mqtt_broker.py PORT [PASSWORD_FILE | CERTIFICATE KEY]`."""

import asyncio
import sys

from amqtt.broker import Broker


async def main() -> None:
    port, *files = sys.argv[1:]
    passwords = files if len(files) == 1 else []
    listener: dict[str, object] = {'type': 'tcp', 'bind': f'127.0.0.1:{port}'}
    if len(files) == 2:
        listener |= {'ssl': True, 'certfile': files[0], 'keyfile': files[1]}
    kind = {'allow_anonymous': not passwords, 'password_file': passwords[0] if passwords else None}
    plugins = {'amqtt.plugins.authentication.AnonymousAuthPlugin': {'allow_anonymous': True}}
    if passwords:
        file = {'password_file': kind['password_file']}
        plugins = {'amqtt.plugins.authentication.FileAuthPlugin': file}
    broker = Broker(
        {
            'listeners': {'default': listener},
            'plugins': plugins,
        }
    )
    await broker.start()
    await asyncio.Event().wait()


asyncio.run(main())
