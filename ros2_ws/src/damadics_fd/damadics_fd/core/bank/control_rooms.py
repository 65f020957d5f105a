# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Valves in mode scada: models and tests of each; what is still learned goes sample by sample."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from damadics_fd.core.bank.held import Held
from damadics_fd.core.bank.lazily import copies
from damadics_fd.core.bank.rows import LATER, Reasons, decide, note, take_control_room
from damadics_fd.core.decision.events import Decision
from damadics_fd.core.judgement import Judgement
from damadics_fd.core.modes import PHASE_INIT
from damadics_fd.core.quality import ACCEPTED
from damadics_fd.core.record import Array, Floats, Ints, stacked
from damadics_fd.core.scada.estimator import BLANK, ScadaEstimator
from damadics_fd.core.scada.kernel import Shown
from damadics_fd.core.scada.naming.looks import Looks
from damadics_fd.core.scada.state import MONITOR, REFERENCE
from damadics_fd.core.settings import Settings

HEAD = MONITOR.fields['history'][1] if MONITOR.fields else 0  # [B]; the samples stand behind it


class ControlRooms(Held):
    """
    Hold models and tests of many valves.

    :param settings: of each valve, all of mode scada.
    :param classes: see `Detector`.
    """

    def __init__(self, settings: Sequence[Settings], classes: Sequence[int]) -> None:
        super().__init__(settings, classes)
        self._looks: dict[int, Looks] = {}  # of valves that had an alarm
        count = len(settings)
        self.monitor_records = stacked(ScadaEstimator(one).monitor.record for one in self.settings)
        self.shown = Shown.rows(count)
        self.shown['phase'] = PHASE_INIT
        self.states = copies(BLANK, count)
        self.references = np.zeros(count, REFERENCE)
        self.learned = np.zeros(count, np.bool_)
        self.learning: dict[int, ScadaEstimator] = {}  # made with the first sample

    def copies(self, first: Array, count: int) -> Array:
        """
        Return copies of the signature's record, which this mode does not use.

        :param first: the record, in an array of length 1.
        :param count: how many.
        :return: structured array of that length.
        """
        return copies(first, count)

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
        decisions = np.empty(n, Decision.dtype())
        count = take_control_room(
            self.quality,
            self.refused,
            self.shown,
            self.states,
            self.monitor_records,
            self.references,
            self.learned,
            BLANK,
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
        for i in np.flatnonzero(reason == LATER):
            v = int(valve[i])
            row = slice(i, i + 1)
            self._lend(v).run(
                stamp[row], [s[row] for s in signals], reason[row], self.estimates[v : v + 1]
            )
            if reason[i] != ACCEPTED:
                note(
                    self.refused[v],
                    self.quality[v],
                    int(reason[i]),
                    int(stamp[i]),
                    *(float(signal[i]) for signal in signals),
                )
            elif self._decide(v):
                changed[count] = i
                decisions[count] = self.decisions[v]
                count += 1
        for v in [v for v, one in self.learning.items() if one.monitor.reference is not None]:
            self._keep(v, self.learning.pop(v))
        order = np.argsort(changed[:count], kind='stable')
        return reason, changed[:count][order], decisions[:count][order]

    def _decide(self, v: int) -> bool:
        w = int(self.which[v])
        return decide(
            self.detectors[v],
            self.signatures[v],
            self.estimates[v],
            self.decisions[v],
            self.records[w],
            self.signature_records[w],
        )

    def estimator(self, v: int) -> ScadaEstimator:
        """
        Return the estimator of a valve, to be asked.

        :param v: which.
        :return: it works on the records here.
        """
        estimator = self._lend(v)
        estimator.refused = self.last_refused(v)
        return estimator

    def judgement(self, v: int) -> Judgement | None:
        """
        Say what the fault of a valve is taken for; looked at now and then.

        :param v: which.
        :return: the same object as before where nothing has changed; None before any alarm.
        """
        estimator = self._lend(v)
        estimator.looks = self._looks.setdefault(v, Looks())
        return estimator.judgement

    @contextmanager
    def opened(self, v: int) -> Iterator[ScadaEstimator]:
        """
        Lend the estimator of a valve for a change of what it has learned.

        :param v: which.
        """
        estimator = self.estimator(v)
        yield estimator
        self.learning.pop(v, None)
        self._keep(v, estimator)

    def _lend(self, v: int) -> ScadaEstimator:
        known = self.learning.get(v)
        if known is not None:
            return known
        part = slice(v, v + 1)
        estimator = ScadaEstimator(self.of(v)).hold(self.quality[part], self.shown[part])
        if self.learned[v]:
            estimator.monitor.hold(self.states[part], self.references[part])
        else:
            self.learning[v] = estimator
        return estimator

    def _keep(self, v: int, estimator: ScadaEstimator) -> None:
        """Take a valve's estimator into the arrays, or among those that are learned."""
        reference = estimator.monitor.reference
        self.learned[v] = reference is not None
        if reference is None:
            self.learning[v] = estimator
            return
        self.references[v] = reference[0]
        kept, given = self.states[v : v + 1], estimator.monitor.states
        if _begun(kept) or _begun(given):  # else both are zero, and shall take no memory
            kept[:] = given

    def state_arrays(self) -> list[Array]:
        """
        Return the arrays with a record of each valve.

        :return: what `tobytes` tells.
        """
        return [*super().state_arrays(), self.shown, self.states, self.references]

    def tobytes(self, v: int) -> bytes:
        """
        Return the state of a valve.

        :param v: which.
        :return: as from `Held.tobytes`, then what a valve has seen that is still learned.
        """
        seen = b'' if self.learned[v] else self._lend(v).monitor.seen_bytes()
        return super().tobytes(v) + seen

    def restore_bytes(self, v: int, state: bytes) -> None:
        """
        Take up the state of a valve.

        :param v: which.
        :param state: as from `tobytes`.
        :raises ValueError: where it is not that.
        """
        records = self.records_size()
        super().restore_bytes(v, state[:records])
        self.learning.pop(v, None)
        self.learned[v] = len(state) == records
        if not self.learned[v]:
            self._lend(v).monitor.restore_seen(state[records:])


def _begun(state: Array) -> bool:
    """Tell whether a monitor has seen anything; what it remembers of samples is not looked at."""
    return bool(state.view(np.uint8)[:HEAD].any())
