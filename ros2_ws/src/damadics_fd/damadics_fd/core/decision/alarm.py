# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Life of an alarm: delays, latch, acknowledge, reset, shelve, near misses, chatter."""

from typing import Annotated

from damadics_fd.core.jit import jit
from damadics_fd.core.modes import PHASE_HOLD
from damadics_fd.core.record import Ints, Record
from damadics_fd.core.settings import Settings

# transitions, numbered as in damadics_msgs/FaultEvent
TRANSITIONS = (
    'raised',
    'cleared',
    'acknowledged',
    'reset',
    'shelved',
    'unshelved',
    'near_miss',
    'changed',
)
RAISED, CLEARED, ACKNOWLEDGED, RESET, SHELVED, UNSHELVED, NEAR_MISS, CHANGED = range(8)

# states and NAMUR NE 107 levels, numbered as in damadics_msgs/FaultFlag
STATES = (
    'not_monitoring',
    'learning',
    'healthy',
    'alarm',
    'latched',
    'shelved',
    'unknown',
)
(
    STATE_NOT_MONITORING,
    STATE_LEARNING,
    STATE_HEALTHY,
    STATE_ALARM,
    STATE_LATCHED,
    STATE_SHELVED,
    STATE_UNKNOWN,
) = range(7)
NORMAL, MAINTENANCE_REQUIRED, OUT_OF_SPECIFICATION, FUNCTION_CHECK, FAILURE = range(5)
NE107 = ('normal', 'maintenance required', 'out of specification', 'function check', 'failure')

RECENT = 16  # alarms remembered for the chatter count
MINUTE = 60_000_000_000


class Alarm(Record):
    """Remember the life of the present alarm and of those before."""

    stamp: int
    active: bool
    latched: bool
    acknowledged: bool
    flag: bool
    worst: int
    occurrence: int
    since: int
    onset: int
    peak: float
    pending: int
    last_decision: int
    excursion: int
    excursion_peak: float
    near_misses: int
    chatter: bool
    recent: Annotated[Ints, RECENT]
    shelved_until: int
    unknown: bool  # the alarm of before a restart is lost


NEVER = -1


def begin(a: Alarm) -> None:
    """
    Set an alarm record to "nothing has happened".

    :param a: alarm record of zeros.
    """
    a.stamp = NEVER
    a.pending = NEVER
    a.excursion = NEVER
    a.recent[:] = NEVER


@jit
def severity(level: int) -> int:
    """
    Map the decision's level to NAMUR NE 107.

    :param level: 0..3 as `decision.vote` returns it.
    :return: NORMAL, MAINTENANCE_REQUIRED, OUT_OF_SPECIFICATION or FAILURE.
    """
    return FAILURE if level == 3 else level


@jit
def raise_alarm(a: Alarm, c: Settings, stamp: int, level: int) -> None:
    """
    Make the alarm active as a new occurrence.

    :param a: alarm record.
    :param c: settings record.
    :param stamp: stamp [ns].
    :param level: 1..3.
    """
    a.active = True
    a.latched = True
    a.acknowledged = False
    a.occurrence += 1
    a.worst = level
    a.onset = a.excursion if a.excursion >= 0 else stamp
    a.peak = a.excursion_peak
    count_chatter(a, c, stamp)


@jit
def resume(a: Alarm, c: Settings, stamp: int, level: int) -> None:
    """
    Make a latched alarm active again: evidence of the same fault until a person resets it.

    :param a: alarm record.
    :param c: settings record.
    :param stamp: stamp [ns].
    :param level: 1..3.
    """
    a.active = True
    a.worst = max(a.worst, level)
    a.peak = max(a.peak, a.excursion_peak)
    count_chatter(a, c, stamp)


@jit
def count_chatter(a: Alarm, c: Settings, stamp: int) -> None:
    """
    Tell whether the alarm has become active too often within a minute.

    :param a: alarm record.
    :param c: settings record.
    :param stamp: stamp [ns].
    """
    for i in range(c.chatter - 1):
        a.recent[i] = a.recent[i + 1]
    a.recent[c.chatter - 1] = stamp
    a.chatter = a.recent[0] >= 0 and stamp - a.recent[0] <= MINUTE


@jit
def judge(
    a: Alarm,
    c: Settings,
    stamp: int,
    exceed: bool,
    busy: bool,
    level: int,
    ratio: float,
    present: bool,
) -> int:
    """
    Take one decision of an armed detector.

    :param a: alarm record.
    :param c: settings record.
    :param stamp: stamp [ns].
    :param exceed: the residual is over the threshold.
    :param busy: it was so in one of the last N samples.
    :param level: 0..3 as `decision.vote` returns it.
    :param ratio: residual / threshold.
    :param present: the signature still sees the change, whatever the residual does.
    :return: transitions as a set of bits.
    """
    events = 0
    if exceed:
        if a.excursion < 0:
            a.excursion = stamp
            a.excursion_peak = 0.0
        a.excursion_peak = max(a.excursion_peak, ratio)
    if level > 0:
        a.last_decision = stamp
        if a.pending < 0:
            a.pending = stamp
        if not a.active and stamp - a.pending >= c.on_delay * 1e9:
            if a.latched:
                resume(a, c, stamp, level)
                events |= 1 << CHANGED
            else:
                raise_alarm(a, c, stamp, level)
                events |= 1 << RAISED
    else:
        a.pending = NEVER
    if a.active:
        a.peak = max(a.peak, ratio) if exceed else a.peak
        if level > a.worst:
            a.worst = level
            events |= 1 << CHANGED
        gone = level == 0 and not exceed and not present
        if gone and stamp - a.last_decision >= c.off_delay * 1e9:
            a.active = False
            a.excursion = NEVER
            a.latched = c.latch
            events |= 1 << CLEARED
    elif a.excursion >= 0 and not busy and not exceed:
        a.excursion = NEVER
        a.near_misses += 1
        events |= 1 << NEAR_MISS
    return events


@jit
def pass_by(a: Alarm, stamp: int, exceed: bool, level: int) -> bool:
    """
    Take a decision from which nothing follows, as nearly always: `step` without its cost.

    :param a: alarm record.
    :param stamp: stamp [ns].
    :param exceed: the residual is over the threshold.
    :param level: 0..3 as `decision.vote` returns it.
    :return: False where `step` has to be taken; the record is then as it was.
    """
    if level > 0 or exceed or a.active or a.excursion != NEVER:
        return False
    if stamp < a.stamp or a.shelved_until > 0:
        return False
    a.stamp = stamp
    a.pending = NEVER
    refresh(a)
    return True


@jit
def step(
    a: Alarm,
    c: Settings,
    stamp: int,
    armed: bool,
    exceed: bool,
    busy: bool,
    level: int,
    ratio: float,
    moving: bool,
    present: bool,
) -> int:
    """
    Take one decision.

    A resting stem shows neither a fault nor its absence: the time without decision, after which
    the condition counts as gone, is time of motion.

    :param a: alarm record.
    :param c: settings record.
    :param stamp: stamp [ns].
    :param armed: decisions count.
    :param exceed: the residual is over the threshold.
    :param busy: it was so in one of the last N samples.
    :param level: 0..3 as `decision.vote` returns it.
    :param ratio: residual / threshold.
    :param moving: the stem moves, so that a fault would show.
    :param present: the signature still sees the change, whatever the residual does.
    :return: transitions as a set of bits.
    """
    events = 0
    if stamp < a.stamp:  # the clock was set back: the alarm stays, its timers start afresh
        a.last_decision = stamp
        a.pending = NEVER
        a.excursion = stamp if a.excursion >= 0 and a.active else NEVER
        a.recent[:] = NEVER
        if a.shelved_until > 0:
            a.shelved_until = stamp + max(a.shelved_until - a.stamp, 0)
    if a.active and not moving and a.stamp >= 0:
        a.last_decision += max(stamp - a.stamp, 0)
    a.stamp = stamp
    if a.shelved_until > 0 and stamp >= a.shelved_until:
        a.shelved_until = 0
        events |= 1 << UNSHELVED
    if armed:
        events |= judge(a, c, stamp, exceed, busy, level, ratio, present)
    else:
        a.pending = NEVER
        if not a.active:
            a.excursion = NEVER
    refresh(a)
    return events


@jit
def refresh(a: Alarm) -> None:
    """
    Set the flag from the state, and the stamp of its last change.

    :param a: alarm record.
    """
    flag = (a.active or a.latched) and a.shelved_until == 0
    if flag != a.flag:
        a.flag = flag
        a.since = max(a.stamp, 0)


@jit
def state_of(a: Alarm, armed: bool, phase: int) -> int:
    """
    Return the state that is shown.

    :param a: alarm record.
    :param armed: decisions count.
    :param phase: phase of the estimator.
    :return: a STATE constant of damadics_msgs/FaultFlag.
    """
    if a.shelved_until > 0:
        return STATE_SHELVED
    if a.active:
        return STATE_ALARM
    if a.latched:
        return STATE_LATCHED
    if a.unknown:
        return STATE_UNKNOWN
    if armed:
        return STATE_HEALTHY
    return STATE_NOT_MONITORING if phase == PHASE_HOLD else STATE_LEARNING


@jit
def level_of(a: Alarm, armed: bool) -> int:
    """
    Return the NAMUR NE 107 level that is shown.

    :param a: alarm record.
    :param armed: decisions count.
    :return: a level; function check while shelved, unknown, learning or not monitoring.
    """
    if a.flag:
        return severity(a.worst)
    return FUNCTION_CHECK if a.shelved_until > 0 or a.unknown or not armed else NORMAL
