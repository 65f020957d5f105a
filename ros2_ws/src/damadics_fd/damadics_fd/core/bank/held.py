# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What banks of every mode hold: settings, detectors, latest estimates and decisions."""

import hashlib
from collections.abc import Sequence

import numpy as np

from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.bank.rows import LastRefused
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.decision.events import Decision
from damadics_fd.core.intake import Intake
from damadics_fd.core.judgement import Judgement
from damadics_fd.core.quality import ACCEPTED, Quality, Refused
from damadics_fd.core.record import Array, stacked
from damadics_fd.core.settings import Settings

MARK = 16  # bytes of the digest that a state begins with


class Held:
    """
    Hold the records of valves that every mode has.

    :param settings: of each valve.
    :param classes: see `Detector`.
    """

    def __init__(self, settings: Sequence[Settings], classes: Sequence[int]) -> None:
        self.classes = classes
        self.settings = list(dict.fromkeys(settings))  # each once
        place = {one: w for w, one in enumerate(self.settings)}
        self.which = np.array([place[one] for one in settings], np.int64)
        self.records = stacked(one.record() for one in self.settings)
        firsts = [Detector(one, classes) for one in self.settings]
        self.signature_records = stacked(first.signature.record for first in firsts)
        count = len(settings)
        self.quality = Quality.rows(count)
        self.detectors = np.repeat(firsts[0].state, count)
        self.signatures = self.copies(firsts[0].signature.state, count)
        self.estimates = Estimate.rows(count)
        self.decisions = Decision.rows(count)
        self.refused = LastRefused.rows(count)

    def copies(self, first: Array, count: int) -> Array:
        """
        Return copies of a record that every sample works on.

        :param first: the record, in an array of length 1.
        :param count: how many.
        :return: structured array of that length.
        """
        return np.repeat(first, count)

    def of(self, v: int) -> Settings:
        """
        Return the settings of a valve.

        :param v: which.
        :return: the settings.
        """
        return self.settings[int(self.which[v])]

    def detector(self, v: int) -> Detector:
        """
        Return the detector of a valve.

        :param v: which.
        :return: it works on the records here.
        """
        part = slice(v, v + 1)
        return Detector(self.of(v), self.classes).hold(
            self.detectors[part], self.signatures[part], self.estimates[part], self.decisions[part]
        )

    def judgement(self, v: int) -> Judgement | None:
        """
        Say what the fault of a valve is taken for, where the estimator judges that.

        :param v: which.
        :return: None where it does not, or there was no alarm.
        """
        return None

    def last_refused(self, v: int) -> Refused | None:
        """
        Return why the last refused sample of a valve was refused.

        :param v: which.
        :return: None where none was.
        """
        row = self.refused[v]
        if row.reason == ACCEPTED:
            return None
        intake = Intake(self.of(v))
        intake.quality = self.quality[v : v + 1]
        return intake.note(
            int(row.reason), int(row.stamp), row['values'].tolist(), int(row.before)
        )

    def state_arrays(self) -> list[Array]:
        """
        Return the arrays with a record of each valve.

        :return: what `tobytes` tells.
        """
        return [
            self.quality,
            self.refused,
            self.detectors,
            self.signatures,
            self.estimates,
            self.decisions,
        ]

    def records_size(self) -> int:
        """
        Return how many bytes the records of a valve take, with their digest.

        :return: the number.
        """
        return MARK + sum(array.dtype.itemsize for array in self.state_arrays())

    def tobytes(self, v: int) -> bytes:
        """
        Return the records of a valve.

        :param v: which.
        :return: a digest of their layout, then the records.
        """
        return self._mark() + b''.join(array[v : v + 1].tobytes() for array in self.state_arrays())

    def restore_bytes(self, v: int, state: bytes) -> None:
        """
        Take up the records of a valve.

        :param v: which.
        :param state: as from `tobytes`.
        :raises ValueError: where it is not that.
        """
        if state[:MARK] != self._mark() or len(state) != self.records_size():
            raise ValueError(
                'the state of the valve is of another mode or version, or damaged: '
                'move what was learned and the alarm instead'
            )
        at = MARK
        for array in self.state_arrays():
            size = array.dtype.itemsize
            array[v : v + 1].view(np.uint8)[:] = np.frombuffer(state, np.uint8, size, at)
            at += size

    def _mark(self) -> bytes:
        layouts = '\n'.join(str(array.dtype.descr) for array in self.state_arrays())
        return hashlib.sha256(f'{self.settings[0].mode}\n{layouts}'.encode()).digest()[:MARK]
