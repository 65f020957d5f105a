# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A decision, and the transitions of the alarm in it, as damadics_msgs/FaultEvent carries them."""

import math
from dataclasses import dataclass

from damadics_fd.core.decision.alarm import (
    CHANGED,
    CLEARED,
    FAILURE,
    FUNCTION_CHECK,
    MAINTENANCE_REQUIRED,
    NE107,
    NEAR_MISS,
    NORMAL,
    OUT_OF_SPECIFICATION,
    RAISED,
    SHELVED,
    TRANSITIONS,
    UNSHELVED,
)
from damadics_fd.core.record import Record
from damadics_fd.core.signature.state import CAUSES, known

STUCK = 5.0  # s without motion that are worth a word in the text of an alarm
STATISTIC = 1.0  # threshold where the residual is a statistic over its limit: mode scada
CAPPED = 1e9  # what the hot loop has for a ratio to a threshold of zero
ADVICE = {
    NORMAL: '',
    MAINTENANCE_REQUIRED: 'acknowledge; plan an inspection of packing, spring and sensors',
    OUT_OF_SPECIFICATION: 'acknowledge; inspect packing, spring and sensors soon',
    FUNCTION_CHECK: 'alarms are shelved: inspect when the shelf ends',
    FAILURE: 'acknowledge; inspect packing, spring and sensors now, consider manual operation',
}


@dataclass(frozen=True)
class Event:
    """Hold one transition of the alarm; stamps in ns."""

    transition: int  # as in damadics_msgs/FaultEvent
    stamp: int
    occurrence: int
    level: int  # NAMUR NE 107
    onset: int
    residual: float  # [1/s]
    threshold: float  # [1/s]
    ratio: float  # largest residual / threshold of this fault so far
    duration: float  # [s] since the onset
    cause: str = ''
    confidence: float = math.nan
    strength: float = math.nan  # change in the unit of the cause
    spread: float = math.nan  # its standard deviation
    text: str = ''
    advice: str = ''
    test: str = ''  # that raised it, where the monitor has several
    candidates: tuple[str, ...] = ()  # causes, the likeliest first

    @property
    def name(self) -> str:
        """
        Return the name of the transition.

        :return: a name out of `alarm.TRANSITIONS`.
        """
        return TRANSITIONS[self.transition]


@dataclass
class Decision(Record):
    """Hold one judgement of the detector; stamps in ns, states as in damadics_msgs/FaultFlag."""

    stamp: int
    residual: float  # |xi2| [1/s]
    threshold: float  # rho [1/s]
    ratio: float  # residual / threshold
    exceed: bool  # the residual counts and is not below the threshold
    fault: bool  # a fault is flagged
    state: int
    level: int  # NAMUR NE 107
    since: int  # last change of `fault`
    onset: int  # estimated onset of the fault, 0 while there is none
    occurrence: int  # faults flagged since the start
    acknowledged: bool
    peak: float  # largest ratio of this fault
    still: float  # time since the stem last moved by 1 % of its stroke [s]
    cause: int  # as in damadics_msgs/Signature
    strength: float  # change in the unit of the cause, 0 if unknown
    spread: float  # its standard deviation, 0 if unknown
    confidence: float  # probability of the cause, 0 if unknown
    transitions: int  # bit n: transition n of damadics_msgs/FaultEvent

    @property
    def shown(self) -> tuple[bool, int, int]:
        """
        Return what a flag shows: whoever shows it does so anew where this has changed.

        :return: fault, state, level.
        """
        return self.fault, self.state, self.level

    @property
    def events(self) -> tuple[Event, ...]:
        """
        List the transitions of the alarm at this sample.

        :return: one event per transition, with the evidence.
        """
        bits = int(self.transitions)
        return tuple(_event(n, self) for n in range(len(TRANSITIONS)) if bits >> n & 1)


def _event(transition: int, d: Decision) -> Event:
    strength, spread, confidence = known(d.strength, d.spread, d.confidence)
    duration = max(int(d.stamp) - int(d.onset), 0) * 1e-9 if d.onset else 0.0
    return Event(
        transition,
        int(d.stamp),
        int(d.occurrence),
        int(d.level),
        int(d.onset),
        float(d.residual),
        float(d.threshold),
        _largest(d),
        duration,
        CAUSES[int(d.cause)] if d.cause else '',
        confidence,
        strength,
        spread,
        text=_text(transition, d, duration),
        advice=_advice(transition, d),
    )


def _largest(d: Decision) -> float:
    """Return the largest ratio; NaN where there was no threshold to compare with."""
    for ratio in (float(d.peak), float(d.ratio)):
        if ratio < CAPPED and (ratio >= 1.0 or ratio == d.peak):
            return ratio
    return math.nan


def _text(transition: int, d: Decision, duration: float) -> str:
    name = TRANSITIONS[transition].replace('_', ' ')
    unnumbered = transition in (SHELVED, UNSHELVED, NEAR_MISS) or not d.occurrence
    number = '' if unnumbered else f' {int(d.occurrence)}'
    if d.threshold == STATISTIC:
        text = f'{name}{number}: control-room test at {float(d.ratio):.2f} x its limit'
    else:
        times = f'{float(d.ratio):.2f} x' if d.ratio < CAPPED else 'beyond'
        text = (
            f'{name}{number}: velocity residual {times} threshold '
            f'({float(d.residual):.3g} / {float(d.threshold):.3g} 1/s)'
        )
    if transition in (RAISED, CHANGED):
        text += f' for {duration:.3g} s, {NE107[int(d.level)]}'
    elif transition == CLEARED:
        most = f'at most {float(d.peak):.2f} x in' if d.peak < CAPPED else 'after'
        text += f', {most} {duration:.3g} s'
    if transition in (RAISED, CHANGED) and d.still > STUCK:
        text += f'; position frozen for {float(d.still):.0f} s: stem or position sensor'
    return text


def _advice(transition: int, d: Decision) -> str:
    if transition in (RAISED, CHANGED):
        return ADVICE[int(d.level)]
    if transition == CLEARED:
        return 'acknowledge; reset after inspection or repair'
    return ''
