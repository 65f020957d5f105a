# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What changes over days to years: least, mean and greatest of intervals, in one SQLite file."""

import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from damadics_fd.store.databases import open_database

TRENDED = (
    'spring',
    'preload',
    'friction',
    'play',
    'travel',
    'reversals',
    'cycles',
    'unstroked',
    'supply',
)
STATISTICS = ('least', 'mean', 'greatest', 'std')
ROW = np.dtype((np.float32, (len(TRENDED), len(STATISTICS))))
DAY = 86400
LEVELS = (900, 3600, DAY)  # s, lengths of the intervals
KEPT = (90 * DAY, 730 * DAY, math.inf)  # s, how long the intervals of each length are kept
MOST_POINTS = 4000  # of a curve, before longer intervals are taken
NAN = math.nan
Spread = tuple[float, float, float]  # least, mean, greatest
TABLES = {
    'valve': {'id': 'INTEGER PRIMARY KEY', 'name': 'TEXT UNIQUE'},
    'reference': {'id': 'INTEGER PRIMARY KEY', 'name': 'TEXT UNIQUE'},
} | {
    f'point_{level}': {
        'valve': 'INTEGER',
        'start': 'INTEGER',
        'count': 'INTEGER',
        'reference': 'INTEGER',
        'data': 'BLOB, PRIMARY KEY (valve, start)',
    }
    for level in LEVELS
}


@dataclass(frozen=True)
class Series:
    """One quantity of one valve over time; NaN where nothing was measured."""

    start: NDArray[np.float64]  # [s], of each interval
    length: float  # [s] of the intervals
    least: NDArray[np.float64]
    mean: NDArray[np.float64]
    greatest: NDArray[np.float64]
    std: NDArray[np.float64]  # mean standard deviation of the single values
    reference: list[str]  # that they were measured against


class Intervals:
    """
    Intervals of 15 min, an hour and a day of many valves.

    An interval is merged from the points that fall into it, so that points may come in any order;
    longer intervals are made of the same points at once, and are kept longer.

    :param path: the file; it is made where it is missing.
    """

    def __init__(self, path: Path) -> None:
        self._lock = threading.Lock()
        self._db, self.problem = open_database(path, TABLES)
        self._ids: dict[tuple[str, str], int] = {}

    def add(
        self,
        valve: str,
        stamp: float,
        values: Mapping[str, float | Spread],
        std: Mapping[str, float] | None = None,
        reference: str = '',
    ) -> None:
        """
        Add a point to its intervals.

        :param valve: name of the valve.
        :param stamp: time [s].
        :param values: by the names in TRENDED, or least, mean and greatest of several; what is
            not finite is left out.
        :param std: standard deviations of some of them.
        :param reference: what they were measured against.
        :raises sqlite3.Error: where the file cannot be written.
        """
        point = np.full(ROW.shape, NAN, np.float32)
        for n, name in enumerate(TRENDED):
            value = values.get(name, NAN)
            least, mean, greatest = value if isinstance(value, tuple) else (value,) * 3
            if math.isfinite(least) and math.isfinite(mean) and math.isfinite(greatest):
                point[n] = least, mean, greatest, (std or {}).get(name, NAN)
        if not math.isfinite(stamp) or stamp < 0.0 or np.isnan(point[:, 1]).all():
            return
        with self._lock, self._db:
            who, what = self._id('valve', valve), self._id('reference', reference)
            for level in LEVELS:
                self._merge(level, who, int(stamp // level) * level, what, point)

    def series(self, valve: str, quantity: str, since: float, until: float) -> Series:
        """
        Return a quantity over time, of the shortest intervals that are few enough.

        :param valve: name of the valve.
        :param quantity: one of TRENDED.
        :param since: from this time on [s].
        :param until: to this time [s].
        :return: the intervals in which something was measured.
        """
        place = TRENDED.index(quantity)
        level = self._level(valve, since, until)
        with self._lock:
            rows = self._db.execute(
                f'SELECT start, data, reference.name FROM point_{level} '
                f'JOIN valve ON valve.id = point_{level}.valve '
                f'JOIN reference ON reference.id = point_{level}.reference '
                'WHERE valve.name = ? AND start >= ? AND start <= ? ORDER BY start',
                (valve, int(since) - level, until),
            ).fetchall()
        data = np.frombuffer(b''.join(row[1] for row in rows), np.float32)
        values = data.reshape(-1, *ROW.shape)[:, place].astype(np.float64)
        good = np.isfinite(values[:, 1])
        start = np.array([row[0] for row in rows], np.float64)[good]
        least, mean, greatest, std = values[good].T
        references = [row[2] for row, keep in zip(rows, good, strict=True) if keep]
        return Series(start, float(level), least, mean, greatest, std, references)

    def valves(self) -> list[str]:
        """
        List the valves that have a trend.

        :return: names.
        """
        with self._lock:
            return sorted(row[0] for row in self._db.execute('SELECT name FROM valve'))

    def span(self, valve: str) -> tuple[float, float] | None:
        """
        Return the time that a trend covers.

        :param valve: name of the valve.
        :return: start of the first and of the last interval [s]; None where there is none.
        """
        first: float | None = None
        last: float | None = None
        longer = math.inf
        with self._lock:
            for level in reversed(LEVELS):
                row = self._db.execute(
                    f'SELECT min(start), max(start) FROM point_{level} '
                    f'JOIN valve ON valve.id = point_{level}.valve WHERE valve.name = ?',
                    (valve,),
                ).fetchone()
                if row[0] is not None:
                    # shorter intervals tell it better, but are not kept as long
                    first = row[0] if first is None or row[0] < first + longer else first
                    last = row[1] if last is None else max(last, row[1])
                    longer = level
        return None if first is None or last is None else (float(first), float(last))

    def forget(self, now: float) -> None:
        """
        Drop the intervals that are kept no longer; longer ones tell of their time.

        :param now: present time [s].
        :raises sqlite3.Error: where the file cannot be written.
        """
        with self._lock, self._db:
            for level, kept in zip(LEVELS, KEPT, strict=True):
                if math.isfinite(kept):
                    self._db.execute(f'DELETE FROM point_{level} WHERE start < ?', (now - kept,))

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._db.close()

    def _level(self, valve: str, since: float, until: float) -> int:
        """Choose the shortest intervals that reach back far enough and are not too many."""
        whole = self.span(valve)
        if whole is None:
            return LEVELS[-1]
        since, until = max(since, whole[0]), min(until, whole[1] + LEVELS[-1])
        for level in LEVELS[:-1]:
            with self._lock:
                (first,) = self._db.execute(
                    f'SELECT min(start) FROM point_{level} '
                    f'JOIN valve ON valve.id = point_{level}.valve WHERE valve.name = ?',
                    (valve,),
                ).fetchone()
            few = (until - since) / level <= MOST_POINTS
            if few and first is not None and first < since + LEVELS[-1]:
                return level
        return LEVELS[-1]

    def _id(self, table: str, name: str) -> int:
        if (table, name) not in self._ids:
            self._db.execute(f'INSERT OR IGNORE INTO {table} (name) VALUES (?)', (name,))
            row = self._db.execute(f'SELECT id FROM {table} WHERE name = ?', (name,)).fetchone()
            self._ids[table, name] = int(row[0])
        return self._ids[table, name]

    def _merge(
        self, level: int, valve: int, start: int, reference: int, point: NDArray[np.float32]
    ) -> None:
        row = self._db.execute(
            f'SELECT count, reference, data FROM point_{level} WHERE valve = ? AND start = ?',
            (valve, start),
        ).fetchone()
        count, data = 1, point
        if row is not None and row[1] == reference:
            count = row[0] + 1
            data = merged(np.frombuffer(row[2], np.float32).reshape(ROW.shape), row[0], point)
        self._db.execute(
            f'INSERT OR REPLACE INTO point_{level} (valve, start, count, reference, data) '
            'VALUES (?, ?, ?, ?, ?)',
            (valve, start, count, reference, data.astype(np.float32).tobytes()),
        )


def merged(
    old: NDArray[np.float32], count: int, point: NDArray[np.float32]
) -> NDArray[np.float32]:
    """
    Put a point into an interval.

    :param old: least, mean, greatest and standard deviation of each quantity, (quantities, 4).
    :param count: points in it so far.
    :param point: the same of the point.
    :return: the interval with the point in it.
    """
    new = np.where(np.isnan(old), point, old)
    both = np.isfinite(old) & np.isfinite(point)
    new[:, 0] = np.where(both[:, 0], np.fmin(old[:, 0], point[:, 0]), new[:, 0])
    new[:, 2] = np.where(both[:, 2], np.fmax(old[:, 2], point[:, 2]), new[:, 2])
    for n in (1, 3):
        mean = old[:, n] + (point[:, n] - old[:, n]) / (count + 1)
        new[:, n] = np.where(both[:, n], mean, new[:, n])
    return new.astype(np.float32)
