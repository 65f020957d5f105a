# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Points of the long trends, out of what the page hears of every valve."""

import math
import sqlite3
import time
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from damadics_fd.core.stamps import SECOND as NANO
from damadics_fd.store.file_names import file_name
from damadics_fd.store.intervals import DAY, LEVELS, Intervals, Spread
from damadics_fd.store.trends import QUANTITIES, read_points, trend_path
from damadics_msgs.msg import Signature

from damadics_dashboard.live.motion import Motion
from damadics_dashboard.live.valve import Valve

DATED = 1e8  # s; smaller times count from the start of a simulation
WATCHING = (Signature.STATE_MONITOR, Signature.STATE_ALARM)


class _Valve:
    """What was gathered of one valve since the last point."""

    def __init__(self) -> None:
        self.values: dict[str, list[float]] = defaultdict(list)
        self.std: dict[str, float] = {}
        self.motion = Motion()
        self.seen = -1  # ns, stamp of the last position that was looked at
        self.signature: Signature | None = None
        self.caught_up = ''  # tag under which the detector has kept what was taken over


class TrendPoints:
    """
    Gathers values every second and writes a point for every quarter of an hour.

    :param intervals: takes the points.
    :param folders: where detectors keep trends of their own, with or without a page (their
        `signature_folder`, or one with a folder per valve): what they hold of the time before a
        valve was first heard is taken over.
    """

    def __init__(self, intervals: Intervals, folders: Sequence[Path] = ()) -> None:
        self.intervals = intervals
        self._folders = tuple(folders)
        self.problem = intervals.problem
        self._valves: dict[str, _Valve] = defaultdict(_Valve)
        self._began = self._interval()
        self._forgot = 0.0

    def take(self, valve: Valve) -> None:
        """
        Gather the present values of a valve.

        :param valve: the valve.
        """
        mine = self._valves[valve.name]
        if valve.tag != mine.caught_up:
            self._catch_up(valve.name, valve.tag)
            mine.caught_up = valve.tag
        signature = valve.signature
        if signature is not None and signature is not mine.signature:
            mine.signature = signature
            self._take_signature(mine, signature)
        if not valve.sampled:
            return
        trace = valve.traces['measurement']
        if trace.newest > mine.seen or trace.newest < mine.seen - NANO:
            rows = trace.since(mine.seen + 1 if trace.newest > mine.seen else 0)
            mine.seen = trace.newest
            mine.motion.take(rows['stamp'] / NANO, np.asarray(rows['x1'], np.float64))

    def keep(self, now: float, *, force: bool = False) -> None:
        """
        Write the points of an interval that is over.

        :param now: monotonic time [s].
        :param force: also where it is not over.
        """
        present = self._interval()
        if present == self._began and not force:
            return
        try:
            for name, mine in self._valves.items():
                self._write(name, mine)
            if now - self._forgot > DAY or not self._forgot:
                self.intervals.forget(time.time())
                self._forgot = now
        except sqlite3.Error as problem:
            self.problem = f'trends are not written, tried again: {problem}'
            return
        self.problem = ''
        self._began = present

    def _catch_up(self, name: str, tag: str) -> None:
        """Take over what the detector has kept while no page was there."""
        try:
            first, last = self.intervals.span(name) or (math.inf, -math.inf)
            own = file_name(name.replace('/', '__') or 'root')
            places = [p for folder in self._folders for p in (folder, folder / own)]
            for path in (trend_path(place, tag) for place in places):
                if not path.is_file():
                    continue
                for point in read_points(path):
                    start = point.stamp / NANO // LEVELS[0] * LEVELS[0]
                    if start >= DATED and not first <= start <= last:
                        values = dict(zip(QUANTITIES, point.change, strict=True))
                        std = dict(zip(QUANTITIES, point.std, strict=True))
                        self.intervals.add(name, start, values, std, point.reference)
        except (OSError, sqlite3.Error) as problem:
            self.problem = f'earlier trends of {name} are not taken over: {problem}'

    def close(self) -> None:
        """Write what there is and close the file."""
        self.keep(time.monotonic(), force=True)
        self.intervals.close()

    @staticmethod
    def _interval() -> int:
        return int(time.time() // LEVELS[0])

    @staticmethod
    def _take_signature(mine: _Valve, signature: Signature) -> None:
        if signature.state not in WATCHING:
            return
        for name, value, std in zip(
            QUANTITIES, signature.change, signature.change_std, strict=True
        ):
            mine.values[name].append(float(value))
            mine.std[name] = float(std)
        if signature.stick_ratio > 0.0:
            mine.values['play'].append(float(signature.stick_ratio))
        mine.values['supply'].append(float(signature.fill))

    def _write(self, name: str, mine: _Valve) -> None:
        values: dict[str, float | Spread] = {}
        for quantity, several in mine.values.items():
            good = [v for v in several if math.isfinite(v)]
            if good:
                values[quantity] = min(good), sum(good) / len(good), max(good)
        motion = mine.motion
        if motion.seconds > 60.0:
            hours = motion.seconds / 3600.0
            values['travel'] = motion.travel / hours
            values['reversals'] = motion.reversals / hours
            values['cycles'] = motion.cycles / hours
            values['unstroked'] = mine.seen / NANO - motion.last_full
        reference = ''
        if mine.signature is not None:
            reference = ','.join(f'{v:.6g}' for v in mine.signature.theta)
        self.intervals.add(name, self._began * LEVELS[0], values, mine.std, reference)
        mine.values.clear()
        mine.std.clear()
        motion.reset()
