# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The alarm history: every transition of every valve, kept over restarts."""

import sqlite3
import threading
import time
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

COLUMNS = (
    'valve',
    'stamp',
    'seen',
    'transition',
    'occurrence',
    'level',
    'onset',
    'residual',
    'threshold',
    'ratio',
    'duration',
    'cause',
    'confidence',
    'strength',
    'text',
    'advice',
)
IDENTITY = ('valve', 'stamp', 'transition', 'occurrence', 'text')
MOST_REPEATED = 20_000  # transitions of 200 valves
Row = dict[str, Any]


class History:
    """
    Transitions of alarms in an SQLite file.

    :param path: the file; it is made where it is missing.
    """

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._lock = threading.Lock()
        self._db = sqlite3.connect(path, check_same_thread=False)
        self._db.execute('PRAGMA journal_mode=WAL')
        self._db.execute(
            'CREATE TABLE IF NOT EXISTS event (valve TEXT, stamp INTEGER, seen REAL, '
            'transition INTEGER, occurrence INTEGER, level INTEGER, onset INTEGER, residual REAL, '
            'threshold REAL, ratio REAL, duration REAL, cause TEXT, confidence REAL, '
            'strength REAL, text TEXT, advice TEXT)'
        )
        self._db.commit()
        # A detector repeats its last events to a newcomer, such as this page after its restart.
        self._known = Counter(
            tuple(row)
            for row in self._db.execute(
                f'SELECT {", ".join(IDENTITY)} FROM event ORDER BY rowid DESC LIMIT {MOST_REPEATED}'  # noqa: E501
            )
        )

    def add(self, event: Mapping[str, Any]) -> bool:
        """
        Add a transition, unless it repeats one from before this start.

        :param event: values by the names in `COLUMNS`, but for `seen`.
        :return: whether it is new.
        """
        key = tuple(event[name] for name in IDENTITY)
        if self._known[key]:
            self._known[key] -= 1
            return False
        row = {**event, 'seen': time.time()}
        marks = ', '.join(f':{name}' for name in COLUMNS)
        with self._lock:
            self._db.execute(f'INSERT INTO event ({", ".join(COLUMNS)}) VALUES ({marks})', row)
            self._db.commit()
        return True

    def latest(self, valve: str | None = None, count: int = 200) -> list[Row]:
        """
        Return the latest transitions, newest first.

        :param valve: of this valve only.
        :param count: at most so many.
        :return: rows by the names in `COLUMNS`.
        """
        where = '' if valve is None else 'WHERE valve = ?'
        values = (count,) if valve is None else (valve, count)
        with self._lock:
            rows = self._db.execute(
                f'SELECT {", ".join(COLUMNS)} FROM event {where} ORDER BY rowid DESC LIMIT ?',
                values,
            ).fetchall()
        return [dict(zip(COLUMNS, row, strict=True)) for row in rows]

    def valves(self) -> list[str]:
        """
        List the valves that have a history.

        :return: names.
        """
        with self._lock:
            rows = self._db.execute('SELECT DISTINCT valve FROM event').fetchall()
        return sorted(row[0] for row in rows)

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._db.close()
