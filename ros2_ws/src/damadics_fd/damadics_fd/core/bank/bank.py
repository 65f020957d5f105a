# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
A bank: the monitors of many valves, fed with rows of samples of any of them.

>>> bank = Bank([Settings.for_mode('paper')] * 3)
>>> valve, stamp = np.array([2, 0, 2]), np.array([1, 1, 2_500_001])
>>> half = np.full(3, 0.5)
>>> bank.take(valve, stamp, {'cv': half, 'x1': half}).reason.tolist()
[0, 0, 0]
>>> bank.counters(2)['accepted']
2
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.bank.approximators import Approximators
from damadics_fd.core.bank.control_rooms import ControlRooms
from damadics_fd.core.bank.rows import Reasons
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.judgement import Judgement
from damadics_fd.core.quality import Refused
from damadics_fd.core.record import Array, Floats, Ints, Plain, Saved
from damadics_fd.core.sample import SIGNALS
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.state import NO_CLASSES


class Changes(NamedTuple):
    """Hold what some rows changed."""

    reason: Reasons  # of every row: 0 accepted, else a `quality.Reason`
    row: Ints  # at which a transition happened or the flag of the valve shows something else
    decisions: Array  # rows of `Decision` at these rows; their `transitions` tell the events


class Bank:
    """
    Monitor many valves of one mode; for each, the same decisions bit for bit as `Monitor.run`.

    Valves are numbered from 0 in the order of their settings. The state of a valve is a few
    records in arrays; `tobytes` and `restore_bytes` move it to another bank or process.

    :param settings: of each valve; all of one mode. Valves with equal settings share a record.
    :param classes: least NAMUR NE 107 class of an alarm by its cause, see `Detector`.
    :raises ValueError: where there is no valve, or the modes differ.
    """

    def __init__(self, settings: Sequence[Settings], classes: Sequence[int] = NO_CLASSES) -> None:
        modes = {one.mode for one in settings}
        if len(modes) != 1:
            raise ValueError(f'a bank takes valves of one mode, got {sorted(modes) or "no valve"}')
        self.mode = modes.pop()
        kind = ControlRooms if self.mode == 'scada' else Approximators
        self._held = kind(settings, classes)

    def __len__(self) -> int:
        """Return the number of valves."""
        return len(self._held.which)

    @property
    def decisions(self) -> Array:
        """
        Return the latest decision of each valve; a copy is not made.

        :return: rows of `Decision`.
        """
        return self._held.decisions

    @property
    def estimates(self) -> Array:
        """
        Return the latest estimate of each valve; a copy is not made.

        :return: rows of `Estimate`.
        """
        return self._held.estimates

    @property
    def signatures(self) -> Array:
        """
        Return the state of the signature of each valve; a copy is not made.

        :return: rows of `signature.state.State`.
        """
        return self._held.signatures

    def take(
        self, valve: NDArray[np.integer], stamp: Ints, signals: Mapping[str, Floats]
    ) -> Changes:
        """
        Take rows of samples; the rows of each valve in order of time.

        :param valve: number of the valve of each row, shape (n,).
        :param stamp: sampling instants [ns], shape (n,), int64.
        :param signals: columns by the names of `sample.SIGNALS`, shape (n,); those that are left
            out were not measured.
        :return: what became of the rows.
        :raises ValueError: where a column has another length or kind, a signal has an unknown
            name or a valve is not in the bank; no row was then taken.
        """
        return Changes(*self._held.take(*self._checked(valve, stamp, signals)))

    def _checked(
        self, valve: NDArray[np.integer], stamp: Ints, signals: Mapping[str, Floats]
    ) -> tuple[Ints, Ints, list[Floats]]:
        """Return columns that the compiled loop can take without a bounds check."""
        unknown = sorted(set(signals) - set(SIGNALS))
        if unknown:
            raise ValueError(f'no such signal: {", ".join(unknown)}; there are {SIGNALS}')
        valve, stamp = np.asarray(valve), np.asarray(stamp)
        if valve.ndim != 1 or valve.dtype.kind not in 'iu':
            raise ValueError(f'valve must be a column of whole numbers, not {_kind(valve)}')
        if stamp.shape != valve.shape or stamp.dtype != np.int64:
            raise ValueError(f'stamp must be a column of {len(valve)} int64, not {_kind(stamp)}')
        least = 0 if valve.dtype.kind == 'u' else valve.min(initial=0)
        if least < 0 or not valve.max(initial=0) < len(self):
            wrong = valve[(valve < 0) | (valve >= len(self))][0]
            raise ValueError(f'valve {wrong} is not in the bank of {len(self)}')
        columns = [
            np.asarray(signals[name]) if name in signals else np.full(len(valve), np.nan)
            for name in SIGNALS
        ]
        for name, column in zip(SIGNALS, columns, strict=True):
            if column.shape != valve.shape or column.dtype.kind not in 'fiu':
                raise ValueError(
                    f'{name} must be a column of {len(valve)} numbers, not {_kind(column)}'
                )
        return (
            np.ascontiguousarray(valve, np.int64),
            np.ascontiguousarray(stamp),
            [np.ascontiguousarray(column, np.float64) for column in columns],
        )

    def detector(self, valve: int) -> Detector:
        """
        Return the detector of a valve: decision, alarm, signature, requests of operators.

        :param valve: its number.
        :return: a detector that works on the state in the bank.
        :raises IndexError: where there is no such valve.
        """
        return self._held.detector(self._index(valve))

    def status(self, valve: int) -> str:
        """
        Say in one line what the monitor of a valve does.

        :param valve: its number.
        :return: for people; never "monitoring" while it does not monitor.
        """
        return self._held.estimator(self._index(valve)).status

    def failing(self, valve: int) -> Refused | None:
        """
        Return what is wrong with the input of a valve for some time.

        :param valve: its number.
        :return: the last refusal; None where all is well.
        """
        return self._held.estimator(self._index(valve)).failing

    def judgement(self, valve: int) -> Judgement | None:
        """
        Say what the fault of a valve is taken for, in a mode that judges it by itself.

        :param valve: its number.
        :return: the same object as before where nothing has changed; None before any alarm.
        """
        return self._held.judgement(self._index(valve))

    def counters(self, valve: int) -> dict[str, int]:
        """
        Return counts of a valve's samples by what became of them.

        :param valve: its number.
        :return: counts by name.
        """
        return self._held.estimator(self._index(valve)).counters

    def learned(self, valve: int) -> Saved:
        """
        Return what was learned of a valve, as its monitor does.

        :param valve: its number.
        :return: plain numbers and lists by name, fit for JSON.
        :raises ValueError: where learning is not finished.
        """
        return self._held.estimator(self._index(valve)).learned()

    def restore(self, valve: int, learned: Mapping[str, Plain]) -> None:
        """
        Take up what was learned of a valve.

        :param valve: its number.
        :param learned: what `learned` returned, of a bank or a single monitor.
        :raises ValueError: where it is not that; the state is then untouched.
        """
        with self._held.opened(self._index(valve)) as estimator:
            estimator.restore(learned)

    def relearn(self, valve: int, after_repair: bool = False) -> None:
        """
        Learn a valve anew; its alarm stays.

        :param valve: its number.
        :param after_repair: take the valve as it is now for fault-free.
        """
        with self._held.opened(self._index(valve)) as estimator:
            estimator.relearn(after_repair)

    def reset(self, valve: int) -> None:
        """
        Forget everything of a valve: what was learned, the counters, the alarms.

        :param valve: its number.
        """
        with self._held.opened(self._index(valve)) as estimator:
            estimator.reset()
        self.detector(valve).reset()

    def tobytes(self, valve: int) -> bytes:
        """
        Return the whole state of a valve, to be moved to another bank or process.

        :param valve: its number.
        :return: bytes that `restore_bytes` of a bank of the same mode and version takes.
        """
        return self._held.tobytes(self._index(valve))

    def restore_bytes(self, valve: int, state: bytes) -> None:
        """
        Go on with a state that another bank returned; nothing is learned anew, no alarm lost.

        :param valve: its number here.
        :param state: what `tobytes` returned.
        :raises ValueError: where it is not such a state, or of another mode or version; the
            present state is then untouched.
        """
        self._held.restore_bytes(self._index(valve), state)

    def _index(self, valve: int) -> int:
        if not 0 <= valve < len(self):
            raise IndexError(f'valve {valve} is not in the bank of {len(self)}')
        return valve


def _kind(column: NDArray[np.generic]) -> str:
    return f'{column.dtype} of shape {column.shape}'
