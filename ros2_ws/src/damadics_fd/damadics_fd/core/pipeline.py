# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A recording through the compiled loops of estimator and detector."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.approximator import step as estimation
from damadics_fd.core.approximator.estimator import Estimator
from damadics_fd.core.approximator.step import ESTIMATE
from damadics_fd.core.decision.alarm import RAISED
from damadics_fd.core.decision.detector import Decision, Detector
from damadics_fd.core.decision.events import Event, events_of
from damadics_fd.core.decision.judge import DECISION
from damadics_fd.core.jit import jit
from damadics_fd.core.quality import REASONS
from damadics_fd.core.sample import SIGNALS
from damadics_fd.core.scada.estimator import ScadaEstimator, estimator_for
from damadics_fd.core.settings import Settings

PIECE = 4096  # samples that `watch` holds at once
ROOM = 64  # decisions with a transition that it takes from the loop at once


@dataclass(frozen=True)
class Result:
    """
    Hold what estimator and detector made of a recording.

    Row n belongs to sample n; rows of refused samples hold NaN and the state before.
    """

    reason: NDArray[np.uint8]  # 0 accepted, else index into quality.REASONS
    estimates: NDArray[Any]  # structured, fields of Estimate
    decisions: NDArray[Any]  # structured, fields of Decision
    estimator: Estimator  # with the state after the last sample
    detector: Detector

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
        return _events(self.decisions[self.decisions['transitions'] != 0])

    @property
    def detections(self) -> list[Event]:
        """
        List the alarms; in paper mode each rising edge of the two-sample decision.

        :return: the events `raised`.
        """
        return [event for event in self.events if event.transition == RAISED]


@jit
def estimate(
    q: NDArray,
    s: NDArray,
    c: NDArray,
    reason: NDArray,
    estimates: NDArray,
    stamp: NDArray,
    cv: NDArray,
    x1: NDArray,
    p1: NDArray,
    p2: NDArray,
    t1: NDArray,
    flow: NDArray,
    ps: NDArray,
) -> None:
    """
    Run `estimation.step` over columns.

    :param q: quality state.
    :param s: estimator state.
    :param c: settings.
    :param reason: written: 0 or the reason of refusal.
    :param estimates: written; rows of refused samples stay as they are.
    :param stamp: stamps [ns].
    :param cv: control values.
    :param x1: positions.
    :param p1: pressures before the valve.
    :param p2: pressures behind the valve.
    :param t1: temperatures.
    :param flow: flows.
    :param ps: chamber pressures.
    """
    for i in range(len(stamp)):
        reason[i] = estimation.step(
            q[0],
            s[0],
            c[0],
            estimates[i],
            stamp[i],
            cv[i],
            x1[i],
            p1[i],
            p2[i],
            t1[i],
            flow[i],
            ps[i],
        )


def run(
    columns: Mapping[str, NDArray[Any]],
    settings: Settings,
    estimator: Estimator | None = None,
    detector: Detector | None = None,
) -> Result:
    """
    Run a recording through estimator and detector, bit for bit as sample by sample.

    :param columns: `stamp` (int64, ns), `cv`, `x1`, and `p1`, `p2`, `t1`, `flow`, `ps` where
        they are measured; 1-D arrays of one length.
    :param settings: all settings.
    :param estimator: continue with this one instead of a new one (chunks, a loaded reference).
    :param detector: continue with this one instead of a new one.
    :return: estimates, decisions, counters, events.
    :raises KeyError: where `stamp`, `cv` or `x1` is absent.
    :raises ValueError: where the columns differ in length.
    """
    estimator = estimator or estimator_for(settings)
    detector = detector or Detector(settings)
    stamp, signals = _contiguous(columns)
    reason = np.empty(len(stamp), np.uint8)
    estimates = np.empty(len(stamp), ESTIMATE)
    decisions = np.empty(len(stamp), DECISION)
    if isinstance(estimator, ScadaEstimator):
        _run_scada(estimator, detector, stamp, signals, reason, estimates, decisions)
    else:
        estimate(
            estimator.quality,
            estimator.state,
            _record(settings),
            reason,
            estimates,
            stamp,
            *signals,
        )
        detector.judge(reason, estimates, decisions)
    _blank(reason, stamp, estimates, decisions)
    return Result(reason, estimates, decisions, estimator, detector)


def watch(
    columns: Mapping[str, NDArray[Any]],
    settings: Settings,
    estimator: Estimator,
    detector: Detector,
) -> list[Event]:
    """
    Run a recording like `run`, but keep nothing of it but the transitions of the alarm.

    :param columns: as for `run`.
    :param settings: all settings.
    :param estimator: the estimator to go on with.
    :param detector: the detector to go on with.
    :return: events in order of time.
    :raises KeyError: as `run`.
    :raises ValueError: as `run`.
    """
    if isinstance(estimator, ScadaEstimator):
        return run(columns, settings, estimator, detector).events
    stamp, signals = _contiguous(columns)
    reason, estimates = np.empty(PIECE, np.uint8), np.empty(PIECE, ESTIMATE)
    decisions, record = np.empty(ROOM, DECISION), _record(settings)
    events: list[Event] = []
    for first in range(0, len(stamp), PIECE):
        piece = slice(first, first + PIECE)
        n = len(stamp[piece])
        estimate(
            estimator.quality,
            estimator.state,
            record,
            reason,
            estimates,
            stamp[piece],
            *(signal[piece] for signal in signals),
        )
        done = 0
        while done < n:
            done, kept = detector.judge(reason[:n], estimates[:n], decisions, False, done)
            events += _events(decisions[:kept])
    return events


def _events(decisions: NDArray[Any]) -> list[Event]:
    """Return the transitions in some decisions; plain numbers are seven times as fast."""
    return [event for row in decisions.tolist() for event in events_of(Decision(*row))]


@lru_cache(maxsize=16)
def _record(settings: Settings) -> NDArray[Any]:
    """Return the settings for the loop; made once for all pieces of a recording."""
    return settings.record()


def _contiguous(
    columns: Mapping[str, NDArray[Any]],
) -> tuple[NDArray[np.int64], list[NDArray[np.float64]]]:
    """Return stamps and signals as the loop takes them; copy only what is otherwise."""
    missing = [name for name in ('stamp', 'cv', 'x1') if name not in columns]
    if missing:
        raise KeyError(f'the recording has no column {", ".join(missing)}')
    stamp = np.ascontiguousarray(columns['stamp'], np.int64)
    unmeasured = np.broadcast_to(np.array(np.nan), stamp.shape)
    signals = [np.ascontiguousarray(columns.get(name, unmeasured), np.float64) for name in SIGNALS]
    if any(signal.shape != stamp.shape for signal in signals):
        raise ValueError('the columns of the recording differ in length')
    return stamp, signals


def _run_scada(
    estimator: ScadaEstimator,
    detector: Detector,
    stamp: NDArray[np.int64],
    signals: list[NDArray[np.float64]],
    reason: NDArray[np.uint8],
    estimates: NDArray[Any],
    decisions: NDArray[Any],
) -> None:
    rows = zip(stamp.tolist(), *(signal.tolist() for signal in signals), strict=True)
    for i, row in enumerate(rows):
        estimate = estimator.update(*row)
        reason[i] = 0
        if estimate is None:
            reason[i] = REASONS.index(estimator.last_rejection.split(':')[0])
            continue
        estimates[i] = tuple(estimate)
        decisions[i] = tuple(detector.update(estimate))[: len(DECISION.names or ())]


def _blank(
    reason: NDArray[np.uint8],
    stamp: NDArray[np.int64],
    estimates: NDArray[Any],
    decisions: NDArray[Any],
) -> None:
    """Fill the rows of refused samples."""
    refused = np.flatnonzero(reason)
    if not len(refused):
        return
    for rows in (estimates, decisions):
        rows[refused] = np.zeros(1, rows.dtype)
        for name in rows.dtype.names or ():
            if rows.dtype[name].kind == 'f':
                rows[name][refused] = np.nan
        rows['stamp'][refused] = stamp[refused]
    hold = np.maximum.accumulate(np.where(reason == 0, np.arange(len(reason)), -1))[refused]
    seen = hold >= 0
    for name in ('fault', 'state', 'level', 'since', 'onset', 'occurrence'):
        decisions[name][refused[seen]] = decisions[name][hold[seen]]
