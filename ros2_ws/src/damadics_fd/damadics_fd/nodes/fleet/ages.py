# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""How old the newest judgement of each valve of a fleet is, by its stamp."""

import numpy as np

from damadics_fd.core.record import Floats, Ints
from damadics_fd.core.stamps import DATE, SECOND
from damadics_fd.ros.freshness import BACK, default_max_age


class Ages:
    """
    Ages of the newest samples, as `core.freshness.Freshness` defines them, for many valves.

    :param periods: sample period of each valve [s].
    :param simulated: the clock is that of /clock.
    :param max_age: age from which a judgement is not healthy [s]; 0: by each valve's period.
    """

    def __init__(self, periods: Floats, simulated: bool, max_age: float = 0.0) -> None:
        own = np.array([default_max_age(float(period)) for period in periods])
        self.limits = own if max_age == 0.0 else np.full(len(own), max_age)
        self._simulated = simulated
        self._stamp = np.full(len(own), -1, np.int64)
        self._least = np.full(len(own), np.inf)

    def heard(self, valve: Ints, stamp: Ints, steady: float) -> None:
        """
        Note samples.

        :param valve: numbers, shape (n,).
        :param stamp: of the measurements [ns], shape (n,).
        :param steady: time of a clock that is never set [s].
        """
        again = stamp < self._stamp[valve] - int(BACK * SECOND)
        if again.any():  # another run: its stamps begin anew
            self._least[valve[again]] = np.inf
        self._stamp[valve] = stamp
        np.minimum.at(self._least, valve, steady - stamp / SECOND)

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
