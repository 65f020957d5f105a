# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The valve signature: friction, spring or sensor; small and slow changes; how large."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from damadics_fd.core.record import Plain, Saved
from damadics_fd.core.signature.reference import learning_progress
from damadics_fd.core.signature.settings import MIN_RATE, SignatureSettings
from damadics_fd.core.signature.state import (
    CAUSE_ELASTIC,
    CAUSES,
    SAVED,
    STATE_INSUFFICIENT,
    STATE_MONITOR,
    STATE_VERIFY,
    X1,
    State,
    known,
)

UNKNOWN = ('air_rate', 'now', 'now_std')
LATER: Saved = {  # what older references do not have
    'air_ref_ps': [0.0, 0.0],
    'air_law': [[0.0] * 4] * 2,
}


@dataclass(frozen=True, slots=True)
class SignatureView:
    """What the signature knows, in the units of damadics_msgs/Signature."""

    state: int
    family: int
    cause: str
    value: float
    std: float
    confidence: float
    second: str  # the likeliest cause while `cause` is 'elastic'


class Signature:
    """The valve signature of one actuator."""

    def __init__(self, settings: SignatureSettings) -> None:
        self.settings = settings
        self.record = settings.record()
        self.state = State.rows()
        self.relearn()

    def relearn(self) -> None:
        """Forget the reference and learn it anew from the next sample on."""
        self.state[:] = State.rows()
        for name in UNKNOWN:
            self.state[name] = math.nan

    @property
    def progress(self) -> float:
        """Share of the learning that is done, 0..1."""
        if self.state['state'][0] >= STATE_VERIFY:
            return 1.0
        return float(learning_progress(self.state[0], self.record[0]))

    @property
    def lacking(self) -> str:
        """
        Say what cannot be seen, and what to do.

        :return: '' where nothing is missing, or learning goes on as it should.
        """
        if not self.settings.available:
            slow = self.settings.sample_period > 1.0 / MIN_RATE
            return f'causes are unavailable below {MIN_RATE:g} Hz' if slow else ''
        if self.state['state'][0] != STATE_INSUFFICIENT:
            return ''
        return (
            'causes and small faults are unavailable: moves were too small or too few to learn '
            f'the force balance ({100.0 * self.progress:.0f} %); give the valve some strokes of '
            f'{self.settings.learn_range:g} of its range, both ways'
        )

    def save(self) -> Saved:
        """
        Return the reference, to be kept over a restart.

        :return: plain numbers and lists by name, fit for JSON; empty while nothing is learned.
        """
        if self.state['state'][0] < STATE_VERIFY:
            return {}
        return State.plain(self.state, SAVED)

    def load(self, saved: Mapping[str, Plain]) -> None:
        """
        Start from a saved reference instead of learning.

        :param saved: as returned by `save`.
        :raises ValueError: where it is no such reference; the present state is then untouched.
        """
        state = State.read({**LATER, **saved}, 'signature reference', SAVED)
        if not (
            state['sigma'][0] > 0.0
            and state['r_ref'][0] > 0.0
            and state['kappa'][0] >= 1.0
            and state['unit'][0, X1] > 0.0
            and state['unit_weight'][0] > 0.0
        ):
            raise ValueError(
                'signature reference: sigma, r_ref, kappa, stiffness and weight must be positive'
            )
        state['state'] = STATE_MONITOR if state['verified'][0] else STATE_VERIFY
        state['index'] = -1
        state['n_learn'] = np.inf  # its sums are not kept: VERIFY only checks it
        for name in UNKNOWN:
            state[name] = math.nan
        self.state[:] = state

    def view(self) -> SignatureView:
        """Return the present judgement."""
        s = self.state[0]
        value, std, confidence = known(s.cause_value, s.cause_std, s.confidence)
        return SignatureView(
            int(s.state),
            int(s.family),
            CAUSES[int(s.cause)],
            value,
            std,
            confidence,
            CAUSES[int(s.second)] if s.cause == CAUSE_ELASTIC else 'none',
        )
