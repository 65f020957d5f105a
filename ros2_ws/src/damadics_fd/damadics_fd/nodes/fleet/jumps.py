# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Hold samples of a fleet whose stamps run far ahead of time until others agree with them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.record import Ints
from damadics_fd.core.stamps import SECOND
from damadics_fd.nodes.fleet.blocks import Rows
from damadics_fd.ros.freshness import JUMP, ForwardJumps


class Row(NamedTuple):
    """Hold one sample of one valve."""

    valve: int
    stamp: int  # ns
    signals: dict[str, float]  # those that are measured


class Jumps:
    """
    Guard each valve as `ros.freshness.ForwardJumps` does; costs little while all is well.

    :param count: number of valves.
    """

    def __init__(self, count: int) -> None:
        self.refused = 0  # samples that no other agreed with
        self._last = np.full(count, -1, np.int64)  # stamp that was let through last [ns]
        self._steady = np.zeros(count)  # when [s]
        self._held: dict[int, ForwardJumps[Row]] = {}  # by valve, while it holds samples

    def admit(self, rows: Rows, steady: float) -> Rows:
        """
        Take samples.

        :param rows: those of each valve in order of time.
        :param steady: time of a clock that is never set [s].
        :return: what may be judged now; mostly the same rows.
        """
        last = self._last[rows.valve]
        far = int(rows.stamp.max()) - int(last.min()) > JUMP * SECOND if len(last) else True
        if not far and not self._held:  # as nearly always
            self._note(rows.valve, rows.stamp, steady)
            return rows
        room = steady - self._steady[rows.valve] + JUMP
        ahead = (last >= 0) & (rows.stamp - last > room * SECOND)
        if not ahead.any() and not self._held:
            self._note(rows.valve, rows.stamp, steady)
            return rows
        guarded = np.isin(rows.valve, [*set(rows.valve[ahead].tolist()), *self._held])
        admitted = self._one_by_one(rows, np.flatnonzero(guarded), steady)
        free = ~guarded
        self._note(rows.valve[free], rows.stamp[free], steady)
        return _joined(rows, free, admitted)

    def _note(self, valve: Ints, stamp: Ints, steady: float) -> None:
        self._last[valve] = stamp
        self._steady[valve] = steady

    def _one_by_one(self, rows: Rows, which: Ints, steady: float) -> list[Row]:
        """Return the rows that are let through."""
        out = []
        for place in which.tolist():
            valve, stamp = int(rows.valve[place]), int(rows.stamp[place])
            guard = self._held.get(valve)
            if guard is None:
                guard = self._held[valve] = ForwardJumps()
                before = int(self._last[valve])
                if before >= 0:
                    guard.admit(before, Row(valve, before, {}), float(self._steady[valve]))
            refused = guard.refused
            signals = {name: float(column[place]) for name, column in rows.signals.items()}
            for row in guard.admit(stamp, Row(valve, stamp, signals), steady):
                out.append(row)
                self._last[valve], self._steady[valve] = row.stamp, steady
            self.refused += guard.refused - refused
        self._held = {valve: guard for valve, guard in self._held.items() if guard.holds}
        return out


def _joined(rows: Rows, free: NDArray[np.bool_], more: list[Row]) -> Rows:
    """Return some rows, then others."""
    missing = np.full(len(rows.valve), np.nan)
    names = dict.fromkeys([*rows.signals, *(name for row in more for name in row.signals)])
    return Rows(
        np.concatenate((rows.valve[free], np.array([row.valve for row in more], np.int64))),
        np.concatenate((rows.stamp[free], np.array([row.stamp for row in more], np.int64))),
        {
            name: np.concatenate(
                (
                    rows.signals.get(name, missing)[free],
                    np.array([row.signals.get(name, np.nan) for row in more], np.float64),
                )
            )
            for name in names
        },
    )
