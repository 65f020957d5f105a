# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Trends of spring, preload and friction of each actuator, kept in files across restarts."""

import hashlib
import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.signature.trend import TimeToLimit, Trend, fit_recent

QUANTITIES = ('spring', 'preload', 'friction')
HEADER = 'stamp_ns,' + ','.join(f'{q},{q}_std' for q in QUANTITIES) + ',reference\n'
INTERVAL = 900.0  # [s] between two points; the slow set forgets within some minutes of motion
POINTS = 20_000  # a longer file is thinned when it is opened


@dataclass(frozen=True)
class Outlook:
    """Hold what the trend of one quantity says."""

    quantity: str
    trend: Trend
    value: float  # of the line, now
    std: float
    limit: float  # the limit that the trend runs into
    time: TimeToLimit

    def sentence(self) -> str:
        """
        Say it to a person.

        :return: one sentence.
        """
        now = f'{self.quantity} {self.value:+.3g} +- {2.0 * self.std:.2g}'
        if math.isinf(self.time.expected):
            return f'{now}, not moving towards its limit {self.limit:g}'
        if self.time.expected == 0.0:
            return f'{now}, beyond its limit {self.limit:g}'
        return (
            f'{now}, limit {self.limit:g} in {_span(self.time.expected)} '
            f'({_span(self.time.earliest)} to {_span(self.time.latest)})'
        )


def _span(seconds: float) -> str:
    if math.isinf(seconds):
        return 'never'
    for unit, size in (('days', 86400.0), ('h', 3600.0), ('min', 60.0)):
        if seconds >= 2.0 * size:
            return f'{seconds / size:.0f} {unit}'
    return f'{seconds:.0f} s'


def series_name(signature: Mapping[str, Any]) -> str:
    """
    Name the series of the points that are measured against a reference.

    :param signature: the reference, as `Signature.save` returned it.
    :return: short hash of what was learned.
    """
    return hashlib.sha256(json.dumps(signature['theta']).encode()).hexdigest()[:16]


class TrendFile:
    """
    Keep the points of one actuator in a CSV file that only grows.

    A line that a crash has cut is skipped and counted in `unreadable`. Points belong to the
    reference they were measured against; a new reference or a clock that was set back starts
    a new series.

    :param folder: where the references are; created where it is missing.
    :param actuator: tag; also the name of the file.
    :param reference: identity of the reference, e.g. its hash.
    :param interval: [s] least time between two points.
    :raises ValueError: if the tag cannot be part of a file name.
    """

    def __init__(
        self, folder: Path, actuator: str, reference: str, interval: float = INTERVAL
    ) -> None:
        if not actuator or set(actuator) & set('/\\\0') or actuator in ('.', '..'):
            raise ValueError(
                f'actuator tag {actuator!r} cannot be part of a file name; '
                'use letters, digits, "_" and "-"'
            )
        if set(reference) & set(',\n\r'):
            raise ValueError(f'reference {reference!r} must not contain a comma or a line break')
        self.path = Path(folder) / f'{actuator}.trend.csv'
        self.reference = reference
        self.interval = interval
        self.unreadable = 0
        self._rows: list[tuple[float, ...]] = []
        self._load()

    def add(self, stamp: int, change: Sequence[float], std: Sequence[float]) -> bool:
        """
        Add a point if the last one is old enough.

        :param stamp: [ns] of the measurement.
        :param change: spring, preload, friction against the reference.
        :param std: their standard deviations.
        :return: True if the point was written.
        :raises OSError: if the file cannot be written.
        """
        if not all(map(math.isfinite, (*change, *std))) or min(std) <= 0.0:
            return False
        t = stamp * 1e-9
        if self._rows and 0.0 <= t - self._rows[-1][0] < self.interval:
            return False
        pairs = ','.join(f'{c:.6g},{s:.3g}' for c, s in zip(change, std, strict=True))
        self.path.parent.mkdir(parents=True, exist_ok=True)
        new = not self.path.exists()
        with self.path.open('a', encoding='utf-8') as file:
            file.write((HEADER if new else '') + f'{stamp},{pairs},{self.reference}\n')
        self._append((t, *(v for pair in zip(change, std, strict=True) for v in pair)))
        return True

    def points(self, quantity: str) -> tuple[NDArray[np.float64], ...]:
        """
        Return the series of one quantity against the present reference.

        :param quantity: one of QUANTITIES.
        :return: times [s], values, standard deviations.
        """
        k = 1 + 2 * QUANTITIES.index(quantity)
        rows = np.array(self._rows, np.float64).reshape(-1, 1 + 2 * len(QUANTITIES))
        return rows[:, 0], rows[:, k], rows[:, k + 1]

    def outlook(self, limits: Mapping[str, Sequence[float]], now: float) -> list[Outlook]:
        """
        Hold the trends against limits.

        :param limits: per quantity the limits, e.g. `{'friction': [-0.5, 3.0]}`.
        :param now: [s] present time.
        :return: one outlook per quantity that has enough points; the limit that comes first.
        """
        found = []
        for quantity, values in limits.items():
            trend = fit_recent(*self.points(quantity))
            if trend is None or not values:
                continue
            value, std = trend.at(now)
            times = [(trend.time_to(limit, now), limit) for limit in values]
            time, limit = min(times, key=lambda pair: (pair[0].expected, pair[0].earliest))
            found.append(Outlook(quantity, trend, value, std, limit, time))
        return found

    def _append(self, row: tuple[float, ...]) -> None:
        if self._rows and row[0] < self._rows[-1][0]:
            self._rows.clear()  # the clock was set back
        self._rows.append(row)

    def _load(self) -> None:
        if not self.path.exists():
            return
        text = self.path.read_text(encoding='utf-8', errors='replace')
        for line in text.splitlines()[1:]:
            *numbers, reference = line.split(',')
            try:
                stamp, *values = map(float, numbers)
            except ValueError:
                self.unreadable += 1
                continue
            if len(values) != 2 * len(QUANTITIES):
                self.unreadable += 1
            elif reference == self.reference:
                self._append((stamp * 1e-9, *values))
        if text and not text.endswith('\n'):
            with self.path.open('a', encoding='utf-8') as file:
                file.write('\n')  # the next point must not continue a line that was cut
        if len(self._rows) > POINTS:
            self._thin()

    def _thin(self) -> None:
        """Keep every second point of the older half; the replacement is atomic."""
        half = len(self._rows) // 2
        self._rows = self._rows[:half:2] + self._rows[half:]
        temporary = self.path.with_suffix('.tmp')
        with temporary.open('w', encoding='utf-8') as file:
            file.write(HEADER)
            for t, *values in self._rows:
                numbers = ','.join(f'{v:.6g}' for v in values)
                file.write(f'{round(t * 1e9)},{numbers},{self.reference}\n')
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(self.path)
