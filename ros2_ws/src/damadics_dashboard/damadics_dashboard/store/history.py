# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The history: every transition of every valve and everything that people did, over restarts."""

import math
import sqlite3
import threading
import time
from collections import Counter, OrderedDict, deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from damadics_fd.store.databases import open_database

from damadics_dashboard.store.rows import ActionRow, EventRow

EVENT = {
    'valve': 'TEXT',
    'stamp': 'INTEGER',
    'seen': 'REAL',
    'transition': 'INTEGER',
    'occurrence': 'INTEGER',
    'level': 'INTEGER',
    'onset': 'INTEGER',
    'residual': 'REAL',
    'threshold': 'REAL',
    'ratio': 'REAL',
    'duration': 'REAL',
    'cause': 'TEXT',
    'confidence': 'REAL',
    'strength': 'REAL',
    'text': 'TEXT',
    'advice': 'TEXT',
    'unseen': 'REAL',
}
LATER = ('unseen',)  # columns that files of 0.1 do not have
ACTION = {
    'valve': 'TEXT',
    'seen': 'REAL',
    'action': 'TEXT',
    'user': 'TEXT',
    'role': 'TEXT',
    'comment': 'TEXT',
    'done': 'INTEGER',
    'result': 'TEXT',
}
TAG = {'valve': 'TEXT', 'tag': 'TEXT'}
COLUMNS, ACTION_COLUMNS = tuple(EVENT), tuple(ACTION)
KINDS = {'TEXT': (str,), 'INTEGER': (int,), 'REAL': (int, float)}
INDEXES = (
    'CREATE INDEX IF NOT EXISTS event_seen ON event (seen)',
    'CREATE INDEX IF NOT EXISTS event_valve ON event (valve)',
    'CREATE INDEX IF NOT EXISTS action_seen ON action (seen)',
)
IDENTITY = ('valve', 'stamp', 'transition', 'occurrence', 'text')
ACTION_IDENTITY = ('valve', 'action', 'user', 'comment', 'done')
MOST_REPEATED = 20_000  # transitions of 200 valves
MOST_WAITING = 10_000  # rows kept in memory while the file cannot be written
Row = TypeVar('Row', EventRow, ActionRow)


@dataclass(frozen=True)
class Wanted:
    """What to look for in the history; what is left out does not matter."""

    text: str = ''
    valve: str | None = None
    transitions: tuple[int, ...] = ()
    since: float = 0.0  # s, time of arrival
    until: float = 1e12


class History:
    """
    Transitions of alarms and actions of people in an SQLite file.

    A file that cannot be read is moved aside and begun anew; what cannot be written waits in
    memory and is tried again by `retry`. `problem` says so.

    :param path: the file; it is made where it is missing.
    """

    def __init__(self, path: Path) -> None:
        self._lock = threading.Lock()
        self._db, self.problem = open_database(
            path, {'event': EVENT, 'action': ACTION, 'tag': TAG}, INDEXES, LATER
        )
        self._waiting: deque[tuple[str, EventRow | ActionRow]] = deque(maxlen=MOST_WAITING)
        # A detector repeats its last events to a newcomer, such as this page after its restart.
        self._known = Counter(
            tuple(row)
            for row in self._db.execute(
                f'SELECT {", ".join(IDENTITY)} FROM event ORDER BY rowid DESC LIMIT ?',
                (MOST_REPEATED,),
            )
        )
        self._told: OrderedDict[tuple[object, ...], None] = OrderedDict()  # by nodes
        # by whom each act is still to be told a second time: above 0 a node, below 0 the page
        self._untold = Counter(
            tuple(row)
            for row in self._db.execute(
                f'SELECT {", ".join(ACTION_IDENTITY)} FROM action ORDER BY rowid DESC LIMIT ?',
                (MOST_REPEATED,),
            )
        )

    def add(self, event: EventRow) -> bool:
        """
        Add a transition, unless it repeats one from before this start.

        :param event: values by the names in `COLUMNS`, but for `seen`.
        :return: whether it is new.
        """
        key = tuple(event.get(name) for name in IDENTITY)
        if self._known[key]:
            self._known[key] -= 1
            return False
        self._write('event', {'unseen': None, **event, 'seen': time.time()})
        return True

    def complete(self, event: EventRow) -> bool:
        """
        Add size and confidence to an event that was stored without them.

        :param event: with them.
        :return: False where the file has no such event, or cannot be written.
        """
        where = 'valve = :valve AND stamp = :stamp AND transition = :transition'
        try:
            with self._lock, self._db:
                done = self._db.execute(
                    'UPDATE event SET strength = :strength, confidence = :confidence '
                    f'WHERE {where} AND occurrence = :occurrence AND strength IS NULL',
                    event,
                )
        except sqlite3.Error as problem:
            self.problem = f'not written, tried again every second: {problem}'
            return False
        return done.rowcount > 0

    def first_seen(self, valve: str) -> float:
        """
        Return since when there is a history of a valve.

        :param valve: its name.
        :return: time of its first event [s]; inf where there is none.
        """
        query = 'SELECT min(seen) FROM event WHERE valve = ?'
        with self._lock:
            (first,) = self._db.execute(query, (valve,)).fetchone()
        return float(first) if isinstance(first, (int, float)) else math.inf

    def add_action(self, action: ActionRow, stamp: int | None = None) -> bool:
        """
        Add what a person did, unless it is known: the node tells what the page asked it for.

        :param action: values by the names in `ACTION_COLUMNS`, but for `seen`.
        :param stamp: of the node that tells it [ns]; after its restart it tells all once more.
        :return: whether it is new.
        """
        key = tuple(action.get(name) for name in ACTION_IDENTITY)
        by_page = stamp is None
        if not by_page:
            told = (stamp, action.get('result'), *key)
            if told in self._told:
                return False
            self._told[told] = None
            if len(self._told) > MOST_REPEATED:
                self._told.popitem(last=False)
        untold = self._untold[key]
        self._untold[key] += 1 if by_page else -1
        if untold < 0 if by_page else untold > 0:
            return False
        self._write('action', {**action, 'seen': time.time()})
        return True

    def retry(self) -> None:
        """Write what could not be written before."""
        while self._waiting:
            table, row = self._waiting[0]
            if not self._insert(table, row):
                return
            self._waiting.popleft()
        if self.problem.startswith('not written'):
            self.problem = ''

    def latest(self, valve: str | None = None, count: int = 200) -> list[EventRow]:
        """
        Return the latest transitions, newest first.

        :param valve: of this valve only.
        :param count: at most so many.
        :return: rows by the names in `COLUMNS`.
        """
        return self.find(Wanted(valve=valve), count)

    def find(self, wanted: Wanted, count: int = 200, offset: int = 0) -> list[EventRow]:
        """
        Return the transitions that are looked for, newest first.

        :param wanted: what they have.
        :param count: at most so many.
        :param offset: leave out so many.
        :return: rows by the names in `COLUMNS`.
        """
        where, values = _where(wanted, ('valve', 'text', 'cause', 'advice'))
        if wanted.transitions:
            where += f' AND transition IN ({", ".join("?" * len(wanted.transitions))})'
            values += wanted.transitions
        return self._select(EventRow, 'event', COLUMNS, where, values, count, offset)

    def actions(
        self, wanted: Wanted | None = None, count: int = 200, offset: int = 0
    ) -> list[ActionRow]:
        """
        Return what people did, newest first.

        :param wanted: what to look for.
        :param count: at most so many.
        :param offset: leave out so many.
        :return: rows by the names in `ACTION_COLUMNS`.
        """
        where, values = _where(
            wanted or Wanted(), ('valve', 'user', 'comment', 'result', 'action')
        )
        return self._select(ActionRow, 'action', ACTION_COLUMNS, where, values, count, offset)

    def valves(self) -> list[str]:
        """
        List the valves that have a history.

        :return: names.
        """
        with self._lock:
            rows = self._db.execute('SELECT DISTINCT valve FROM event').fetchall()
        return sorted(name for (name,) in rows if isinstance(name, str))

    def tags(self) -> dict[str, str]:
        """
        Return the actuators' tags that are known.

        :return: tag by the name of the valve.
        """
        with self._lock:
            rows = self._db.execute('SELECT valve, tag FROM tag').fetchall()
        return {str(valve): str(tag) for valve, tag in rows}

    def keep_tag(self, valve: str, tag: str) -> None:
        """
        Keep the tag of a valve, for reports that are written while nobody speaks.

        :param valve: name of the valve.
        :param tag: of its actuator.
        """
        try:
            with self._lock, self._db:
                self._db.execute('DELETE FROM tag WHERE valve = ?', (valve,))
                self._db.execute('INSERT INTO tag VALUES (?, ?)', (valve, tag))
        except sqlite3.Error as problem:
            self.problem = f'not written, tried again every second: {problem}'

    def close(self) -> None:
        """Close the file."""
        self.retry()
        with self._lock:
            self._db.close()

    def _write(self, table: str, row: EventRow | ActionRow) -> None:
        if self._waiting or not self._insert(table, row):
            self._waiting.append((table, row))

    def _insert(self, table: str, row: EventRow | ActionRow) -> bool:
        columns = COLUMNS if table == 'event' else ACTION_COLUMNS
        marks = ', '.join(f':{name}' for name in columns)
        try:
            with self._lock, self._db:
                self._db.execute(
                    f'INSERT INTO {table} ({", ".join(columns)}) VALUES ({marks})', row
                )
        except sqlite3.Error as problem:
            self.problem = f'not written, tried again every second: {problem}'
            return False
        return True

    def _select(
        self,
        kind: type[Row],
        table: str,
        columns: Sequence[str],
        where: str,
        values: tuple[str | float, ...],
        count: int,
        offset: int,
    ) -> list[Row]:
        query = (
            f'SELECT {", ".join(columns)} FROM {table} WHERE {where} '
            'ORDER BY rowid DESC LIMIT ? OFFSET ?'
        )
        try:
            with self._lock:
                found = self._db.execute(query, (*values, count, offset)).fetchall()
        except sqlite3.Error as problem:
            self.problem = f'not read: {problem}'
            return []
        kinds = EVENT if table == 'event' else ACTION
        fit = [row for row in found if _fits(row, [kinds[name] for name in columns])]
        if len(fit) < len(found):
            self.problem = f'{len(found) - len(fit)} damaged rows are left out'
        return [kind(**dict(zip(columns, row, strict=True))) for row in fit]


def _fits(row: Sequence[str | float | bytes | None], kinds: Sequence[str]) -> bool:
    """Tell whether values from the file are of the kinds of their columns; SQLite checks none."""
    valve, *_ = row
    return valve is not None and all(
        value is None or isinstance(value, KINDS[kind])
        for value, kind in zip(row, kinds, strict=True)
    )


def _where(wanted: Wanted, columns: Sequence[str]) -> tuple[str, tuple[str | float, ...]]:
    where = 'seen >= ? AND seen < ?'
    values: tuple[str | float, ...] = (wanted.since, wanted.until)
    if wanted.valve is not None:
        where, values = f'{where} AND valve = ?', (*values, wanted.valve)
    for word in wanted.text.split():
        pattern = '%' + word.replace('\\', '\\\\').replace('%', r'\%').replace('_', r'\_') + '%'
        where += f' AND ({" OR ".join(f"{c} LIKE ? ESCAPE ?" for c in columns)})'
        for _ in columns:
            values = (*values, pattern, '\\')
    return where, values
