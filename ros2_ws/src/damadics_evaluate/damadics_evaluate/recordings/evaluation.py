# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Detectors on labelled recordings: indices per event, false alarms per day, intervals."""

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from damadics_evaluate.alarms import Alarm
from damadics_evaluate.columns import NANOSECONDS, Columns, cut
from damadics_evaluate.indices import Zones, decision_indices
from damadics_evaluate.recordings.labels import FAULT, LEARN, Label
from damadics_evaluate.watching import NAMED_AFTER_S, watch

DAY_S = 86400.0
DATE = 1e8
"""Times above are Unix times, others count from the first sample, s."""


@dataclass(frozen=True)
class Rules:
    """
    What counts.

    :param before: an alarm that much before a label still finds its event, s.
    :param after: nothing is counted that long after an event, s.
    """

    before: float = 0.0
    after: float = 120.0


@dataclass(frozen=True)
class EventResult:
    """
    One labelled fault with one detector.

    :param recording: name.
    :param label: of the fault, times in s since the first sample.
    :param detector: name.
    :param t_dt: s from the label to the alarm; infinite where it was not found.
    :param r_fd: share of the fault-free time before it in which an alarm stood.
    :param r_td: share of the fault's time in which an alarm stood.
    :param t_it: s from the label to the right name alone; infinite where it was not named.
    :param r_ti: share of the fault's time in which it was named.
    :param cause: what was named.
    """

    recording: str
    label: Label
    detector: str
    t_dt: float
    r_fd: float
    r_td: float
    t_it: float
    r_ti: float
    cause: str


@dataclass
class Table:
    """
    All results.

    :param detectors: names.
    :param events: one per fault and detector.
    :param false_alarms: per detector and recording the alarms that no event excuses.
    :param days: fault-free time that was judged, per recording.
    :param refused: detector and what it did.
    """

    detectors: tuple[str, ...]
    events: list[EventResult] = field(default_factory=list)
    false_alarms: dict[tuple[str, str], list[Alarm]] = field(default_factory=dict)
    days: dict[str, float] = field(default_factory=dict)
    refused: list[str] = field(default_factory=list)

    def add(self, other: 'Table') -> None:
        """
        Take in the results of other recordings.

        :param other: with the same detectors.
        """
        self.events += other.events
        self.false_alarms |= other.false_alarms
        self.days |= other.days
        self.refused += other.refused


def evaluate(
    recordings: Mapping[str, Columns],
    labels: Sequence[Label],
    detectors: Sequence[str],
    rules: Rules,
    tell: Callable[[str], None],
    executor: Executor | None = None,
) -> Table:
    """
    Run all detectors over all recordings.

    :param recordings: columns by name.
    :param labels: of all recordings.
    :param detectors: names.
    :param rules: what counts.
    :param tell: told what is being done.
    :param executor: runs each recording by itself; None for this process.
    :return: the table.
    :raises ValueError: where a label names no recording, or nothing is labelled to learn from.
    """
    table = Table(tuple(detectors))
    own = {name: _own(name, columns, labels) for name, columns in recordings.items()}
    taken = {id(label) for some in own.values() for label, _ in some}
    lost = sorted({label.recording for label in labels if id(label) not in taken})
    if lost:
        raise ValueError(
            f'labels name {", ".join(lost)}, which is not among the recordings '
            f'{", ".join(recordings)}'
        )
    everywhere = [
        cut(columns, label.start + zero, label.end + zero)
        for name, columns in recordings.items()
        for (label, zero) in own[name]
        if label.kind == LEARN
    ]
    waiting: list[Future[Table]] = []
    for name, columns in recordings.items():
        here = [(label, zero) for label, zero in own[name] if label.kind == LEARN]
        parts = [cut(columns, a.start + z, a.end + z) for a, z in here] or everywhere
        labelled, learning = [a for a, _ in own[name]], _pooled(parts)
        if executor is None:
            table.add(_one(table.detectors, name, columns, labelled, learning, rules, tell))
        else:
            waiting.append(
                executor.submit(
                    _one, table.detectors, name, columns, labelled, learning, rules, _silent
                )
            )
    for name, future in zip(recordings, waiting, strict=False):
        table.add(future.result())
        tell(f'{name}: done')
    return table


def _silent(text: str) -> None:
    """Tell nobody: the process that does the work has no terminal."""


def _own(name: str, columns: Columns, labels: Sequence[Label]) -> list[tuple[Label, float]]:
    """Return the labels of one recording, in s since its first sample, and that zero."""
    zero = float(columns['stamp'][0]) / NANOSECONDS
    path, hash_, part = name.partition('#')  # file#valve, where a file holds several
    file = Path(path).name
    names = {name, Path(name).name, file, f'{file}{hash_}{part}'}
    found = []
    for label in labels:
        if label.recording not in names:
            continue
        found.append((label, 0.0 if label.start > DATE else zero))
    return found


def _pooled(parts: Sequence[Columns]) -> Columns:
    """Return fault-free parts as one record, a minute and more between them."""
    names = set.intersection(*(set(part) for part in parts))
    moved, end = [], None
    for part in parts:
        if not len(part['stamp']):
            continue
        stamp = part['stamp']
        if end is not None and stamp[0] <= end:
            stamp = stamp + (end - stamp[0] + int(60 * NANOSECONDS))
        end = stamp[-1]
        moved.append({**part, 'stamp': stamp})
    if not moved:
        raise ValueError('the labels to learn from cover no sample')
    return {name: np.concatenate([part[name] for part in moved]) for name in sorted(names)}


def _one(
    detectors: tuple[str, ...],
    name: str,
    columns: Columns,
    labels: Sequence[Label],
    learning: Columns,
    rules: Rules,
    tell: Callable[[str], None],
) -> Table:
    """Run all detectors over one recording."""
    table = Table(detectors)
    zero = 0.0 if any(a.start > DATE for a in labels) else float(columns['stamp'][0]) / NANOSECONDS
    t = columns['stamp'] / NANOSECONDS - zero
    learned = [a for a in labels if a.kind == LEARN]
    faults = [a for a in labels if a.kind == FAULT]
    since = max((a.end for a in learned if math.isfinite(a.end)), default=float(t[0]))
    excused = np.zeros(len(t), bool)
    for a in faults:
        excused |= (t >= a.start - rules.before) & (t <= a.end + rules.after)
    for a in learned:
        excused |= (t >= a.start) & (t <= a.end)
    counted = (t >= since) & ~excused
    table.days[name] = float(np.diff(t, append=t[-1])[counted].clip(0.0, 60.0).sum()) / DAY_S
    for detector in table.detectors:
        tell(f'{name}: {detector}')
        try:
            alarms = watch(detector, learning, columns, since + zero)
        except (ValueError, ArithmeticError, LookupError, TypeError) as error:
            table.refused.append(f'{detector} on {name}: {error}')
            continue
        moved = [Alarm(a.start - zero, a.end - zero, a.cause) for a in alarms]
        table.events += [
            _event(name, a, detector, t, counted, moved, rules) for a in faults if a.start >= since
        ]
        wrong = [a for a in moved if counted[np.searchsorted(t, a.start).clip(0, len(t) - 1)]]
        table.false_alarms[detector, name] = wrong
    return table


def _event(
    recording: str,
    label: Label,
    detector: str,
    t: np.ndarray,
    counted: np.ndarray,
    alarms: Sequence[Alarm],
    rules: Rules,
) -> EventResult:
    """Return the indices of one fault; the alarm that finds it is the first raised within it."""
    end = min(label.end, float(t[-1]))
    begin = label.start - rules.before
    raised = next((a for a in alarms if begin <= a.start <= end), None)
    decision = np.zeros(len(t), bool)
    named = np.zeros(len(t), bool)
    for a in alarms:
        decision |= (t >= a.start) & (t <= a.end)
        if a.cause == label.fault:
            named |= (t >= a.start + NAMED_AFTER_S) & (t <= max(a.end, a.start + NAMED_AFTER_S))
    quiet = counted & (t < begin)
    zones = Zones(t_on=float(t[0]) - 1.0, t_from=label.start, t_hor=max(end, label.start + 1e-6))
    detection, isolation = (decision_indices(t, x, zones) for x in (decision, named))
    return EventResult(
        recording,
        label,
        detector,
        t_dt=raised.start - label.start if raised else math.inf,
        r_fd=float(decision[quiet].mean()) if quiet.any() else math.nan,
        r_td=detection.r_td,
        t_it=isolation.t_dt if math.isfinite(isolation.t_dt) else math.inf,
        r_ti=isolation.r_td,
        cause=raised.cause if raised else '',
    )
