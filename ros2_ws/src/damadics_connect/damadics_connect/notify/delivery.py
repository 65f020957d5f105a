# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Deliver messages through apprise: e-mail, chat, webhooks; each target at its own pace."""

import asyncio
from collections.abc import Callable, Mapping

import apprise

from damadics_connect.notify.rules import Message
from damadics_connect.notify.spool import Spool
from damadics_connect.settings import Secret, Section

PAUSES = (1.0, 2.0, 5.0, 15.0, 60.0)  # s before a target that failed is tried again
LOOK = 0.2  # s between two looks into the spool
PATIENCE = 60.0  # s for one message


class Delivery:
    """
    Delivers what waits in the spool.

    :param targets: addresses of apprise by name; they contain secrets.
    :param spool: the messages.
    :param log: takes what a person should know.
    """

    def __init__(
        self, targets: Mapping[str, Secret], spool: Spool, log: Callable[[str], None]
    ) -> None:
        self._targets = targets
        self._spool = spool
        self._log = log
        self.delivered = 0
        self.failing: dict[str, str] = {}

    async def run(self) -> None:
        """Deliver for ever."""
        await asyncio.gather(*(self._serve(name) for name in self._targets))

    async def _serve(self, name: str) -> None:
        failures = 0
        while True:
            for waiting in self._spool.waiting(name):
                if await send(self._targets[name], waiting.message):
                    self._spool.delivered(waiting.id)
                    self.delivered += 1
                    failures = 0
                    if self.failing.pop(name, ''):
                        self._log(f'target {name} takes messages again')
                    continue
                if not failures:
                    self._log(f'target {name} takes no message: kept until it does')
                self.failing[name] = 'takes no message: is it reachable, is the password right?'
                await asyncio.sleep(PAUSES[min(failures, len(PAUSES) - 1)])
                failures += 1
                break
            await asyncio.sleep(LOOK)


async def send(address: Secret, message: Message) -> bool:
    """
    Send one message.

    :param address: of apprise.
    :param message: title and body; both are plain text.
    :return: whether it has arrived.
    """
    sender = apprise.Apprise()
    sender.add(address.reveal())
    try:
        done = await asyncio.wait_for(
            sender.async_notify(
                body=message.body,
                title=message.title,
                body_format=apprise.NotifyFormat.TEXT,
                interpret_escapes=False,
            ),
            PATIENCE,
        )
    except Exception:  # of a hundred plugins; what it says may have the address in it
        return False
    return bool(done)


def read_targets(config: Section) -> dict[str, Secret]:
    """
    Read the targets.

    :param config: with `targets`: each has `url_file` or `url_env`.
    :return: addresses by name; mistakes are noted in `config`.
    """
    targets = {}
    for name, entry in config.sections('targets').items():
        address = entry.secret('url')
        entry.done()
        if (
            address
            and apprise.Apprise.instantiate(address.reveal(), suppress_exceptions=True) is None
        ):
            entry.problems.append(f'{entry.where}: its address is none that apprise knows')
        elif not address and not entry.problems:
            entry.problems.append(f'{entry.where}: give url_file or url_env')
        targets[name] = address
    if not targets:
        config.problems.append('targets: give at least one, such as shift: {url_file: shift.url}')
    return targets
