# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Samples in from files that grow."""

import asyncio
import math
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from zoneinfo import ZoneInfo

from damadics_fd.core.sample import SIGNALS
from damadics_fd.ros.diagnostics import Report

from damadics_connect.files.follow import Folder, FollowError, GrowingCsv, Row
from damadics_connect.health import report
from damadics_connect.joining import Joiner
from damadics_connect.publishing import Output
from damadics_connect.source_clock import NANO
from damadics_connect.valve_list import ValveSource

LOOK = 0.1  # s between two looks at the files
AT_ONCE = 2000  # rows before others have their turn
UNITS = {'s': NANO, 'ms': 1_000_000, 'us': 1000, 'ns': 1}
LATEST = 2**62  # ns
DISORDER = 60 * NANO  # ns by which rows of several writers may be out of order


class Stamps:
    """
    Reads the time of a row.

    :param column: its name.
    :param unit: `iso`, or one of UNITS since 1970.
    :param zone: of times without one; None: they are refused.
    """

    def __init__(self, column: str, unit: str, zone: ZoneInfo | None) -> None:
        self.column = column
        self._unit = unit
        self._zone = zone
        self._last = 0

    def of(self, row: Row) -> int:
        """
        Return the stamp of a row [ns].

        The hour that the end of daylight saving repeats is told apart by the order of the rows,
        in the first one by our own clock.

        :raises ValueError: where there is none.
        """
        text = row.get(self.column, '')
        if not text:
            raise ValueError(f'no {self.column}')
        if self._unit != 'iso':
            whole, _, part = text.replace(',', '.').partition('.')
            unit = UNITS[self._unit]
            part = (part + '0' * 9)[:9]
            if not (whole.lstrip('-').isdigit() and part.isdigit()):
                raise ValueError(f'{self.column} is not a number in {self._unit}')
            stamp = int(whole) * unit + int(part) * unit // NANO
        else:
            stamp = self._parsed(text)
        if not 0 <= stamp < LATEST:
            raise ValueError(f'{self.column} is out of range')
        self._last = stamp
        return stamp

    def _parsed(self, text: str) -> int:
        try:
            when = datetime.fromisoformat(text)
        except ValueError:
            raise ValueError(f'{self.column} is not ISO 8601') from None
        if when.tzinfo is None:
            if self._zone is None:
                raise ValueError(f'{self.column} has no time zone: give stamp.zone')
            when = when.replace(tzinfo=self._zone)
            first, second = _ns(when), _ns(when.replace(fold=1))
            if first != second and self._is_second(first, second):
                return second
        return _ns(when)

    def _is_second(self, first: int, second: int) -> bool:
        """Tell which of its two instants a time in the hour is that comes twice."""
        if not self._last:
            return 0 <= time.time_ns() - second < second - first  # it has been written just now
        return first + DISORDER < self._last < 2 * second - first


def _ns(when: datetime) -> int:
    since = when.astimezone(UTC) - datetime(1970, 1, 1, tzinfo=UTC)
    return ((since.days * 86_400 + since.seconds) * 1_000_000 + since.microseconds) * 1000


class Files:
    """
    The valves whose samples come from files.

    :param valves: in the order of the output's numbers; `place` is the file or folder.
    :param folder: where relative paths begin.
    :param from_end: leave out what is in the files at first.
    :param stamps: makes the reader of times for one file.
    :param output: takes the samples.
    :param log: takes what a person should know.
    """

    def __init__(
        self,
        valves: Sequence[ValveSource],
        folder: Path,
        from_end: bool,
        stamps: Callable[[], Stamps],
        output: Output,
        log: Callable[[str], None],
    ) -> None:
        self._output = output
        self._log = log
        self._problems: dict[str, str] = {}
        self._rows = 0
        self._joiners: dict[str, Joiner] = {}
        self._by_file: dict[Path, list[ValveSource]] = {}
        self._followed: dict[Path, GrowingCsv | Folder] = {}
        self._stamps = {}
        for number, valve in enumerate(valves):
            path = folder / Path(valve.place).expanduser()
            self._by_file.setdefault(path, []).append(valve)
            self._followed[path] = (
                Folder(path, from_end) if path.is_dir() else GrowingCsv(path, from_end)
            )
            self._stamps[path] = stamps()
            self._joiners[valve.name] = Joiner(
                int(valve.period * NANO),
                int(valve.period * NANO),
                tuple(signal.slot for signal in valve.signals),
                partial(output.send, number),
            )

    async def run(self) -> None:
        """Follow the files for ever."""
        now = time.monotonic_ns()
        for joiner in self._joiners.values():
            joiner.begin(now)
        while True:
            for path, followed in self._followed.items():
                try:
                    for n, row in enumerate(followed.rows(), 1):
                        self._take(path, row)
                        if n % AT_ONCE == 0:
                            self._output.flush()
                            await asyncio.sleep(0)
                    self._problems.pop(f'{path}', None)
                except FollowError as problem:
                    self._tell(f'{path}', str(problem))
            self._output.flush()
            await asyncio.sleep(LOOK)

    def report(self) -> Report:
        """Say how files and valves are."""
        problems = list(self._problems.values())[:5]
        values = {'Files': len(self._followed), 'Rows': self._rows}
        return report('', self._joiners, self._output, values, problems)

    def _take(self, path: Path, row: Row) -> None:
        self._rows += 1
        try:
            stamp = self._stamps[path].of(row)
        except ValueError as problem:
            self._tell(f'{path} time', f'{path.name}: row left out: {problem}')
            return
        self._problems.pop(f'{path} time', None)
        now = time.monotonic_ns()
        for valve in self._by_file[path]:
            joiner = self._joiners[valve.name]
            for signal in valve.signals:
                key = SIGNALS[signal.slot]
                value = math.nan
                if signal.source not in row:
                    joiner.tally.bad[key] = f'no column {signal.source[:40]}, or two of it'
                elif (text := row[signal.source]) and (number := number_of(text)) is None:
                    joiner.tally.bad[key] = f'{text[:20]!r} is no number'
                else:
                    joiner.tally.bad.pop(key, None)
                    value = number if text and number is not None else math.nan
                joiner.take(signal.slot, stamp, signal.scale(value), now)

    def _tell(self, key: str, text: str) -> None:
        if self._problems.get(key) != text:
            self._log(text)
        self._problems[key] = text


def number_of(text: str) -> float | None:
    """
    Read a number, with a decimal point or comma.

    :param text: of a cell.
    :return: None where it is none.

    >>> number_of('0,5'), number_of('1.5e3'), number_of('n/a')
    (0.5, 1500.0, None)
    """
    try:
        return float(text.replace(',', '.') if ',' in text and '.' not in text else text)
    except ValueError:
        return None
