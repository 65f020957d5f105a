# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a detector's alarms are worth against the schedule: found, missed, false."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from damadics_evaluate.columns import Floats
from damadics_evaluate.lublin.schedule import Induced

CLEAR_S = 30.0
"""An alarm ends when its statistic has been below the limit for that long, s."""


@dataclass(frozen=True)
class Alarm:
    """
    One alarm.

    :param start: when it was raised, s.
    :param end: when it ended, s.
    :param cause: what the detector named, empty where it names nothing.
    """

    start: float
    end: float
    cause: str = ''


@dataclass(frozen=True)
class Outcome:
    """
    What became of one event with one detector.

    :param event: of the schedule.
    :param detector: name.
    :param t_dt: from the label to the alarm, s; negative before the label; NaN if not found.
    :param cause: what was named.
    :param note: why it was not found, where that needs a word.
    """

    event: Induced
    detector: str
    t_dt: float
    cause: str = ''
    note: str = ''

    @property
    def found(self) -> bool:
        """Tell whether the event was found."""
        return math.isfinite(self.t_dt)


def alarms_of(t: Floats, ratio: Floats) -> list[Alarm]:
    """
    Return the alarms of a statistic.

    :param t: instants, ascending, s.
    :param ratio: statistic over limit; 1 raises.
    :return: alarms; what comes again within CLEAR_S is the same one.
    """
    high = t[ratio >= 1.0]
    if not high.size:
        return []
    breaks = np.flatnonzero(np.diff(high) > CLEAR_S) + 1
    groups = np.split(high, breaks)
    return [Alarm(float(group[0]), float(group[-1])) for group in groups]


def outcomes(detector: str, events: Sequence[Induced], alarms: Sequence[Alarm]) -> list[Outcome]:
    """
    Return what became of every event.

    :param detector: name.
    :param events: of one actuator on one day.
    :param alarms: on the same record.
    """
    found = []
    for event in events:
        raised = next((a for a in alarms if event.covers(a.start)), None)
        if raised is not None:
            found.append(Outcome(event, detector, raised.start - event.start, raised.cause))
            continue
        standing = next((a for a in alarms if a.start <= event.start <= a.end), None)
        note = f'the alarm of {standing.start:.0f} s stood already' if standing else ''
        found.append(Outcome(event, detector, math.nan, note=note))
    return found


def false_alarms(
    events: Sequence[Induced], alarms: Sequence[Alarm], start: float, end: float
) -> list[Alarm]:
    """
    Return the alarms that no event excuses.

    :param events: of one actuator on one day.
    :param alarms: on the same record.
    :param start: from here on alarms count, s.
    :param end: end of the record, s.
    """
    return [
        alarm
        for alarm in alarms
        if start <= alarm.start <= end and not any(e.excuses(alarm.start) for e in events)
    ]
