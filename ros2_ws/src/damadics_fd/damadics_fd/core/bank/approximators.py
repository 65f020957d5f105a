# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Valves in the modes paper and monitor: the approximator of each."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from damadics_fd.core.approximator.estimator import Estimator
from damadics_fd.core.bank.ahead import Part, places
from damadics_fd.core.bank.held import Held
from damadics_fd.core.bank.rows import Reasons, take_approximator
from damadics_fd.core.decision.events import Decision
from damadics_fd.core.record import Array, Floats, Ints, stacked
from damadics_fd.core.settings import Settings


class Approximators(Held):
    """
    Hold the approximators of many valves.

    :param settings: of each valve, all of mode paper or all of mode monitor.
    :param classes: see `Detector`.
    """

    def __init__(self, settings: Sequence[Settings], classes: Sequence[int]) -> None:
        super().__init__(settings, classes)
        firsts = stacked(Estimator(one).state for one in self.settings)
        self.states = firsts[self.which]
        self.ahead = places(  # of fields that nearly every sample needs
            [
                Part(self.quality),
                Part(self.states, 'elapsed'),
                Part(self.detectors, last='near_misses'),
                Part(self.detectors, 'shelved_until'),
                Part(self.estimates),
                Part(self.decisions),
                Part(self.signatures, last='run'),
            ]
        )
        self._room = np.empty(0, Decision.dtype())  # for decisions, kept from call to call

    def take(
        self, valve: Ints, stamp: Ints, signals: Sequence[Floats]
    ) -> tuple[Reasons, Ints, Array]:
        """
        Take checked rows.

        :param valve: of each row.
        :param stamp: of each row [ns].
        :param signals: columns in the order of SIGNALS.
        :return: reason of each row, changed rows, their decisions.
        """
        n = len(valve)
        reason, changed = np.empty(n, np.uint8), np.empty(n, np.int64)
        if len(self._room) < n:
            self._room = np.empty(n, Decision.dtype())
        decisions = self._room
        count = take_approximator(
            self.ahead,
            self.quality,
            self.refused,
            self.states,
            self.detectors,
            self.signatures,
            self.estimates,
            self.decisions,
            self.which,
            self.records,
            self.signature_records,
            valve,
            reason,
            changed,
            decisions,
            stamp,
            *signals,
        )
        return reason, changed[:count], decisions[:count].copy()

    def estimator(self, v: int) -> Estimator:
        """
        Return the estimator of a valve.

        :param v: which.
        :return: it works on the records here.
        """
        part = slice(v, v + 1)
        estimator = Estimator(self.of(v)).hold(self.quality[part], self.states[part])
        estimator.refused = self.last_refused(v)
        return estimator

    @contextmanager
    def opened(self, v: int) -> Iterator[Estimator]:
        """
        Lend the estimator of a valve for a change of what it has learned.

        :param v: which.
        """
        yield self.estimator(v)

    def state_arrays(self) -> list[Array]:
        """
        Return the arrays with a record of each valve.

        :return: what `tobytes` tells.
        """
        return [*super().state_arrays(), self.states]
