# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the page knows about one valve."""

import math
from collections import deque
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from damadics_fd.core.stamps import SECOND as NANO
from damadics_fd.core.text import NAME, plain
from damadics_fd.ros.freshness import Freshness, counted_stamp, default_max_age
from damadics_msgs.msg import FaultEvent, FaultFlag, Isolation, Signature

from damadics_dashboard.live.judged import (
    ALARM,
    HEALTHY,
    LATCHED,
    LEARNING,
    NE107,
    NOT_MONITORING,
    SHELVED,
    UNKNOWN,
    Judged,
    judged_of,
)
from damadics_dashboard.live.late_size import late_size
from damadics_dashboard.live.raw import Batch, batches
from damadics_dashboard.live.traces import Trace
from damadics_dashboard.live.unseen import Unseen
from damadics_dashboard.store.rows import EventRow

HEARTBEAT_LOST = 2.0  # s; the detector repeats its flag every second
SAMPLES_LOST = 0.6  # s, or three periods of the samples
WINDOW = 600.0  # s that plots may show
MOST_SAMPLES = 150_000
ALARMS = (ALARM, LATCHED, UNKNOWN)


class Condition(NamedTuple):
    """How a valve is shown: `kind` is ok, learn, off, M, S, C or F; the rest are keys of texts."""

    kind: str
    title: str
    detail: str
    value: float = math.nan  # that the detail tells

    @property
    def alarm(self) -> bool:
        """Whether the valve is shown in the colour of an alarm."""
        return self.kind in 'MSF'


WELL = Condition('ok', 'healthy', 'no_alarm')


@dataclass
class Alarm:
    """The present alarm of a valve, put together from its flag and its events."""

    occurrence: int
    level: int
    state: str  # active, returned, shelved, unknown
    acknowledged: bool
    onset: int  # ns
    evidence: EventRow = field(default_factory=EventRow)


class Membership(NamedTuple):
    """A valve among those that one process judges."""

    topic: str  # of the process, such as /fleet
    name: str  # of the valve, as that process lists it


class Valve:
    """
    One valve: its latest flag, events, diagnostics and samples.

    :param name: its namespace without the leading slash, '' for the root.
    :param simulated: the clock that stamps are held against is that of /clock.
    """

    def __init__(self, name: str, simulated: bool = False) -> None:
        self.name = name
        self.tag = ''
        self._configured = False  # the tag is the one that its nodes were given
        self.flag: Judged | None = None
        self.flag_at = -1e9
        self.threshold_at = -1e9
        self.judged = -1  # ns, stamp of the flag that its age was last counted from
        self.unseen = Unseen()
        self.freshness = Freshness(simulated)
        self.signature: Signature | None = None
        self.isolation: Isolation | None = None
        self.area = ''
        self.fleet: Membership | None = None
        self.stroking = False  # a fleet says that it makes partial strokes
        self.learned = math.nan  # share of the learning that a fleet reports
        self.suspected = ''  # cause that a fleet reports
        self.period = 0.0
        self.diagnostics: dict[str, dict[str, str]] = {}
        self.levels: dict[str, int] = {}
        self.told_at: dict[str, float] = {}  # monotonic time of the diagnostics [s]
        self.events: deque[EventRow] = deque(maxlen=100)
        self.acknowledged: set[int] = set()
        self.peak = 0.0  # largest residual / threshold of this second
        self.ratio = 0.0  # of the second before
        self.lost = 0
        self.sampled = False  # its samples are or were taken, so that there are traces

    @cached_property
    def batches(self) -> dict[str, Batch]:
        """Samples that have arrived, by topic; of most valves of a large fleet there are none."""
        return batches()

    @cached_property
    def traces(self) -> dict[str, Trace]:
        """Samples by topic."""
        self.sampled = True
        return {
            topic: Trace(batch.columns, WINDOW, MOST_SAMPLES)
            for topic, batch in self.batches.items()
        }

    @property
    def title(self) -> str:
        """Name for people: the namespace, or the tag where there is none."""
        return self.name or self.tag or 'valve'

    def collect(self, now: float) -> None:
        """
        Move the samples that have arrived into the traces.

        :param now: monotonic time [s].
        """
        for topic, batch in self.batches.items():
            rows = batch.drain()
            if not len(rows):
                continue
            if topic == 'threshold':
                self.threshold_at = now
                self.freshness.heard(int(rows['stamp'][-1]), now)
                span = (int(rows['stamp'][-1]) - self.traces['threshold'].newest) / NANO
                self.period = min(max(span / len(rows), 0.0), 60.0)
            elif topic == 'estimate':
                rows['residual'] = abs(rows['residual'])
            self.traces[topic].extend(rows)

    def take_flag(self, flag: FaultFlag, now: float) -> None:
        """
        Take the detector's judgement.

        :param flag: the message.
        :param now: monotonic time [s].
        """
        if flag.header.frame_id and not self._configured:
            self.tag = plain(flag.header.frame_id, NAME)
        self.take(judged_of(flag), now)

    def take(self, judged: Judged, now: float) -> None:
        """
        Take a judgement.

        :param judged: of the valve's own detector or of a fleet.
        :param now: monotonic time [s].
        """
        if judged.threshold > 0.0:
            self.peak = max(self.peak, judged.residual / judged.threshold)
        self.flag, self.flag_at = judged, now
        stamp = counted_stamp(judged.state, judged.stamp)
        if stamp is None:
            return
        self.unseen.judged(stamp, judged.occurrence, present=judged.fault)
        if self.threshold_at < 0.0 and stamp != self.judged:
            self.freshness.heard(stamp, now)
            self.judged = stamp

    def take_tag(self, tag: str) -> None:
        """
        Take the tag that the nodes of the valve were given; it counts more than a driver's.

        :param tag: of the actuator; the name that nodes have without one is left out.
        """
        if tag not in ('', 'actuator'):
            self.tag, self._configured = plain(tag, NAME), True

    def take_event(self, event: EventRow) -> None:
        """
        Take a transition of the alarm.

        :param event: as the history stores it.
        """
        self.events.append(event)
        if event['transition'] in (FaultEvent.ACKNOWLEDGED, FaultEvent.RESET):
            self.acknowledged.add(event['occurrence'])
        elif event['transition'] == FaultEvent.RAISED:
            self.acknowledged.discard(event['occurrence'])

    @property
    def occurrence(self) -> int:
        """Number of the latest alarm that an event told of."""
        return max(e['occurrence'] for e in self.events) if self.events else 0

    def forget(self, topic: str) -> None:
        """
        Drop the samples of a topic that is no longer taken.

        :param topic: its name.
        """
        self.batches[topic].drain()
        self.traces[topic] = Trace(self.batches[topic].columns, WINDOW, MOST_SAMPLES)
        if topic == 'threshold':
            self.threshold_at, self.period = -1e9, 0.0

    def second(self) -> None:
        """Close one second of the bar that shows the largest residual against its limit."""
        if (
            self.sampled
            and len(rows := self.traces['estimate'].rows)
            and len(limits := self.traces['threshold'].rows)
        ):
            recent = rows[-max(int(1.0 / max(self.period, 1e-3)), 1) :]
            if limits['rho'][-1] > 0.0:
                self.peak = max(self.peak, float(recent['residual'].max()) / limits['rho'][-1])
        self.ratio = self.peak
        self.peak = 0.0

    def age(self, now: float, clock: int) -> float | None:
        """
        Return the age of the last judged sample.

        :param now: monotonic time [s].
        :param clock: ROS time [ns].
        :return: [s], None where there has been none.
        """
        old = self.freshness.age(clock, now)
        arrived = now - max(self.threshold_at, self.flag_at)
        return None if math.isinf(old) else max(arrived, old, 0.0)

    @property
    def progress(self) -> float:
        """Share of the learning that is done, 0..1."""
        if self.sampled and len(rows := self.traces['estimate'].rows):
            return float(rows['progress'][-1])
        if math.isfinite(self.learned):
            return self.learned
        text = self.diagnostics.get('estimator', {}).get('Learning progress (%)', '0')
        return float(text) / 100.0

    def condition(self, now: float, clock: int) -> Condition:
        """
        Say how the valve is; silence and old judgements are never shown as health.

        :param now: monotonic time [s].
        :param clock: ROS time [ns].
        :return: the condition.
        """
        flag = self.flag
        if flag is None:
            return Condition('off', 'not_monitored', 'no_detector')
        silent = self._silence(flag, now, clock)
        if silent is not None:
            return silent
        if flag.state == NOT_MONITORING:
            return Condition('off', 'not_monitored', 'input_refused')
        if flag.state == SHELVED:
            return Condition('C', 'shelved', 'masked')
        if flag.state == UNKNOWN:
            return Condition('C', 'state_unknown', 'confirm_state')
        letter = NE107.get(flag.level, 'C') or 'M'
        if flag.state in ALARMS:
            active = flag.state == ALARM
            return Condition(letter, f'ne_{letter}', 'fault_present' if active else 'fault_gone')
        if flag.state == LEARNING:
            return Condition('learn', 'learning', 'learned_share', self.progress)
        if flag.state == HEALTHY:
            return WELL
        return Condition('C', 'state_unknown', 'confirm_state')

    def _silence(self, flag: Judged, now: float, clock: int) -> Condition | None:
        """Tell where nothing recent is known of the valve."""
        quiet = now - self.threshold_at
        heard = self.threshold_at > 0.0
        refused = flag.state == NOT_MONITORING
        if now - self.flag_at > HEARTBEAT_LOST or (
            heard
            and quiet > max(SAMPLES_LOST, 3.0 * self.period)
            and now - self.flag_at > SAMPLES_LOST
            and not refused
        ):
            quiet = now - max(self.flag_at, self.threshold_at)
            return Condition('off', 'not_monitored', 'detector_silent', quiet)
        if heard and quiet > max(1.0, 3.0 * self.period):
            return Condition('off', 'not_monitored', 'no_sample', quiet)
        old = self.freshness.age(clock, now)
        if default_max_age(self.period) < old < math.inf and not refused:
            return Condition('off', 'not_monitored', 'samples_old', old)
        return None

    def alarm(self) -> Alarm | None:
        """
        Return the alarm that is present, latched or shelved.

        :return: None where there is none.
        """
        flag = self.flag
        if flag is None:
            return None
        if flag.state == UNKNOWN:
            return Alarm(flag.occurrence, FaultFlag.NE107_FUNCTION_CHECK, 'unknown', False, 0)
        if flag.occurrence == 0 and self.fleet is None:
            return None  # a fleet's status has no number, and its process may have been restarted
        if not flag.fault and flag.state not in (*ALARMS, SHELVED):
            return None
        mine = [e for e in self.events if e['occurrence'] == flag.occurrence]
        ends = [e for e in mine if e['transition'] in (FaultEvent.RESET, FaultEvent.RAISED)]
        if flag.state == SHELVED and (not ends or ends[-1]['transition'] == FaultEvent.RESET):
            return None
        told = [e for e in mine if e['transition'] in (FaultEvent.RAISED, FaultEvent.CHANGED)]
        cleared = bool(mine) and FaultEvent.CLEARED in (e['transition'] for e in mine)
        state = {ALARM: 'active', LATCHED: 'returned'}.get(
            flag.state, 'returned' if cleared else 'active'
        )
        known = self.diagnostics.get('detector', {}).get('Acknowledged') == 'True'
        evidence = told[-1].copy() if told else EventRow(cause=self.suspected)
        if evidence and state == 'active':  # the event tells how it was then
            evidence |= {
                'residual': flag.residual,
                'threshold': flag.threshold,
                'duration': max(flag.stamp - flag.onset, 0) / NANO,
                'unseen': self.unseen.seconds,
            }
            if flag.threshold > 0.0:
                now = flag.residual / flag.threshold
                evidence['ratio'] = max(evidence.get('ratio') or 0.0, now)
        found = self.isolation
        if found is not None and found.occurrence == flag.occurrence:
            evidence |= {'found_by': found.found_by, 'deviation': found.deviation}
        evidence |= late_size(evidence, self.signature)
        return Alarm(
            flag.occurrence,
            flag.level,
            'shelved' if flag.state == SHELVED else state,
            known or flag.occurrence in self.acknowledged,
            flag.onset,
            evidence,
        )
