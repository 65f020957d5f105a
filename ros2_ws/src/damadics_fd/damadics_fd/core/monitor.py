# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A monitor: samples of one valve in, decisions out; the three modes behind one Protocol."""

from collections.abc import Mapping, Sequence
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.decision.alarm import RAISED
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.decision.events import Decision, Event
from damadics_fd.core.estimating import Estimating, estimator_for
from damadics_fd.core.judgement import Judgement, with_judgements
from damadics_fd.core.quality import REASONS, Refused
from damadics_fd.core.record import Array, Floats, Ints, Plain, Saved
from damadics_fd.core.result import Columns, Result, contiguous, events_in, hold_refused
from damadics_fd.core.sample import Sample
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.signature import Signature
from damadics_fd.core.signature.state import NO_CLASSES

PIECE = 4096  # samples that `events` holds at once
ROOM = 64  # decisions with a transition that it takes from the loop at once


class Monitor(Protocol):
    """Turn samples of one valve into decisions, live or of a recording: the same bits."""

    def update(self, sample: Sample) -> Decision | Refused:
        """
        Take one sample.

        :param sample: the sample.
        :return: the decision on it, or why it was refused.
        """

    def run(self, columns: Columns) -> Result:
        """
        Take a recording, or the next piece of one.

        :param columns: `stamp` (int64, ns), `cv`, `x1`, and `p1`, `p2`, `t1`, `flow`, `ps` where
            they are measured; 1-D arrays of one length.
        :return: estimates, decisions, counters, events.
        :raises KeyError: where `stamp`, `cv` or `x1` is absent.
        :raises ValueError: where the columns differ in length.
        """

    def learned(self) -> Saved:
        """
        Return what was learned, to be kept over a restart.

        :return: plain numbers and lists by name, fit for JSON.
        :raises ValueError: where learning is not finished.
        """

    def restore(self, learned: Mapping[str, Plain]) -> None:
        """
        Take up what `learned` returned.

        :param learned: what was learned.
        :raises ValueError: where it is not that; the monitor is then untouched.
        """

    def reset(self) -> None:
        """Forget everything: what was learned, the counters, the alarms."""

    @property
    def status(self) -> str:
        """
        Say in one line what the monitor does.

        :return: for people; never "monitoring" while it does not monitor.
        """


class Chain:
    """
    The monitor of every mode: an estimator and the detector that judges its estimates.

    :param settings: all settings.
    :param classes: least NAMUR NE 107 class of an alarm by its cause, see `Detector`.
    :param estimator: the estimator to go on with; a new one of the mode where it is None.
    :param detector: the detector to go on with; a new one where it is None.

    >>> chain = Chain(Settings.for_mode('paper'))
    >>> chain.update(Sample(0, cv=1.0, x1=0.0)).fault
    False
    >>> chain.update(Sample(2_500_000, cv=1.0, x1=float('nan'))).text
    'not_finite: x1 = nan'
    """

    def __init__(
        self,
        settings: Settings,
        classes: Sequence[int] = NO_CLASSES,
        estimator: Estimating | None = None,
        detector: Detector | None = None,
    ) -> None:
        self.settings = settings
        self.estimator = estimator or estimator_for(settings)
        self.detector = detector or Detector(settings, classes)
        self._judgement: Judgement | None = None  # the latest that was told
        self._latest: Event | None = None  # the latest alarm

    def update(self, sample: Sample) -> Decision | Refused:
        """
        Take one sample.

        :param sample: the sample.
        :return: the decision on it, or why it was refused.
        """
        estimate = self.estimator.update(*sample)
        return estimate if isinstance(estimate, Refused) else self.detector.update(estimate)

    def run(self, columns: Columns) -> Result:
        """
        Take a recording, or the next piece of one, bit for bit as sample by sample.

        :param columns: as `Monitor.run` takes them.
        :return: estimates, decisions, counters, events.
        :raises KeyError: where `stamp`, `cv` or `x1` is absent.
        :raises ValueError: where the columns differ in length.
        """
        stamp, signals = contiguous(columns)
        reason = np.empty(len(stamp), np.uint8)
        estimates = np.empty(len(stamp), Estimate.dtype())
        decisions = np.empty(len(stamp), Decision.dtype())
        before = self.detector.decision
        latest, looks = self._latest, self._estimate(stamp, signals, reason, estimates)
        self.detector.judge(reason, estimates, decisions)
        hold_refused(reason, stamp, estimates, decisions, before)
        result = Result(reason, estimates, decisions, self.estimator, self.detector, looks, latest)
        if looks or self.estimator.stride:
            self._note(result.events)
        return result

    def _estimate(
        self, stamp: Ints, signals: Sequence[Floats], reason: NDArray[np.uint8], estimates: Array
    ) -> tuple[Judgement, ...]:
        """Estimate a column; return the judgements that bring something new."""
        stride = self.estimator.stride
        if not stride:
            self.estimator.run(stamp, signals, reason, estimates)
            return ()
        looks = []
        for first in range(0, len(stamp), stride):
            piece = slice(first, first + stride)
            self.estimator.run(
                stamp[piece],
                [signal[piece] for signal in signals],
                reason[piece],
                estimates[piece],
            )
            judgement = self.estimator.judgement
            if judgement is not None and judgement is not self._judgement:
                looks.append(judgement)
                self._judgement = judgement
        return tuple(looks)

    def _note(self, events: Sequence[Event]) -> None:
        raised = [event for event in events if event.transition == RAISED]
        self._latest = raised[-1] if raised else self._latest

    def events(self, columns: Columns) -> list[Event]:
        """
        Take a recording like `run`, but keep nothing of it but the transitions of the alarm.

        :param columns: as for `run`.
        :return: events in order of time.
        :raises KeyError: as `run`.
        :raises ValueError: as `run`.
        """
        stamp, signals = contiguous(columns)
        reason, estimates = np.empty(PIECE, np.uint8), np.empty(PIECE, Estimate.dtype())
        decisions = np.empty(ROOM, Decision.dtype())
        events: list[Event] = []
        for first in range(0, len(stamp), PIECE):
            piece = slice(first, first + PIECE)
            n = len(stamp[piece])
            latest = self._latest
            looks = self._estimate(
                stamp[piece], [signal[piece] for signal in signals], reason[:n], estimates[:n]
            )
            done = 0
            told: list[Event] = []
            while done < n:
                done, kept = self.detector.judge(reason[:n], estimates[:n], decisions, False, done)
                told += events_in(decisions[:kept])
            told = with_judgements(told, looks, latest) if self.estimator.stride else told
            self._note(told)
            events += told
        return events

    def learned(self) -> Saved:
        """
        Return what was learned, to be kept over a restart.

        :return: plain numbers and lists by name, fit for JSON.
        :raises ValueError: where learning is not finished.
        """
        return self.estimator.learned()

    def restore(self, learned: Mapping[str, Plain]) -> None:
        """
        Take up what `learned` returned.

        :param learned: what was learned.
        :raises ValueError: where it is not that; the monitor is then untouched.
        """
        self.estimator.restore(learned)

    def starting_from(self, learned: Mapping[str, Plain] | None) -> Self:
        """
        Take up what was learned, where there is something.

        :param learned: what `learned` returned; None: nothing.
        :return: this monitor.
        :raises ValueError: as `restore`.
        """
        if learned is not None:
            self.restore(learned)
        return self

    def reset(self) -> None:
        """Forget everything: what was learned, the counters, the alarms."""
        self.estimator.reset()
        self.detector.reset()

    @property
    def status(self) -> str:
        """
        Say in one line what the monitor does.

        :return: for people; never "monitoring" while it does not monitor.
        """
        status = self.estimator.status
        lacking = self.signature.lacking if self.settings.mode == 'monitor' else ''
        if not self.estimator.monitoring or not lacking:
            return status
        return f'{status}; {lacking}'

    @property
    def refused(self) -> dict[str, int]:
        """
        Count the samples that were refused.

        :return: counts by name of the reason, where there are any.
        """
        counters = self.estimator.counters
        return {name: counters[name] for name in REASONS[1:] if counters[name]}

    @property
    def signature(self) -> Signature:
        """
        Return the valve signature.

        :return: of the detector.
        """
        return self.detector.signature


def monitor_for(settings: Settings, classes: Sequence[int] = NO_CLASSES) -> Chain:
    """
    Return the monitor of a mode.

    :param settings: all settings; `settings.mode` chooses.
    :param classes: least NAMUR NE 107 class of an alarm by its cause, see `Detector`.
    :return: a monitor in its first state.
    """
    return Chain(settings, classes)


def run(
    columns: Columns,
    settings: Settings,
    estimator: Estimating | None = None,
    detector: Detector | None = None,
) -> Result:
    """
    Run a recording through a monitor.

    :param columns: as `Monitor.run` takes them.
    :param settings: all settings.
    :param estimator: the estimator to go on with; a new one of the mode where it is None.
    :param detector: the detector to go on with; a new one where it is None.
    :return: estimates, decisions, counters, events.
    :raises KeyError: as `Monitor.run`.
    :raises ValueError: as `Monitor.run`.
    """
    return Chain(settings, estimator=estimator, detector=detector).run(columns)
