# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The detector: one estimate in, one decision out."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core import alarm, decision
from damadics_fd.core.estimator import ESTIMATE, Estimate
from damadics_fd.core.events import Event, events_of
from damadics_fd.core.jit import jit
from damadics_fd.core.settings import Settings
from damadics_fd.core.threshold import threshold

LARGE = 1e9  # ratio to a threshold of zero
DECISION = np.dtype((np.record, np.dtype([
    ('stamp', 'i8'), ('residual', 'f8'), ('threshold', 'f8'), ('ratio', 'f8'), ('exceed', '?'),
    ('fault', '?'), ('state', 'i8'), ('level', 'i8'), ('since', 'i8'), ('onset', 'i8'),
    ('occurrence', 'i8'), ('peak', 'f8'), ('transitions', 'i8'),
], align=True)))
STATE = np.dtype((np.record, np.dtype([*decision.STATE, *alarm.STATE], align=True)))


class Decision(NamedTuple):
    """Hold one judgement of the detector; stamps in ns, states as in damadics_msgs/FaultFlag."""

    stamp: int
    residual: float  # |xi2| [1/s]
    threshold: float  # rho [1/s]
    ratio: float  # residual / threshold
    exceed: bool  # the residual counts and is not below the threshold
    fault: bool  # a fault is flagged
    state: int
    level: int
    since: int  # last change of `fault`
    onset: int  # estimated onset of the fault, 0 while there is none
    occurrence: int  # faults flagged since the start
    peak: float  # largest ratio of this fault
    transitions: int  # bit n: transition n of damadics_msgs/FaultEvent
    events: Sequence[Event] = ()


@jit
def step(s: Any, c: Any, e: Any, d: Any) -> None:
    """
    Judge one estimate.

    :param s: state record.
    :param c: settings record.
    :param e: estimate record.
    :param d: decision record, written.
    """
    armed = decision.armed(e.phase)
    residual = abs(e.xi2)
    rho = threshold(c, e.phi, e.alpha1)
    ratio = min(residual / rho, LARGE) if rho > 0.0 else LARGE
    exceed = armed and residual >= rho and not decision.gated(c, e)
    level = 0
    if armed:
        level = decision.vote(s, c, exceed, ratio)
    else:
        decision.clear(s)
    d.transitions = alarm.step(s, c, e.stamp, armed, exceed, level, ratio)
    d.stamp = e.stamp
    d.residual = residual
    d.threshold = rho
    d.ratio = ratio
    d.exceed = exceed
    d.state = alarm.state_of(s, armed, e.phase)
    d.level = alarm.level_of(s, armed)
    d.fault = s.flag
    d.since = s.since
    d.onset = s.onset if s.active or s.latched else 0
    d.occurrence = s.occurrence
    d.peak = s.peak


@jit
def update(s: NDArray, c: NDArray, e: NDArray, d: NDArray) -> None:
    """
    Judge one estimate; `step` for arrays of length 1, to be called from Python.

    :param s: detector state.
    :param c: settings.
    :param e: estimate.
    :param d: decision, written.
    """
    step(s[0], c[0], e[0], d[0])


class Detector:
    """
    Decide from one estimate after the other whether there is a fault.

    :param settings: all settings, the same as those of the estimator.
    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.state = np.zeros(1, STATE)
        self._settings = settings.record()
        self._estimate = np.zeros(1, ESTIMATE)
        self._decision = np.zeros(1, DECISION)
        self.reset()

    def reset(self) -> None:
        """Forget everything, alarms too."""
        self.state[:] = np.zeros(1, STATE)
        alarm.begin(self.state[0])

    def update(self, estimate: Estimate) -> Decision:
        """
        Judge one estimate.

        :param estimate: what the estimator returned.
        :return: the decision; `events` holds the transitions of the alarm at this sample.
        """
        self._estimate[0] = estimate
        update(self.state, self._settings, self._estimate, self._decision)
        result = Decision(*self._decision.item())
        return result._replace(events=events_of(result)) if result.transitions else result
