# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a monitor makes of a recording, and the columns that it takes."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.decision.alarm import RAISED
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.decision.events import Decision, Event
from damadics_fd.core.estimating import Estimating
from damadics_fd.core.judgement import Judgement, with_judgements
from damadics_fd.core.record import Array, Floats, Ints
from damadics_fd.core.sample import SIGNALS

Columns = Mapping[str, NDArray[np.generic]]
HELD = ('fault', 'state', 'level', 'since', 'onset', 'occurrence')


@dataclass(frozen=True)
class Result:
    """
    Hold what a monitor made of a recording.

    Row n belongs to sample n; rows of refused samples hold NaN and the state before.
    """

    reason: NDArray[np.uint8]  # a `quality.Reason`, 0 where the sample was accepted
    estimates: Array  # rows of `Estimate`
    decisions: Array  # rows of `Decision`
    estimator: Estimating  # with the state after the last sample
    detector: Detector
    looks: tuple[Judgement, ...] = ()  # what faults were taken for, in order of time
    latest: Event | None = None  # the alarm that stood before

    @property
    def accepted(self) -> NDArray[np.bool_]:
        """
        Tell which samples were accepted.

        :return: mask.
        """
        mask: NDArray[np.bool_] = self.reason == 0
        return mask

    @property
    def counters(self) -> dict[str, int]:
        """
        Return the counters of the estimator.

        :return: counts by name.
        """
        return self.estimator.counters

    @property
    def events(self) -> list[Event]:
        """
        List all transitions of the alarm.

        :return: events in order of time.
        """
        told = events_in(self.decisions[self.decisions['transitions'] != 0])
        return with_judgements(told, self.looks, self.latest)

    @property
    def detections(self) -> list[Event]:
        """
        List the alarms; in paper mode each rising edge of the two-sample decision.

        :return: the events `raised`.
        """
        return [event for event in self.events if event.transition == RAISED]


def events_in(decisions: Array) -> list[Event]:
    """
    List the transitions in some decisions.

    :param decisions: rows of `Decision`.
    :return: events in the order of the rows.
    """
    # plain numbers are seven times as fast
    return [event for row in decisions.tolist() for event in Decision(*row).events]


def contiguous(columns: Columns) -> tuple[Ints, list[Floats]]:
    """
    Return stamps and signals as the compiled loops take them; copy only what is otherwise.

    :param columns: as `Monitor.run` takes them.
    :return: stamps, and the signals in the order of SIGNALS, NaN where not measured.
    :raises KeyError: where `stamp`, `cv` or `x1` is absent.
    :raises ValueError: where the columns differ in length.
    """
    missing = [name for name in ('stamp', 'cv', 'x1') if name not in columns]
    if missing:
        raise KeyError(f'the recording has no column {", ".join(missing)}')
    stamp = np.ascontiguousarray(columns['stamp'], np.int64)
    unmeasured = np.broadcast_to(np.array(np.nan), stamp.shape)
    signals = [np.ascontiguousarray(columns.get(name, unmeasured), np.float64) for name in SIGNALS]
    if any(signal.shape != stamp.shape for signal in signals):
        raise ValueError('the columns of the recording differ in length')
    return stamp, signals


def hold_refused(
    reason: NDArray[np.uint8], stamp: Ints, estimates: Array, decisions: Array, before: Decision
) -> None:
    """
    Fill the rows of refused samples: NaN, and the state before.

    :param reason: of each sample.
    :param stamp: of each sample [ns].
    :param estimates: rows of `Estimate`, written.
    :param decisions: rows of `Decision`, written.
    :param before: the last decision before the first row.
    """
    refused = np.flatnonzero(reason)
    if not len(refused):
        return
    for rows in (estimates, decisions):
        rows[refused] = np.zeros(1, rows.dtype)
        for name in rows.dtype.names or ():
            if rows.dtype[name].kind == 'f':
                rows[name][refused] = np.nan
        rows['stamp'][refused] = stamp[refused]
    last = np.maximum.accumulate(np.where(reason == 0, np.arange(len(reason)), -1))[refused]
    seen = last >= 0
    for name in HELD:
        decisions[name][refused[seen]] = decisions[name][last[seen]]
        decisions[name][refused[~seen]] = getattr(before, name)
