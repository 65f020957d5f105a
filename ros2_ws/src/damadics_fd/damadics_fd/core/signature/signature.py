# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The valve signature: friction, spring or sensor; small and slow changes; how large."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from damadics_fd.core.jit import jit
from damadics_fd.core.signature.own_alarm import end_alarm
from damadics_fd.core.signature.reference import learning_progress
from damadics_fd.core.signature.state import (
    CAUSE_ELASTIC,
    CAUSES,
    MIN_RATE,
    REFERENCE_DTYPE,
    STATE_ALARM,
    STATE_DTYPE,
    STATE_INSUFFICIENT,
    STATE_MONITOR,
    STATE_VERIFY,
    X1,
    SignatureSettings,
    known,
    settings_record,
)
from damadics_fd.core.signature.step import step

UNKNOWN = ('air_rate', 'now', 'now_std')
LATER = {'air_ref_ps': [0.0, 0.0]}  # what references of version 0.1 do not have


@jit
def _update(
    s: Any, c: Any, t: int, x: float, ps: float, dp: float, ready: bool, alarm: bool
) -> int:
    """Call `step` with the records of arrays of length 1."""
    return step(s[0], c[0], t, x, ps, dp, ready, alarm)


@jit
def _clear(state: Any) -> None:
    """Clear the latched alarm of an array of length 1."""
    s = state[0]
    if s.state == STATE_ALARM:
        s.alarm_in = 0
        end_alarm(s)


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
    """The valve signature of one actuator, sample by sample."""

    def __init__(self, settings: SignatureSettings) -> None:
        self.settings = settings
        self.record = settings_record(settings)
        self.state = np.zeros(1, STATE_DTYPE)
        self.relearn()

    def update(
        self, t: int, x: float, ps: float, dp: float, ready: bool = True, alarm: bool = False
    ) -> int:
        """
        Take one accepted sample.

        :param t: [ns] stamp.
        :param x: [1] raw stem position / stroke.
        :param ps: [Pa] chamber pressure, gauge; NaN where not measured.
        :param dp: [Pa] P1 - P2.
        :param ready: False while the filters settle or the input is interrupted.
        :param alarm: an alarm is present or latched, whoever raised it.
        :return: QUIET, BLOCK or CHANGED.
        """
        result: int = _update(self.state, self.record, t, x, ps, dp, ready, alarm)
        return result

    def clear(self) -> None:
        """Clear the latched alarm; what follows is judged afresh."""
        _clear(self.state)

    def relearn(self) -> None:
        """Forget the reference and learn it anew from the next sample on."""
        self.state[:] = np.zeros(1, STATE_DTYPE)
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

    def save(self) -> dict[str, Any]:
        """
        Return the reference, to be kept over a restart.

        :return: plain numbers and lists by name, fit for JSON; empty while nothing is learned.
        """
        if self.state['state'][0] < STATE_VERIFY:
            return {}
        return {name: self.state[name][0].tolist() for name in REFERENCE_DTYPE.names or ()}

    def load(self, saved: Mapping[str, Any]) -> None:
        """
        Start from a saved reference instead of learning.

        :param saved: as returned by `save`.
        :raises ValueError: where it is no such reference; the present state is then untouched.
        """
        saved = {**LATER, **saved}
        wrong = sorted(set(saved) ^ set(REFERENCE_DTYPE.names or ()))
        if wrong:
            raise ValueError(f'signature reference: {", ".join(wrong)} missing or unknown')
        state = np.zeros(1, STATE_DTYPE)
        for name, value in saved.items():
            try:
                given = np.asarray(value, state[name].dtype)
            except (TypeError, ValueError, OverflowError) as error:
                raise ValueError(f'signature reference: {name} does not fit: {error}') from error
            if given.shape != state[name].shape[1:]:
                raise ValueError(f'signature reference: {name} has the shape {given.shape}')
            state[name][0] = given
            if not np.isfinite(state[name]).all():
                raise ValueError(f'signature reference: {name} is not finite')
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
