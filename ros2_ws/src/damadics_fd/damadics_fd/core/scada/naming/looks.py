# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Look at a standing fault now and then, and say what it is taken for."""

import bisect
import math
from dataclasses import replace

from damadics_fd.core.judgement import Judgement
from damadics_fd.core.scada.judging.cusum import TEST_NAMES
from damadics_fd.core.scada.monitor import ScadaMonitor
from damadics_fd.core.scada.naming.names import Isolation
from damadics_fd.core.stamps import SECOND

AFTER_S = (10.0, 60.0, 600.0, 3600.0, 21600.0)  # after an alarm


class Looks:
    """The judgement of the latest fault, made anew at set times after its alarm."""

    def __init__(self) -> None:
        self._key = (0, 0)
        self._latest: Judgement | None = None
        self._isolation: Isolation | None = None  # that it rests on

    def judge(self, monitor: ScadaMonitor) -> Judgement | None:
        """
        Return what is known by now; the same object as before where nothing has changed.

        :param monitor: of the valve.
        :return: test and onset at once, the cause from ten seconds on; None before any alarm.
        """
        state = monitor.state
        if monitor.reference is None or not state.occurrence:
            return None
        due = bisect.bisect_right(AFTER_S, float(state.t - state.t_raised))
        key = int(state.occurrence), due
        if self._latest is None or key != self._key:
            if key[0] != self._key[0]:
                self._latest = self._isolation = None
            self._key = key
            self._latest = self._look(monitor, visible=due > 0)
        return self._latest

    def _look(self, monitor: ScadaMonitor, visible: bool) -> Judgement:
        before, known = self._latest, self._isolation
        isolation = monitor.isolate() if visible else None
        if isolation is None or (known is not None and isolation.worse_than(known)):
            return before or _found(monitor)
        self._isolation = isolation
        names = tuple(f'f{fault}' for fault in isolation.candidates) if isolation.visible else ()
        if before is not None and before.text and names == before.candidates:
            return before
        return replace(
            _found(monitor),
            candidates=names,
            confidence=tuple(isolation.confidence.values()) if names else (),
            strength=isolation.best.strength if names else math.nan,
            text=isolation.text(),
        )


def _found(monitor: ScadaMonitor) -> Judgement:
    """Return what is known at once: the test and the onset."""
    state = monitor.state
    return Judgement(
        round(float(state.t) * SECOND),
        int(state.occurrence),
        TEST_NAMES[int(state.test)],
        round(float(state.t_onset) * SECOND),
        'control-room test',
    )
