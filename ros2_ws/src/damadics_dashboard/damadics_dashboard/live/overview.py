# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""All valves at a glance: looked at once, for all the pages that are open."""

import json
import math
import time
from collections.abc import Callable, Mapping

from damadics_dashboard.live.valve import Alarm, Condition, Valve

FRESH = 0.1  # s for which a look serves other pages too
Place = tuple[str, str]  # area and title, by which valves are sorted


class Overview:
    """
    What the overview shows of the valves.

    :param valves: by name.
    :param clock: returns the ROS time [ns].
    """

    def __init__(self, valves: Mapping[str, Valve], clock: Callable[[], int]) -> None:
        self._valves = valves
        self._clock = clock
        self.looked = -1e9  # monotonic time [s]
        self.clock = 0  # ROS time then [ns]
        self.valves: list[Valve] = []  # by area and title
        self.places: list[Place] = []
        self.conditions: list[Condition] = []
        self.alarms: dict[str, Alarm] = {}  # by name of the valve
        self._columns = ''

    def look(self, now: float | None = None) -> None:
        """
        Look at all valves, unless somebody has just done so.

        :param now: monotonic time, of this moment by default [s].
        """
        now = time.monotonic() if now is None else now
        if 0.0 <= now - self.looked < FRESH:
            return
        self.looked, self.clock = now, self._clock()
        clock = self.clock
        self._sort()
        self.conditions = [valve.condition(now, clock) for valve in self.valves]
        found = ((valve.name, valve.alarm()) for valve in self.valves if valve.flag is not None)
        self.alarms = {name: alarm for name, alarm in found if alarm is not None}
        self._columns = ''

    @property
    def columns(self) -> str:
        """
        Ages [s] and residuals [percent of the limit] of all valves, for `damadics.fleet`, as JSON.

        A residual is -1 where it means nothing.
        """
        if not self._columns:
            ages = [valve.age(self.looked, self.clock) for valve in self.valves]
            shares = [
                round(100.0 * ratio)
                if math.isfinite(ratio := ratio_of(valve)) and of.kind == 'ok'
                else -1
                for valve, of in zip(self.valves, self.conditions, strict=True)
            ]
            known = [None if age is None else round(age, 1) for age in ages]
            self._columns = json.dumps(
                {'ages': known, 'shares': shares}, separators=(',', ':'), allow_nan=False
            )
        return self._columns

    def _sort(self) -> None:
        valves = tuple(self._valves.values())
        if len(valves) == len(self.valves):
            places = [(valve.area, valve.title) for valve in self.valves]
            if places == self.places:
                return
        self.valves = sorted(valves, key=lambda valve: (valve.area, valve.title))
        self.places = [(valve.area, valve.title) for valve in self.valves]


def ratio_of(valve: Valve) -> float:
    """
    Return the largest residual of the last second, against its limit.

    :param valve: the valve.
    :return: residual / threshold.
    """
    flag = valve.flag
    if flag is None or flag.threshold <= 0.0:
        return valve.ratio
    return max(valve.ratio, flag.residual / flag.threshold)
