# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What became of a recording, with one content whatever the format of the results."""

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import TypedDict

from damadics_fd.core.decision.alarm import RAISED
from damadics_fd.core.decision.events import Event
from damadics_fd.core.stamps import SECOND

FAULT, NONE, NOT_MONITORED, FAILED = 'fault', 'none', 'not monitored', 'failed'  # verdicts
MONITORING = 'monitoring'  # so begins the status of an estimator that judges


class Detection(TypedDict):
    """A detection with its evidence, fit for JSON: None where a value is not known."""

    t: float | None
    stamp: int
    residual: float | None
    threshold: float | None
    ratio: float | None
    level: int
    occurrence: int
    onset: float | None
    test: str
    cause: str
    candidates: str
    confidence: float | None
    strength: float | None
    spread: float | None
    text: str


@dataclass
class Outcome:
    """
    What became of one recording.

    :param bag: its name.
    :param mode: mode of estimator and detector.
    :param samples: measurements read.
    :param duration_s: from the first to the last stamp [s].
    :param samples_per_s: over reading, decoding, estimator and detector.
    :param spent: for that [s]; not among the results.
    :param detections: `t` [s] since scenario zero (since the first sample for real data), `stamp`
        [ns] and the evidence of each.
    :param refused: samples that never reached the filters, by reason.
    :param status: what the estimator did at the end: monitoring, still learning, ...
    :param problems: damaged or missing places in the file, which were left out.
    :param lossy: something of the bag is damaged, missing or doubled.
    :param error: why it could not be replayed, '' where it was.
    """

    bag: str
    mode: str
    samples: int = 0
    duration_s: float = 0.0
    samples_per_s: float = 0.0
    spent: float = 0.0
    detections: list[Detection] = field(default_factory=list)
    refused: dict[str, int] = field(default_factory=dict)
    status: str = ''
    problems: list[str] = field(default_factory=list)
    lossy: bool = False
    error: str = ''

    @property
    def verdict(self) -> str:
        """`fault`, `none` (monitored, and none found), `not monitored` or `failed`."""
        if self.error:
            return FAILED
        if self.detections:
            return FAULT
        return NONE if self.status.startswith(MONITORING) else NOT_MONITORED

    def content(self) -> dict[str, object]:
        """Return everything, the verdict included."""
        values = asdict(self)
        del values['spent']
        return {
            'bag': values.pop('bag'),
            'mode': values.pop('mode'),
            'verdict': self.verdict,
        } | values


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def evidence(event: Event, zero: int) -> Detection:
    """Return a detection with its evidence; `zero` is the stamp of time zero [ns]."""
    return {
        't': (event.stamp - zero) / SECOND,
        'stamp': event.stamp,
        'residual': _finite(event.residual),
        'threshold': _finite(event.threshold),
        'ratio': _finite(event.ratio),
        'level': event.level,
        'occurrence': event.occurrence,
        'onset': (event.onset - zero) / SECOND if event.onset else None,
        'test': event.test,
        'cause': event.cause,
        'candidates': ', '.join(event.candidates),
        'confidence': _finite(event.confidence),
        'strength': _finite(event.strength),
        'spread': _finite(event.spread),
        'text': event.text,
    }


def collect(detections: list[Detection], events: Iterable[Event], zero: int) -> None:
    """Add new detections; a cause that becomes known later is put into its detection."""
    for event in events:
        if event.transition == RAISED:
            detections.append(evidence(event, zero))
            continue
        told = event.cause or event.test
        if told and detections and detections[-1]['occurrence'] == event.occurrence:
            last, present = detections[-1], evidence(event, zero)
            last['cause'], last['confidence'] = present['cause'], present['confidence']
            last['strength'], last['spread'] = present['strength'], present['spread']
            last['candidates'] = present['candidates']
            if event.test:
                last['text'] = present['text']
