# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The official schedule of the faults induced in October and November 2001."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import date

LEARN_S = 900
BEFORE_LABEL = 10.0
"""The labels are kept by hand: the first sign may come that much earlier, s."""
AFTER_EVENT = 120.0
"""The plant is far from normal for that long after an event; nothing is counted, s."""


@dataclass(frozen=True)
class Induced:
    """
    One induced fault.

    :param item: number in the schedule.
    :param actuator: 1, 2 or 3.
    :param day: date.
    :param start: first second of the day.
    :param end: last second of the day, infinite where the schedule leaves it open.
    :param fault: as the benchmark numbers faults.
    :param counts: false where an alarm neither counts as found nor as false.
    """

    item: int
    actuator: int
    day: date
    start: float
    end: float
    fault: str
    counts: bool = True

    def covers(self, t: float) -> bool:
        """Tell whether an alarm at a second of the day finds the event."""
        return self.start - BEFORE_LABEL <= t <= self.end

    def excuses(self, t: float) -> bool:
        """Tell whether an alarm at a second of the day is not counted as false."""
        return self.start - BEFORE_LABEL <= t <= self.end + AFTER_EVENT


def _day(text: str) -> date:
    return date.fromisoformat(f'2001-{text}')


SCHEDULE = (
    Induced(1, 1, _day('10-30'), 58800, 59800, 'f18'),
    Induced(2, 1, _day('11-09'), 57275, 57550, 'f16'),
    Induced(3, 1, _day('11-09'), 58830, 58930, 'f18'),
    Induced(4, 1, _day('11-09'), 58520, 58625, 'f18'),
    Induced(5, 1, _day('11-17'), 54600, 54700, 'f18'),
    Induced(6, 1, _day('11-17'), 56670, 56770, 'f16'),
    Induced(7, 1, _day('11-20'), 37780, 38400, 'f17'),
    Induced(8, 2, _day('11-17'), 53780, 53794, 'f17'),
    Induced(9, 2, _day('11-17'), 54193, 54215, 'f17'),
    # the record of the flow is fault-free: what it shows is the loop's answer
    Induced(10, 2, _day('11-17'), 55482, 55517, 'f19', counts=False),
    Induced(11, 2, _day('11-17'), 55977, 56015, 'f19', counts=False),
    Induced(12, 2, _day('11-17'), 57030, 57072, 'f19', counts=False),
    Induced(13, 2, _day('11-20'), 44400, math.inf, 'f17'),
    Induced(14, 3, _day('10-30'), 57340, 57890, 'f18'),
    Induced(15, 3, _day('11-09'), 60650, 60700, 'f16'),
    Induced(16, 3, _day('11-09'), 60870, 60960, 'f16'),
    Induced(17, 3, _day('11-17'), 57475, 57530, 'f16'),
    Induced(18, 3, _day('11-17'), 57675, 57800, 'f16'),
    Induced(19, 3, _day('11-17'), 58150, 58325, 'f19'),
)
DAYS = tuple(sorted({event.day for event in SCHEDULE}))


def events_of(day: date, actuator: int) -> list[Induced]:
    """Return the events of one actuator on one day, in order of time."""
    found = [e for e in SCHEDULE if e.day == day and e.actuator == actuator]
    return sorted(found, key=lambda event: event.start)


def first_event(day: date) -> float:
    """
    Return when the first fault of a day was induced, in any actuator.

    :raises ValueError: on days on which there was none.
    """
    starts = [event.start for event in SCHEDULE if event.day == day]
    if not starts:
        raise ValueError(f'no fault was induced on {day}: the days are {texts(DAYS)}')
    return min(starts)


def texts(days: Iterable[date]) -> str:
    """Return dates as text."""
    return ', '.join(day.isoformat() for day in days)
