# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a fault is taken for, by a monitor that names causes while it estimates."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from damadics_fd.core.decision.alarm import CHANGED, RAISED
from damadics_fd.core.decision.detector import Detector
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
                event = _dated(event, first)
            latest = event
        told.append(event)
    return told


class LiveJudgement:
    """
    What the estimator of one valve takes a fault for, in the events of its detector, as they come.

    :param detector: of the valve.
    """

    def __init__(self, detector: Detector) -> None:
        self._detector = detector
        self._known: Judgement | None = None

    def tell(self, events: Iterable[Event], judgement: Judgement | None = None) -> list[Event]:
        """
        Take what has happened.

        Judgements and estimates may come in any order, and a judgement more than once.

        :param events: of the detector.
        :param judgement: the latest of the estimator; None where it sent none.
        :return: the events, an alarm with its test, onset and, once known, cause; then one event
            where the judgement brings something new.
        """
        new = judgement is not None and not _same(judgement, self._known)
        self._known = judgement if new else self._known
        told, known = [], self._of_present()
        for event in events:
            if known is not None and event.transition in (RAISED, CHANGED):
                event, new = _with_cause(_dated(event, known), known), False
            told.append(event)
        if known is None:
            return told
        self._detector.antedate(known.onset)
        if new and known.text:
            (alarm,) = replace(self._detector.decision, transitions=1 << CHANGED).events
            told.append(_named(alarm, known))
        return told

    def _of_present(self) -> Judgement | None:
        """Return what is known of the alarm that stands or is latched."""
        onset = self._detector.decision.onset
        known = self._known
        return known if onset and known is not None and known.stamp >= onset else None


def _same(one: Judgement, other: Judgement | None) -> bool:
    return other is not None and (one.stamp, one.text) == (other.stamp, other.text)


def _dated(event: Event, look: Judgement) -> Event:
    """Put the test that raised it and its onset into an event."""
    onset = min(look.onset, event.stamp)
    return replace(
        event,
        test=look.test,
        onset=onset,
        duration=(event.stamp - onset) * 1e-9,
        text=event.text.replace('control-room test', f'control-room test {look.test}'),
    )


def _with_cause(event: Event, look: Judgement) -> Event:
    if not look.text:
        return event
    return replace(
        event,
        cause=' or '.join(look.candidates),
        candidates=look.candidates,
        confidence=look.confidence[0] if look.confidence else math.nan,
        strength=look.strength,
        text=f'{event.text}; {look.text}',
    )


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
