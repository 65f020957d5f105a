# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a fault is taken for, by a monitor that names causes while it estimates."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from damadics_fd.core.decision.alarm import CHANGED, RAISED
from damadics_fd.core.decision.events import Event


@dataclass(frozen=True)
class Judgement:
    """
    What is known of a standing fault, as damadics_msgs/Isolation carries it.

    :param stamp: of the latest sample, ns.
    :param occurrence: number of the fault since the start.
    :param test: that raised it.
    :param onset: estimated, ns.
    :param found_by: kind of the test.
    :param candidates: causes, the likeliest first; none while the cause is not visible.
    :param confidence: probability of each.
    :param strength: of the likeliest one; NaN if unknown.
    :param text: one sentence for a person.
    """

    stamp: int
    occurrence: int
    test: str
    onset: int
    found_by: str
    candidates: tuple[str, ...] = ()
    confidence: tuple[float, ...] = ()
    strength: float = math.nan
    text: str = ''


def with_judgements(
    events: Iterable[Event], looks: Sequence[Judgement], latest: Event | None = None
) -> list[Event]:
    """
    Tell in the events of an alarm which test found the fault, and what it is taken for later.

    :param events: of the detector, in order of time.
    :param looks: judgements that brought something new, in order of time.
    :param latest: the alarm that stood before them.
    :return: the events, an alarm with its test and onset, and one event for each judgement.
    """
    told: list[Event] = []
    waiting = list(looks)
    for event in [*events, None]:
        while waiting and (event is None or waiting[0].stamp < event.stamp):
            look = waiting.pop(0)
            if latest is not None and look.text:
                told.append(_named(latest, look))
        if event is None:
            break
        if event.transition == RAISED:
            first = next((look for look in waiting if look.stamp >= event.stamp), None)
            if first is not None:
                onset = min(first.onset, event.stamp)
                text = event.text.replace('control-room test', f'control-room test {first.test}')
                duration = (event.stamp - onset) * 1e-9
                event = replace(event, test=first.test, onset=onset, duration=duration, text=text)
            latest = event
        told.append(event)
    return told


def _named(alarm: Event, look: Judgement) -> Event:
    return replace(
        alarm,
        transition=CHANGED,
        stamp=look.stamp,
        test=look.test,
        duration=max(look.stamp - alarm.onset, 0) * 1e-9,
        cause=' or '.join(look.candidates),
        candidates=look.candidates,
        confidence=look.confidence[0] if look.confidence else math.nan,
        strength=look.strength,
        text=look.text,
    )
