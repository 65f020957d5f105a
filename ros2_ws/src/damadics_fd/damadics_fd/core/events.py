# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Transitions of an alarm with their evidence, as damadics_msgs/FaultEvent carries them."""

import math
from dataclasses import dataclass
from typing import Any

from damadics_fd.core.alarm import NE107, TRANSITIONS


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
    strength: float = math.nan
    text: str = ''
    advice: str = ''

    @property
    def name(self) -> str:
        """
        Return the name of the transition.

        :return: a name out of `alarm.TRANSITIONS`.
        """
        return TRANSITIONS[self.transition]


def events_of(decision: Any) -> tuple[Event, ...]:
    """
    List the transitions in a decision.

    :param decision: a `Decision` or a row of `Result.decisions`.
    :return: one event per transition, with the evidence.
    """
    bits = int(decision.transitions)
    return tuple(_event(n, decision) for n in range(len(TRANSITIONS)) if bits >> n & 1)


def _event(transition: int, d: Any) -> Event:
    duration = (int(d.stamp) - int(d.onset)) * 1e-9 if d.onset else 0.0
    name = TRANSITIONS[transition].replace('_', ' ')
    text = (f'{name}: velocity residual {float(d.ratio):.2f} x threshold '
            f'({float(d.residual):.3g} / {float(d.threshold):.3g} 1/s), '
            f'largest {float(d.peak):.2f} x, {NE107[int(d.level)]}')
    return Event(transition, int(d.stamp), int(d.occurrence), int(d.level), int(d.onset),
                 float(d.residual), float(d.threshold), float(d.peak), duration, text=text)
