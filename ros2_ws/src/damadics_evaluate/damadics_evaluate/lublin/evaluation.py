# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every detector on every recorded day and actuator."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date

from damadics_evaluate.alarms import Alarm
from damadics_evaluate.columns import NANOSECONDS, Columns, cut
from damadics_evaluate.lublin.files import ACTUATORS, Record
from damadics_evaluate.lublin.judge import Outcome, false_alarms, outcomes
from damadics_evaluate.lublin.schedule import (
    DAYS,
    LEARN_S,
    SCHEDULE,
    Induced,
    events_of,
    first_event,
)
from damadics_evaluate.watching import watch


@dataclass(frozen=True)
class Learned:
    """
    The fault-free stretch a detector learns from.

    :param start: first second of the day.
    :param end: last second; alarms count from here on.
    """

    start: float
    end: float


@dataclass(frozen=True)
class Quiet:
    """
    The false alarms of one detector on one actuator and day.

    :param day: date.
    :param actuator: 1, 2 or 3.
    :param detector: name.
    :param alarms: that no event excuses.
    :param hours: recorded after the learning stretch.
    """

    day: date
    actuator: int
    detector: str
    alarms: tuple[Alarm, ...]
    hours: float


@dataclass
class Evaluation:
    """
    The whole table.

    :param detectors: names in the order of the columns.
    :param learned: the fault-free stretch of every day and actuator.
    :param outcomes: one per event and detector.
    :param quiet: one per day, actuator and detector.
    :param absent: events that no file covers.
    :param refused: detector and what it did, one line each.
    """

    detectors: tuple[str, ...]
    learned: dict[tuple[date, int], Learned] = field(default_factory=dict)
    outcomes: list[Outcome] = field(default_factory=list)
    quiet: list[Quiet] = field(default_factory=list)
    absent: list[Induced] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)


def evaluate(
    record: Record,
    detectors: Sequence[str],
    learn: Mapping[date | None, Learned],
    progress: Callable[[str], None],
) -> Evaluation:
    """
    Run all detectors over all recorded days that hold events.

    :param record: columns by day and actuator.
    :param detectors: names.
    :param learn: fault-free stretches that the user states, by day; None for every day.
    :param progress: told what is being done.
    :return: the table.
    :raises ValueError: where no file covers a day of the schedule.
    """
    table = Evaluation(tuple(detectors))
    table.absent = [e for e in SCHEDULE if not _covered(record.get((e.day, e.actuator)), e)]
    if len(table.absent) == len(SCHEDULE):
        days = ', '.join(sorted({day.isoformat() for day, _ in record}))
        raise ValueError(
            f'none of the {len(SCHEDULE)} events is in these files (days: {days}); they lie on '
            + ', '.join(day.isoformat() for day in DAYS)
        )
    for (day, actuator), columns in sorted(record.items(), key=lambda item: item[0]):
        if day not in DAYS or actuator not in ACTUATORS:
            continue
        events = [e for e in events_of(day, actuator) if e not in table.absent]
        stretch = learn.get(day) or learn.get(None) or default_stretch(columns, day)
        table.learned[day, actuator] = stretch
        for name in detectors:
            progress(f'{day} actuator {actuator}: {name}')
            try:
                alarms = _alarms(name, columns, stretch)
            except (ValueError, ArithmeticError, LookupError, TypeError) as error:
                table.refused.append(f'{name} on {day}, actuator {actuator}: {error}')
                continue
            end = float(columns['stamp'][-1]) / NANOSECONDS
            table.outcomes += outcomes(name, events, alarms)
            wrong = false_alarms(events, alarms, stretch.end, end)
            hours = float((columns['stamp'] > stretch.end * NANOSECONDS).sum()) / 3600.0
            table.quiet.append(Quiet(day, actuator, name, tuple(wrong), hours))
    return table


def _alarms(name: str, columns: Columns, stretch: Learned) -> list[Alarm]:
    """Return the alarms of one detector after the stretch; what lies before is left out."""
    record = cut(columns, stretch.start, math.inf)
    learning = cut(record, stretch.start, stretch.end - 0.5)
    try:
        return watch(name, learning, record, stretch.end)
    except ValueError as error:
        where = f'learned on {stretch.start:.0f}-{stretch.end:.0f} s'
        raise ValueError(f'{error} ({where}; state another: --learn START-END)') from error


def default_stretch(columns: Columns, day: date) -> Learned:
    """
    Return the stretch to learn from where the user states none.

    :param columns: record of the day.
    :param day: date of the schedule.
    :return: the 900 s before the day's first event in any actuator, or the first 900 s of the
        record where that part of the day is not recorded.
    """
    end = first_event(day)
    t = columns['stamp'] / NANOSECONDS
    recorded = int(((t >= end - LEARN_S) & (t < end)).sum())
    if recorded >= LEARN_S // 2:
        return Learned(end - LEARN_S, end)
    return Learned(float(t[0]), float(t[0]) + LEARN_S)


def _covered(columns: Columns | None, event: Induced) -> bool:
    """Tell whether at least the beginning of an event was recorded."""
    if columns is None:
        return False
    t = columns['stamp'] / NANOSECONDS
    end = min(event.end, event.start + LEARN_S)
    return bool(((t >= event.start) & (t <= end)).any())
