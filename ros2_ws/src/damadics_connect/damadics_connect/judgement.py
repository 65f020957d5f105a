# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is known of a valve, in plain records and words, for everybody outside ROS 2."""

import math
from dataclasses import asdict, dataclass, replace

from damadics_fd.core.stamps import is_date
from damadics_fd.core.text import NAME, SENTENCE, plain
from damadics_msgs.msg import FaultEvent, FaultFlag

NANO = 1_000_000_000
STATES = {
    FaultFlag.STATE_NOT_MONITORING: 'not_monitored',
    FaultFlag.STATE_LEARNING: 'learning',
    FaultFlag.STATE_HEALTHY: 'healthy',
    FaultFlag.STATE_ALARM: 'alarm',
    FaultFlag.STATE_LATCHED: 'latched',
    FaultFlag.STATE_SHELVED: 'shelved',
    FaultFlag.STATE_UNKNOWN: 'unknown',
}
CLASSES = ('normal', 'maintenance', 'out_of_specification', 'function_check', 'failure')
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
Plain = str | int | float | bool | None


@dataclass(frozen=True)
class Judgement:
    """The present judgement of one valve; numbers that are not known are NaN."""

    valve: str
    actuator: str = ''
    area: str = ''
    state: str = 'not_monitored'  # one of STATES
    ne107: str = 'function_check'  # one of CLASSES
    fault: bool = False
    residual: float = math.nan
    threshold: float = math.nan
    stamp: int = 0  # ns, of the sample that it rests on
    since: int = 0  # ns, of the last change of `fault`
    onset: int = 0
    occurrence: int = 0
    acknowledged: bool = False
    cause: str = ''
    confidence: float = math.nan
    strength: float = math.nan
    text: str = ''
    advice: str = ''
    heard: float = -math.inf  # monotonic time of the last word [s]

    @property
    def ratio(self) -> float:
        """Residual / threshold [1]."""
        return self.residual / self.threshold if self.threshold > 0.0 else math.nan

    @property
    def shown(self) -> tuple[Plain, ...]:
        """Return what has changed when it differs: everything but the running numbers."""
        return (
            self.state,
            self.ne107,
            self.fault,
            self.occurrence,
            self.acknowledged,
            self.cause,
            self.text,
        )

    def silent(self) -> 'Judgement':
        """Return what is left once nobody repeats it: an alarm stays, health does not."""
        level = self.ne107 if self.ne107 != 'normal' else 'function_check'
        state = 'unknown' if self.state == 'unknown' else 'not_monitored'
        return replace(self, state=state, ne107=level)


@dataclass(frozen=True)
class Transition:
    """One transition of the alarm of a valve."""

    valve: str
    actuator: str
    transition: str  # one of TRANSITIONS
    stamp: int
    occurrence: int
    ne107: str
    onset: int
    residual: float
    threshold: float
    ratio: float
    duration: float
    cause: str
    confidence: float
    strength: float
    text: str
    advice: str

    @property
    def key(self) -> tuple[str, int, int, str]:
        """Name it: a latched topic sends the same transition again."""
        return self.valve, self.stamp, self.occurrence, self.transition


def as_json(record: Judgement | Transition) -> dict[str, Plain]:
    """
    Return a record as JSON takes it: no NaN, times as text beside the nanoseconds.

    :param record: a judgement or transition.
    :return: fields by name.
    """
    fields: dict[str, Plain] = {}
    for name, value in asdict(record).items():
        if name == 'heard':
            continue
        fields[name] = None if isinstance(value, float) and not math.isfinite(value) else value
        if name in ('stamp', 'since', 'onset'):
            fields[f'{name}_utc'] = utc(value)
    if isinstance(record, Judgement):
        fields['ratio'] = record.ratio if math.isfinite(record.ratio) else None
    return fields


def utc(stamp: int) -> str | None:
    """
    Return a stamp as ISO 8601.

    :param stamp: [ns].
    :return: in UTC with microseconds; None where it is no date.

    >>> utc(1_774_745_999_999_999_000)
    '2026-03-29T00:59:59.999999Z'
    """
    from datetime import UTC, datetime, timedelta

    if not is_date(stamp):
        return None
    when = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=stamp // 1000)
    return when.isoformat(timespec='microseconds').replace('+00:00', 'Z')


def class_of(level: int) -> str:
    """Return the NE 107 class of a number of `FaultFlag`."""
    return CLASSES[level] if 0 <= level < len(CLASSES) else 'function_check'


def transition_of(valve: str, message: FaultEvent) -> Transition:
    """
    Read an event.

    :param valve: namespace without the leading slash.
    :param message: the event.
    :return: the transition; its texts are cut and free of control characters.
    """
    number = message.transition
    return Transition(
        valve=valve,
        actuator=plain(message.header.frame_id, NAME),
        transition=TRANSITIONS[number] if number < len(TRANSITIONS) else 'changed',
        stamp=message.header.stamp.sec * NANO + message.header.stamp.nanosec,
        occurrence=message.occurrence,
        ne107=class_of(message.level),
        onset=message.onset.sec * NANO + message.onset.nanosec,
        residual=message.residual,
        threshold=message.threshold,
        ratio=message.ratio,
        duration=message.duration,
        cause=plain(message.cause, NAME),
        confidence=message.confidence,
        strength=message.strength,
        text=plain(message.text, SENTENCE),
        advice=plain(message.advice, SENTENCE),
    )


def with_flag(before: Judgement, flag: FaultFlag, now: float) -> Judgement:
    """
    Take a flag in.

    :param before: what was known.
    :param flag: the message.
    :param now: monotonic time [s].
    :return: what is known now.
    """
    return replace(
        before,
        actuator=plain(flag.header.frame_id, NAME) or before.actuator,
        state=STATES.get(flag.state, 'unknown'),
        ne107=class_of(flag.level),
        fault=flag.fault,
        residual=flag.residual,
        threshold=flag.threshold,
        stamp=flag.header.stamp.sec * NANO + flag.header.stamp.nanosec,
        since=flag.since.sec * NANO + flag.since.nanosec,
        onset=flag.onset.sec * NANO + flag.onset.nanosec,
        occurrence=flag.occurrence,
        acknowledged=before.acknowledged and flag.occurrence == before.occurrence,
        heard=now,
    )


def with_transition(before: Judgement, event: Transition) -> Judgement:
    """
    Take a transition in: its words, and whether a person has seen the alarm.

    :param before: what was known.
    :param event: the transition.
    :return: what is known now.
    """
    if event.transition == 'acknowledged':
        return replace(before, acknowledged=True)
    if event.transition == 'reset':
        return replace(before, acknowledged=False, cause='', text='', advice='')
    if event.transition in ('raised', 'changed'):
        return replace(
            before,
            acknowledged=before.acknowledged and event.transition == 'changed',
            cause=event.cause,
            confidence=event.confidence,
            strength=event.strength,
            text=event.text,
            advice=event.advice,
        )
    return before
