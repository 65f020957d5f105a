# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""How old the newest judgement of each valve of a fleet is, by its stamp."""

import numpy as np

from damadics_fd.core.record import Floats, Ints
from damadics_fd.core.stamps import DATE, SECOND
from damadics_fd.ros.freshness import (
    BACK,
    EVEN,
    IN_WINDOW,
    INTERRUPTED,
    MISSED,
    WINDOW,
    default_max_age,
)


class Ages:
    """
    Ages of the newest samples, as `ros.freshness.Freshness` defines them, for many valves.

    :param periods: sample period of each valve [s].
    :param simulated: the clock is that of /clock.
    :param max_age: age from which a judgement is not healthy [s]; 0: by each valve's period.
    """

    def __init__(self, periods: Floats, simulated: bool, max_age: float = 0.0) -> None:
        own = np.array([default_max_age(float(period)) for period in periods])
        self.limits = own if max_age == 0.0 else np.full(len(own), max_age)
        self._simulated = simulated
        count = len(own)
        self._stamp = np.full(count, -1, np.int64)
        self._steady = np.zeros(count)  # when it was heard [s]
        self._least = np.full(count, np.inf)  # of steady time less stamp [s]
        self._delay = np.zeros(count)  # of the newest sample: steady time less stamp [s]
        self._usual = np.full(count, np.inf)  # time between two blocks [s]
        self._pause = np.zeros(count)  # what the last interruption may have been [s]
        self._window = np.zeros(count)  # when the present window began [s]
        self._lowest = np.full(count, np.inf)  # delay in it [s]
        self._before = np.full(count, np.inf)  # delay in the one before [s]
        self._dated = False  # the stamps of all valves are dates
        self._even = False  # no valve is paused, and of each the time between blocks is known

    def heard(self, valve: Ints, stamp: Ints, steady: float) -> None:
        """
        Note samples.

        :param valve: numbers, shape (n,).
        :param stamp: of the measurements [ns], shape (n,); those of a valve in order.
        :param steady: time of a clock that is never set [s].
        """
        dated = len(stamp) > 0 and bool(stamp.min() >= DATE)
        if dated and (self._dated or bool(self._stamp[valve].min() >= DATE)):
            self._stamp[valve] = stamp  # the last of each valve; the clock alone tells its age
            return
        newest = np.full(len(self._stamp), -1, np.int64)
        newest[valve] = stamp  # the last of each valve
        v = np.flatnonzero(newest >= 0)
        now = newest[v]
        before, delay, gap = self._stamp[v], steady - now / SECOND, steady - self._steady[v]
        first = (before < 0) | (now < before - BACK)
        first |= (before >= DATE) != (now >= DATE)  # another run: its stamps begin anew
        usual = self._usual[v]
        if self._even and not (first | (gap > np.maximum(INTERRUPTED, MISSED * usual))).any():
            self._usual[v] = usual + 0.2 * (gap - usual)
            self._least[v] = np.minimum(self._least[v], delay)
            self._note(v, now, delay, steady)
            return
        known = np.isfinite(usual)
        usually = np.where(known, usual, 0.0)
        paused = ~first & (gap > np.maximum(INTERRUPTED, MISSED * usually))
        pause = np.where(first, 0.0, self._pause[v])
        self._pause[v] = pause + np.where(paused, np.maximum(delay - self._delay[v], 0.0), 0.0)
        self._begin_window(v[paused], steady, np.full(int(paused.sum()), np.inf))
        usual = np.where(~first & ~paused & known, usual + 0.2 * (gap - usually), usual)
        self._usual[v] = np.where(~first & ~known, gap, usual)
        self._least[v] = np.minimum(np.where(first, delay, self._least[v]), delay)
        self._note(v, now, delay, steady)
        self._forgive(v[self._pause[v] > 0.0], steady)
        self._even = bool(np.isfinite(self._usual).all()) and not self._pause.any()

    def _note(self, v: Ints, stamp: Ints, delay: Floats, steady: float) -> None:
        self._stamp[v], self._delay[v], self._steady[v] = stamp, delay, steady
        self._dated = bool(self._stamp.min() >= DATE)

    def _forgive(self, v: Ints, steady: float) -> None:
        """Count a pause as none where samples run on with an even delay, which no queue has."""
        if not len(v):
            return
        self._lowest[v] = np.minimum(self._lowest[v], self._delay[v])
        usual = np.where(np.isfinite(self._usual[v]), self._usual[v], 0.0)
        over = v[steady - self._window[v] > np.maximum(WINDOW, IN_WINDOW * usual)]
        with np.errstate(invalid='ignore'):
            even = over[np.abs(self._lowest[over] - self._before[over]) < EVEN]
        self._least[even] += np.minimum(self._pause[even], self._lowest[even] - self._least[even])
        self._pause[even] = 0.0
        self._begin_window(over, steady, self._lowest[over].copy())

    def _begin_window(self, v: Ints, steady: float, before: Floats) -> None:
        self._window[v], self._before[v], self._lowest[v] = steady, before, np.inf

    def ages(self, clock: int, steady: float) -> Floats:
        """
        Return the age of each valve's newest sample.

        :param clock: ROS time now [ns].
        :param steady: as for `heard`, now [s].
        :return: ages [s], NaN before the first; negative where the stamp is in the future.
        """
        by_clock = (clock - self._stamp) / SECOND
        if self._simulated:
            age = by_clock
        else:
            dates = self._stamp >= DATE
            with np.errstate(invalid='ignore'):
                age = np.where(dates, by_clock, steady - self._stamp / SECOND - self._least)
        return np.where(self._stamp < 0, np.nan, age)
