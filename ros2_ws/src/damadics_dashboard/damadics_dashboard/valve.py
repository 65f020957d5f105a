# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the page knows about one valve, and the words for it."""

import time
from collections import deque
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from damadics_fd.core.stamps import is_date
from damadics_msgs.msg import FaultEvent, FaultFlag

from damadics_dashboard.raw import Batch
from damadics_dashboard.traces import NANO, Trace

HEARTBEAT_LOST = 2.0  # s; the detector repeats its flag every second
SAMPLES_LOST = 0.6  # s, or three periods of the samples
WINDOW = 600.0  # s that plots may show
MOST_SAMPLES = 150_000
NE107 = {
    FaultFlag.NE107_NORMAL: ('', 'normal'),
    FaultFlag.NE107_MAINTENANCE_REQUIRED: ('M', 'maintenance required'),
    FaultFlag.NE107_OUT_OF_SPECIFICATION: ('S', 'out of specification'),
    FaultFlag.NE107_FUNCTION_CHECK: ('C', 'function check'),
    FaultFlag.NE107_FAILURE: ('F', 'failure'),
}
ALARMS = (FaultFlag.STATE_ALARM, FaultFlag.STATE_LATCHED)


class Condition(NamedTuple):
    """How a valve is shown: `kind` is ok, learn, off, M, S, C or F."""

    kind: str
    title: str
    detail: str

    @property
    def alarm(self) -> bool:
        """Whether the valve is shown in the colour of an alarm."""
        return self.kind in 'MSF'


@dataclass
class Alarm:
    """The present alarm of a valve, put together from its flag and its events."""

    occurrence: int
    level: int
    state: str  # active, returned, shelved
    acknowledged: bool
    onset: int  # ns
    evidence: dict[str, Any] = field(default_factory=dict)


class Valve:
    """
    One valve: its latest flag, events, diagnostics and samples.

    :param name: its namespace without the leading slash, '' for the root.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.tag = ''
        self.flag: FaultFlag | None = None
        self.flag_at = -1e9
        self.threshold_at = -1e9
        self.measured_at = -1e9
        self.period = 0.0
        self.diagnostics: dict[str, dict[str, str]] = {}
        self.levels: dict[str, int] = {}
        self.events: deque[dict[str, Any]] = deque(maxlen=100)
        self.acknowledged: set[int] = set()
        self.ratios: deque[float] = deque(maxlen=120)  # one a second, the largest of it
        self.peak = 0.0
        self.lost = 0
        self.batches = {
            'measurement': Batch('damadics_msgs/msg/Measurement', {'cv': 'cv', 'x1': 'x1'}),
            'estimate': Batch(
                'damadics_msgs/msg/Estimate',
                {
                    'x2': 'x2',
                    'residual': 'xi2',
                    'u': 'u',
                    'x': 'x1',
                    'progress': 'progress',
                    'phase': 'phase',
                },
            ),
            'threshold': Batch('damadics_msgs/msg/Float64Stamped', {'rho': 'data'}),
        }
        self.traces = {
            topic: Trace(tuple(batch.dtype.names[1:]), WINDOW, MOST_SAMPLES)
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
            if topic == 'measurement':
                self.measured_at = now
            elif topic == 'threshold':
                self.threshold_at = now
                span = (int(rows['stamp'][-1]) - self.traces['threshold'].newest) / NANO
                self.period = min(max(span / len(rows), 0.0), 60.0)
            else:
                rows['residual'] = abs(rows['residual'])
            self.traces[topic].extend(rows)

    def take_flag(self, flag: FaultFlag, now: float) -> None:
        """
        Take the detector's judgement.

        :param flag: the message.
        :param now: monotonic time [s].
        """
        if flag.threshold > 0.0:
            self.peak = max(self.peak, flag.residual / flag.threshold)
        if flag.header.frame_id:
            self.tag = flag.header.frame_id
        self.flag, self.flag_at = flag, now

    def take_event(self, event: dict[str, Any]) -> None:
        """
        Take a transition of the alarm.

        :param event: as the history stores it.
        """
        self.events.append(event)
        if event['transition'] in (FaultEvent.ACKNOWLEDGED, FaultEvent.RESET):
            self.acknowledged.add(event['occurrence'])
        elif event['transition'] == FaultEvent.RAISED:
            self.acknowledged.discard(event['occurrence'])

    def second(self) -> None:
        """Close one second of the small curve on the tile."""
        rows, limits = self.traces['estimate'].rows, self.traces['threshold'].rows
        if len(rows) and len(limits):
            recent = rows[-max(int(1.0 / max(self.period, 1e-3)), 1) :]
            if limits['rho'][-1] > 0.0:
                self.peak = max(self.peak, float(recent['residual'].max()) / limits['rho'][-1])
        self.ratios.append(self.peak)
        self.peak = 0.0

    def age(self, now: float) -> float | None:
        """
        Return the age of the last judged sample.

        :param now: monotonic time [s].
        :return: [s], None where there has been none.
        """
        last = self.threshold_at
        return None if last < 0.0 else now - last

    @property
    def progress(self) -> float:
        """Share of the learning that is done, 0..1."""
        rows = self.traces['estimate'].rows
        if len(rows):
            return float(rows['progress'][-1])
        text = self.diagnostics.get('estimator', {}).get('Learning progress (%)', '0')
        return float(text) / 100.0

    def condition(self, now: float) -> Condition:
        """
        Say how the valve is; silence is never shown as health.

        :param now: monotonic time [s].
        :return: the condition.
        """
        flag = self.flag
        if flag is None:
            return Condition('off', 'Not monitored', 'no detector has reported yet')
        quiet = now - self.threshold_at
        if now - self.flag_at > HEARTBEAT_LOST or (
            self.threshold_at > 0.0
            and quiet > max(SAMPLES_LOST, 3.0 * self.period)
            and now - self.flag_at > SAMPLES_LOST
            and flag.state != FaultFlag.STATE_NOT_MONITORING
        ):
            quiet = now - max(self.flag_at, self.threshold_at)
            return Condition('off', 'Not monitored', f'no word from the detector for {age(quiet)}')
        if self.threshold_at > 0.0 and quiet > max(1.0, 3.0 * self.period):
            return Condition('off', 'Not monitored', f'no sample for {age(quiet)}')
        if flag.state == FaultFlag.STATE_NOT_MONITORING:
            return Condition('off', 'Not monitored', 'input silent or refused')
        if flag.state == FaultFlag.STATE_SHELVED:
            return Condition('C', 'Alarms shelved', 'masked for a time')
        letter, words = NE107.get(flag.level, ('C', 'function check'))
        if flag.state in ALARMS:
            active = flag.state == FaultFlag.STATE_ALARM
            return Condition(
                letter or 'M',
                words.capitalize(),
                'fault present' if active else 'fault has gone, alarm latched',
            )
        if flag.state == FaultFlag.STATE_LEARNING:
            return Condition(
                'learn', 'Learning', f'{100.0 * self.progress:.0f} % of the fault-free reference'
            )
        return Condition('ok', 'Healthy', 'monitoring, no alarm')

    def alarm(self) -> Alarm | None:
        """
        Return the alarm that is present, latched or shelved.

        :return: None where there is none.
        """
        flag = self.flag
        if flag is None or flag.occurrence == 0:
            return None
        if not flag.fault and flag.state not in (*ALARMS, FaultFlag.STATE_SHELVED):
            return None
        mine = [e for e in self.events if e['occurrence'] == flag.occurrence]
        ends = [e for e in mine if e['transition'] in (FaultEvent.RESET, FaultEvent.RAISED)]
        if flag.state == FaultFlag.STATE_SHELVED and (
            not ends or ends[-1]['transition'] == FaultEvent.RESET
        ):
            return None
        told = [e for e in mine if e['transition'] in (FaultEvent.RAISED, FaultEvent.CHANGED)]
        cleared = bool(mine) and FaultEvent.CLEARED in (e['transition'] for e in mine)
        state = {FaultFlag.STATE_ALARM: 'active', FaultFlag.STATE_LATCHED: 'returned'}.get(
            flag.state, 'returned' if cleared else 'active'
        )
        known = self.diagnostics.get('detector', {}).get('Acknowledged') == 'True'
        onset = flag.onset.sec * NANO + flag.onset.nanosec
        evidence = dict(told[-1]) if told else {}
        if evidence and state == 'active':  # the event tells how it was then
            stamp = flag.header.stamp.sec * NANO + flag.header.stamp.nanosec
            evidence |= {
                'residual': flag.residual,
                'threshold': flag.threshold,
                'duration': max(stamp - onset, 0) / NANO,
            }
            if flag.threshold > 0.0:
                now = flag.residual / flag.threshold
                evidence['ratio'] = max(evidence.get('ratio') or 0.0, now)
        return Alarm(
            flag.occurrence,
            flag.level,
            'shelved' if flag.state == FaultFlag.STATE_SHELVED else state,
            known or flag.occurrence in self.acknowledged,
            onset,
            evidence,
        )


def age(seconds: float | None) -> str:
    """
    Word a duration.

    :param seconds: duration [s].
    :return: short text.

    >>> age(0.31), age(75.0), age(7300.0)
    ('0.3 s', '1 min 15 s', '2 h 1 min')
    """
    if seconds is None:
        return '–'
    if seconds < 60.0:
        return f'{seconds:.1f} s'
    if seconds < 3600.0:
        return f'{seconds // 60:.0f} min {seconds % 60:.0f} s'
    return f'{seconds // 3600:.0f} h {seconds % 3600 // 60:.0f} min'


def moment(stamp: int) -> str:
    """
    Word a stamp: seconds of a scenario, or local time.

    :param stamp: [ns].
    :return: short text.

    >>> moment(81_120_000_000)
    't = 81.12 s'
    """
    if stamp <= 0:
        return '–'
    seconds = stamp / NANO
    if not is_date(stamp):
        return f't = {seconds:.2f} s'
    return time.strftime('%Y-%m-%d %H:%M:%S', time.localtime(seconds))
