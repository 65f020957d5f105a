# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages that wait for their target, and transitions already told: both outlive the process."""

import sqlite3
import time
from pathlib import Path
from typing import NamedTuple

from damadics_connect.notify.rules import Message

REMEMBERED = 20_000  # transitions
TABLES = """
create table if not exists waiting (
  id integer primary key autoincrement, target text, title text, body text, since real);
create table if not exists told (id integer primary key autoincrement, key text unique);
"""


class Waiting(NamedTuple):
    """A message that waits."""

    id: int
    message: Message
    since: float  # s since 1970


class Spool:
    """
    The spool of one machine.

    :param path: of its file.
    :raises OSError: where it cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            self._base = sqlite3.connect(path, timeout=5.0, check_same_thread=False)
            self._base.execute('pragma journal_mode=wal')
            self._base.execute('pragma synchronous=full')
            self._base.executescript(TABLES)
        except sqlite3.DatabaseError as problem:
            raise OSError(f'{path} cannot be used: {problem}: move it away') from problem
        self.fresh = not self._base.execute('select 1 from told limit 1').fetchone()

    def put(self, message: Message) -> None:
        """Keep a message until it is delivered."""
        with self._base:
            self._base.execute(
                'insert into waiting (target, title, body, since) values (?, ?, ?, ?)',
                (*message, time.time()),
            )

    def waiting(self, target: str) -> list[Waiting]:
        """Return the messages for a target, the oldest first, at most 100."""
        rows = self._base.execute(
            'select id, target, title, body, since from waiting where target = ? '
            'order by id limit 100',
            (target,),
        )
        return [Waiting(row[0], Message(*row[1:4]), row[4]) for row in rows]

    def count(self) -> int:
        """Return how many messages wait."""
        return int(self._base.execute('select count(*) from waiting').fetchone()[0])

    def delivered(self, number: int) -> None:
        """Forget a message that has arrived."""
        with self._base:
            self._base.execute('delete from waiting where id = ?', (number,))

    def first_time(self, key: str) -> bool:
        """Tell whether a transition is new, and remember it."""
        with self._base:
            new = self._base.execute(
                'insert or ignore into told (key) values (?)', (key,)
            ).rowcount
            if new:
                self._base.execute(
                    'delete from told where id <= (select max(id) from told) - ?', (REMEMBERED,)
                )
        return bool(new)

    def close(self) -> None:
        """Close the file."""
        self._base.close()
