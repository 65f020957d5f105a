# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What operators ask of an alarm: acknowledge, reset, shelve; and an alarm that was lost."""

import math
from typing import NamedTuple

from damadics_fd.core.decision.alarm import (
    ACKNOWLEDGED,
    RESET,
    SHELVED,
    UNSHELVED,
    Alarm,
    refresh,
)

LEAST_SHELF, LONGEST_SHELF = 0.01, 30 * 86400.0  # s


class Answer(NamedTuple):
    """Hold what became of a request of an operator."""

    done: bool
    text: str  # one sentence; the reason where it was refused
    transitions: int = 0  # bit n: transition n


def acknowledge(a: Alarm, occurrence: int | None = None) -> Answer:
    """
    Note that a person has seen the alarm.

    :param a: alarm record.
    :param occurrence: the alarm meant; the present one where it is None.
    :return: the answer; acknowledging twice is no error and no transition.
    """
    if not (a.active or a.latched):
        if not a.unknown:
            return Answer(False, 'there is no alarm to acknowledge')
        a.unknown = False
        return Answer(True, 'noted that the alarm of before is lost', 1 << ACKNOWLEDGED)
    if occurrence is not None and occurrence != a.occurrence:
        return Answer(False, f'there is no alarm {occurrence}; the present one is {a.occurrence}')
    if a.acknowledged:
        return Answer(True, f'alarm {a.occurrence} was acknowledged before')
    a.acknowledged = True
    return Answer(True, f'alarm {a.occurrence} acknowledged', 1 << ACKNOWLEDGED)


def lose(a: Alarm) -> None:
    """
    Begin without the alarm of before, which nobody can tell; until a person says otherwise.

    :param a: alarm record, as `begin` left it.
    """
    a.unknown = True


def reset(a: Alarm) -> Answer:
    """
    Release the latch of an alarm whose condition has gone, after repair or inspection.

    :param a: alarm record.
    :return: the answer; refused while the condition lasts.
    """
    if a.active:
        return Answer(
            False,
            f'alarm {a.occurrence} is still active; shelve it for the time of '
            'the repair and reset it when its condition has gone',
        )
    if not (a.latched or a.unknown):
        return Answer(False, 'there is no alarm to reset')
    if not a.latched:
        return acknowledge(a)
    seen = 0 if a.acknowledged else 1 << ACKNOWLEDGED
    a.acknowledged = True
    a.latched = a.unknown = False
    refresh(a)
    return Answer(True, f'alarm {a.occurrence} reset', seen | 1 << RESET)


def shelve(a: Alarm, seconds: float) -> Answer:
    """
    Mask the alarm for a time; what happens meanwhile is recorded and shown afterwards.

    :param a: alarm record.
    :param seconds: how long, counted in stamps of the measurement.
    :return: the answer; refused for less than a sample or more than 30 days.
    """
    if not LEAST_SHELF <= seconds <= LONGEST_SHELF:
        return Answer(
            False,
            f'cannot shelve for {seconds:g} s: give {LEAST_SHELF:g} to {LONGEST_SHELF:.0f} s',
        )
    a.shelved_until = max(a.stamp, 0) + math.ceil(seconds * 1e9)
    refresh(a)
    return Answer(True, f'alarms shelved for {seconds:g} s', 1 << SHELVED)


def unshelve(a: Alarm) -> Answer:
    """
    End a shelf before its time.

    :param a: alarm record.
    :return: the answer.
    """
    if a.shelved_until == 0:
        return Answer(False, 'alarms are not shelved')
    a.shelved_until = 0
    refresh(a)
    return Answer(True, 'alarms no longer shelved', 1 << UNSHELVED)
