# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Trends of spring, preload and friction of each actuator, kept in files across restarts."""

import hashlib
import json
import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.record import Saved
from damadics_fd.store.file_names import file_name
from damadics_fd.store.slots import read_bounded, replace_file, set_aside
from damadics_fd.store.trend_fit import TimeToLimit, Trend, fit_recent

QUANTITIES = ('spring', 'preload', 'friction')
COLUMNS = 'stamp_ns,' + ','.join(f'{q},{q}_std' for q in QUANTITIES) + ',reference'
HEADER = f'{COLUMNS},crc32\n'
INTERVAL = 900.0  # [s] between two points; the slow set forgets within some minutes of motion
POINTS = 20_000  # a longer file is thinned when it is opened
LARGEST = 1e6  # of a value; what is beyond was never measured
LATEST = 2**31 * 10**9  # ns


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


def trend_path(folder: Path, actuator: str) -> Path:
    """
    Name the file of the trends of an actuator.

    :param folder: where the references are.
    :param actuator: tag.
    :return: path of the file, whether it is there or not.
    """
    return Path(folder) / f'{file_name(actuator)}.trend.csv'


def series_name(signature: Saved) -> str:
    """
    Name the series of the points that are measured against a reference.

    :param signature: the reference, as `Signature.save` returned it.
    :return: short hash of what was learned.
    """
    return hashlib.sha256(json.dumps(signature['theta']).encode()).hexdigest()[:16]


class TrendFile:
    """
    Keep the points of one actuator in a CSV file that only grows.

    Each line ends in its checksum. One that a crash has cut, or that holds what is never written,
    is skipped and counted in `unreadable`; what is no text file at all is moved aside. Points
    belong to the reference they were measured against; a new reference or a clock that was set
    back starts a new series.

    :param folder: where the references are; created where it is missing.
    :param actuator: tag; names the file.
    :param reference: identity of the reference, e.g. its hash.
    :param interval: [s] least time between two points.
    :raises OSError: where the file cannot be read, nor moved aside.
    """

    def __init__(
        self, folder: Path, actuator: str, reference: str, interval: float = INTERVAL
    ) -> None:
        if set(reference) & set(',\n\r'):
            raise ValueError(f'reference {reference!r} must not contain a comma or a line break')
        self.path = trend_path(folder, actuator)
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
        if not _plausible(stamp, change, std):
            return False
        t = stamp * 1e-9
        if self._rows and 0.0 <= t - self._rows[-1][0] < self.interval:
            return False
        values = [v for pair in zip(change, std, strict=True) for v in pair]
        self.path.parent.mkdir(parents=True, exist_ok=True)
        new = not self.path.exists()
        with self.path.open('a', encoding='utf-8') as file:
            file.write((HEADER if new else '') + _line(stamp, values, self.reference))
        self._append((t, *values))
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
        try:
            text = read_bounded(self.path).decode('utf-8', 'replace')
            if text and not text.startswith(COLUMNS[: len(text)]):
                raise ValueError('this is no file of trends')
        except FileNotFoundError:
            return
        except (OSError, ValueError):
            set_aside(self.path)
            self.unreadable += 1
            return
        for line in text.splitlines()[1:]:
            try:
                stamp, values, reference = _read(line)
            except ValueError:
                self.unreadable += 1
                continue
            if reference == self.reference:
                self._append((stamp * 1e-9, *values))
        if text and not text.endswith('\n'):
            with self.path.open('a', encoding='utf-8') as file:
                file.write('\n')  # the next point must not continue a line that was cut
        if len(self._rows) > POINTS:
            self._thin()

    def _thin(self) -> None:
        """Keep every second point of the older half."""
        half = len(self._rows) // 2
        self._rows = self._rows[:half:2] + self._rows[half:]
        lines = [_line(round(t * 1e9), values, self.reference) for t, *values in self._rows]
        replace_file(self.path, HEADER + ''.join(lines))


@dataclass(frozen=True)
class Point:
    """One line of a file of trends: change and standard deviation by QUANTITIES."""

    stamp: int  # ns
    change: tuple[float, ...]
    std: tuple[float, ...]
    reference: str


def read_points(path: Path) -> list[Point]:
    """
    Read all points of a file of trends, whatever they were measured against.

    :param path: of the file; it is not changed.
    :return: in the order of the file; lines that cannot be read are left out.
    :raises OSError: where the file cannot be read, or is too large.
    """
    points = []
    for line in read_bounded(path).decode('utf-8', 'replace').splitlines()[1:]:
        try:
            stamp, values, reference = _read(line)
        except ValueError:
            continue
        points.append(Point(stamp, tuple(values[::2]), tuple(values[1::2]), reference))
    return points


def _line(stamp: int, values: Sequence[float], reference: str) -> str:
    numbers = ','.join(f'{v:.6g}' for v in values)
    text = f'{stamp},{numbers},{reference}'
    return f'{text},{zlib.crc32(text.encode()):08x}\n'


def _read(line: str) -> tuple[int, list[float], str]:
    """
    Read one line, of version 0.1 without its checksum too.

    :raises ValueError: where it is not what `_line` writes.
    """
    words = line.split(',')
    if len(words) == 3 + 2 * len(QUANTITIES):
        text, _, check = line.rpartition(',')
        if check != f'{zlib.crc32(text.encode()):08x}':
            raise ValueError('its checksum does not fit')
        words.pop()
    stamp, *numbers, reference = words
    values = [float(word) for word in numbers]
    if len(values) != 2 * len(QUANTITIES):
        raise ValueError('numbers are missing')
    if not _plausible(int(stamp), values[::2], values[1::2]):
        raise ValueError('no such point is ever written')
    return int(stamp), values, reference


def _plausible(stamp: int, change: Sequence[float], std: Sequence[float]) -> bool:
    """Tell whether a point may be a measurement."""
    values = (*change, *std)
    return (
        abs(stamp) <= LATEST
        and all(math.isfinite(v) and abs(v) <= LARGEST for v in values)
        and min(std) > 1.0 / LARGEST
    )
