# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The detector: one estimate in, one decision out."""

from collections.abc import Mapping, Sequence
from operator import attrgetter
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.decision import alarm, requests
from damadics_fd.core.decision import saved as saved_state
from damadics_fd.core.decision.events import Decision, Event
from damadics_fd.core.decision.judge import State, judge, show
from damadics_fd.core.record import Array, Plain, Saved
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.signature import Signature
from damadics_fd.core.signature.state import NO_CLASSES

ACCEPTED = np.zeros(1, np.uint8)
_VALUES = attrgetter(*Estimate.names())


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
        `signature.state.CAUSES`; without it the class tells the size of the residual alone.
    """

    def __init__(self, settings: Settings, classes: Sequence[int] = NO_CLASSES) -> None:
        self.settings = settings
        self.state = State.rows()
        self.signature = Signature(SignatureSettings.of(settings, classes))
        self._settings = settings.record()
        self._estimate = Estimate.rows()
        self._decision = Decision.rows()  # the latest
        self._rows = Decision.rows()
        self.reset()

    def hold(self, state: Array, signature: Array, estimate: Array, decision: Array) -> Self:
        """
        Go on with a state that is kept elsewhere, in place.

        :param state: of the detector; each is an array of length 1, like the following.
        :param signature: state of the signature.
        :param estimate: the latest one.
        :param decision: the latest one.
        :return: this detector.
        """
        self.state, self._estimate, self._decision = state, estimate, decision
        self.signature.state = signature
        return self

    @property
    def arrays(self) -> tuple[Array, Array, Array, Array, Array, Array]:
        """
        Return what it works on, of length 1.

        :return: state, settings, state and settings of the signature, latest estimate, decision.
        """
        signature = self.signature
        return (
            self.state,
            self._settings,
            signature.state,
            signature.record,
            self._estimate,
            self._decision,
        )

    @property
    def estimate(self) -> Estimate:
        """Return the estimate that was judged last."""
        return Estimate(*self._estimate.item())

    def reset(self) -> None:
        """Forget everything, alarms too."""
        self.state[:] = State.rows()
        self._decision[:] = Decision.rows()
        self.signature.relearn()
        alarm.begin(self.state[0])
        self.state['moved'] = -1

    def update(self, estimate: Estimate) -> Decision:
        """
        Judge one estimate.

        :param estimate: what the estimator returned.
        :return: the decision; its `events` are the transitions of the alarm at this sample.
        """
        self._estimate[0] = _VALUES(estimate)
        self.judge(ACCEPTED, self._estimate, self._rows)
        return self.decision

    def judge(
        self,
        reason: NDArray[np.uint8],
        estimates: Array,
        decisions: Array,
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
        return judge(
            self.state,
            self._settings,
            self.signature.state,
            self.signature.record,
            reason,
            estimates,
            decisions,
            self._estimate,
            self._decision,
            keep,
            first,
        )

    @property
    def decision(self) -> Decision:
        """
        Return the latest decision, with what operators did since.

        :return: the decision.
        """
        return Decision(*self._decision.item())

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
        return self._outcome(requests.acknowledge(self.state[0], occurrence))

    def reset_alarm(self) -> Outcome:
        """
        Release the latch of an alarm whose condition has gone.

        :return: whether it was done, a sentence, and the events.
        """
        return self._outcome(requests.reset(self.state[0]))

    def shelve(self, seconds: float) -> Outcome:
        """
        Mask alarms for a time.

        :param seconds: how long, counted in stamps of the measurement.
        :return: whether it was done, a sentence, and the events.
        """
        return self._outcome(requests.shelve(self.state[0], seconds))

    def unshelve(self) -> Outcome:
        """
        End a shelf before its time.

        :return: whether it was done, a sentence, and the events.
        """
        return self._outcome(requests.unshelve(self.state[0]))

    def antedate(self, onset: int) -> None:
        """
        Take over an earlier onset of the present alarm from who knows better.

        :param onset: estimated [ns]; a later one than the present changes nothing.
        """
        s = self.state[0]
        if (s.active or s.latched) and 0 < onset < s.onset:
            s.onset = onset
            self._show(0)

    def save(self) -> Saved:
        """
        Return the state, alarms included, to be kept over a restart.

        :return: plain numbers and lists by name, fit for JSON.
        """
        return State.plain(self.state)

    def load(self, saved: Mapping[str, Plain]) -> None:
        """
        Take up a state that `save` returned; the alarm goes on where it was.

        :param saved: the state.
        :raises ValueError: where it is not such a state; the present one is then untouched.
        """
        values = saved_state.complete(saved)
        state = State.read(values, 'alarm state')
        saved_state.check(values)
        self.state[:] = state
        self._show(0)

    def lose(self) -> None:
        """Begin afresh where the state of before is lost: shown until a person has seen it."""
        self.reset()
        requests.lose(self.state[0])
        self._show(0)

    def _outcome(self, answer: requests.Answer) -> Outcome:
        if not answer.transitions:
            return Outcome(answer.done, answer.text, ())
        self._show(answer.transitions)
        return Outcome(answer.done, answer.text, self.decision.events)

    def _show(self, transitions: int) -> None:
        show(
            self.state, self.signature.state, self.signature.record, self._estimate, self._decision
        )
        self._decision['transitions'] = transitions
