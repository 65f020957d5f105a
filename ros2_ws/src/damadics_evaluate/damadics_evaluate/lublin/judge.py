# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a detector's alarms are worth against the schedule: found, missed, false."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from damadics_evaluate.alarms import Alarm
from damadics_evaluate.lublin.schedule import Induced


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
