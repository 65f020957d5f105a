# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The detector: one estimate in, one decision out."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.approximator.step import ESTIMATE, Estimate
from damadics_fd.core.decision import alarm
from damadics_fd.core.decision import saved as saved_state
from damadics_fd.core.decision.events import Event, events_of
from damadics_fd.core.decision.judge import DECISION, STATE, judge, show
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.signature import Signature
from damadics_fd.core.signature.state import NO_CLASSES, SignatureSettings

ACCEPTED = np.zeros(1, np.uint8)


class Decision(NamedTuple):
    """Hold one judgement of the detector; stamps in ns, states as in damadics_msgs/FaultFlag."""

    stamp: int
    residual: float  # |xi2| [1/s]
    threshold: float  # rho [1/s]
    ratio: float  # residual / threshold
    exceed: bool  # the residual counts and is not below the threshold
    fault: bool  # a fault is flagged
    state: int
    level: int  # NAMUR NE 107
    since: int  # last change of `fault`
    onset: int  # estimated onset of the fault, 0 while there is none
    occurrence: int  # faults flagged since the start
    acknowledged: bool
    peak: float  # largest ratio of this fault
    still: float  # time since the stem last moved by 1 % of its stroke [s]
    cause: int  # as in damadics_msgs/Signature
    strength: float  # change in the unit of the cause, 0 if unknown
    spread: float  # its standard deviation, 0 if unknown
    confidence: float  # probability of the cause, 0 if unknown
    transitions: int  # bit n: transition n of damadics_msgs/FaultEvent
    events: Sequence[Event] = ()


class Outcome(NamedTuple):
    """Hold what became of a request of an operator."""

    done: bool
    text: str  # one sentence; the reason where it was refused
    events: tuple[Event, ...]


class Detector:
    """
    Decide from one estimate after the other whether there is a fault.

    :param settings: all settings, the same as those of the estimator.
    :param classes: least NAMUR NE 107 class of an alarm by its cause, in the order of
        `signature_types.CAUSES`; without it the class tells the size of the residual alone.
    """

    def __init__(self, settings: Settings, classes: Sequence[int] = NO_CLASSES) -> None:
        self.settings = settings
        self.state = np.zeros(1, STATE)
        self.signature = Signature(SignatureSettings.of(settings, classes))
        self._settings = settings.record()
        self._estimate = np.zeros(1, ESTIMATE)
        self._decision = np.zeros(1, DECISION)
        self.reset()

    def reset(self) -> None:
        """Forget everything, alarms too."""
        self.state[:] = np.zeros(1, STATE)
        self._decision[:] = np.zeros(1, DECISION)
        self.signature.relearn()
        alarm.begin(self.state[0])
        self.state['moved'] = -1

    def update(self, estimate: Estimate) -> Decision:
        """
        Judge one estimate.

        :param estimate: what the estimator returned.
        :return: the decision; `events` holds the transitions of the alarm at this sample.
        """
        self._estimate[0] = estimate
        self.judge(ACCEPTED, self._estimate, self._decision)
        return self.decision

    def judge(
        self,
        reason: NDArray[np.uint8],
        estimates: NDArray[Any],
        decisions: NDArray[Any],
        keep: bool = True,
        first: int = 0,
    ) -> tuple[int, int]:
        """
        Judge a column of estimates.

        :param reason: 0 where there is an estimate.
        :param estimates: structured, fields of Estimate.
        :param decisions: structured, fields of Decision; written where there is an estimate.
        :param keep: keep a row for each; otherwise only decisions with a transition, as many as
            there is room for.
        :param first: row to begin with.
        :return: the row after the last one, and the number of decisions with a transition.
        """
        done: tuple[int, int] = judge(
            self.state,
            self._settings,
            self.signature.state,
            self.signature.record,
            reason,
            estimates,
            decisions,
            keep,
            first,
        )
        return done

    @property
    def decision(self) -> Decision:
        """
        Return the latest decision, with what operators did since.

        :return: the decision.
        """
        result = Decision(*self._decision.item())
        return result._replace(events=events_of(result)) if result.transitions else result

    @property
    def statistics(self) -> dict[str, int]:
        """
        Return the counts for a report.

        :return: `occurrences`, `near_misses`, and `chatter`: 1 while alarms follow too quickly.
        """
        s = self.state[0]
        return {
            'occurrences': int(s.occurrence),
            'near_misses': int(s.near_misses),
            'chatter': int(s.chatter),
        }

    def acknowledge(self, occurrence: int | None = None) -> Outcome:
        """
        Note that a person has seen the alarm.

        :param occurrence: number of the alarm; the present one where it is None.
        :return: whether it was done, a sentence, and the events.
        """
        return self._outcome(alarm.acknowledge(self.state[0], occurrence))

    def reset_alarm(self) -> Outcome:
        """
        Release the latch of an alarm whose condition has gone.

        :return: whether it was done, a sentence, and the events.
        """
        return self._outcome(alarm.reset(self.state[0]))

    def shelve(self, seconds: float) -> Outcome:
        """
        Mask alarms for a time.

        :param seconds: how long, counted in stamps of the measurement.
        :return: whether it was done, a sentence, and the events.
        """
        return self._outcome(alarm.shelve(self.state[0], seconds))

    def unshelve(self) -> Outcome:
        """
        End a shelf before its time.

        :return: whether it was done, a sentence, and the events.
        """
        return self._outcome(alarm.unshelve(self.state[0]))

    def save(self) -> dict[str, Any]:
        """
        Return the state, alarms included, to be kept over a restart.

        :return: plain numbers and lists by name, fit for JSON.
        """
        return {name: self.state[name][0].tolist() for name in STATE.names or ()}

    def load(self, saved: Mapping[str, Any]) -> None:
        """
        Take up a state that `save` returned; the alarm goes on where it was.

        :param saved: the state.
        :raises ValueError: where it is not such a state; the present one is then untouched.
        """
        state = np.zeros(1, STATE)
        values = saved_state.complete(saved)
        wrong = sorted(set(values) ^ set(STATE.names or ()))
        if wrong:
            raise ValueError(f'alarm state: {", ".join(wrong)} missing or unknown')
        saved_state.check(values)
        for name, value in values.items():
            try:
                state[name][0] = value
            except (TypeError, ValueError, OverflowError) as error:
                raise ValueError(f'alarm state: {name} does not fit: {error}') from error
        self.state[:] = state
        self._show(0)

    def lose(self) -> None:
        """Begin afresh where the state of before is lost: shown until a person has seen it."""
        self.reset()
        alarm.lose(self.state[0])
        self._show(0)

    def _outcome(self, answer: alarm.Answer) -> Outcome:
        if not answer.transitions:
            return Outcome(answer.done, answer.text, ())
        self._show(answer.transitions)
        return Outcome(answer.done, answer.text, tuple(self.decision.events))

    def _show(self, transitions: int) -> None:
        show(
            self.state, self.signature.state, self.signature.record, self._estimate, self._decision
        )
        self._decision['transitions'] = transitions
