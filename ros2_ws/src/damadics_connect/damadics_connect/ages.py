# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""How old judgements are, by the stamps that they rest on: an old one is not health."""

from damadics_fd.core.stamps import SECOND
from damadics_fd.ros.freshness import Freshness, default_max_age

REPEATED = 1.0  # s after which a detector repeats its flag
UNKNOWN = 20.0  # s; period of samples of which only one has been heard of


class Ages:
    """
    The ages of judgements, by valve.

    How often a valve is measured is not known here: the steps of the stamps tell, once there are
    two. Repeats carry the stamp of before.
    """

    def __init__(self) -> None:
        self._fresh: dict[str, Freshness] = {}
        self._stamps: dict[str, int] = {}
        self._steps: dict[str, float] = {}  # largest of late [s]

    def heard(self, valve: str, stamp: int | None, steady: float) -> None:
        """
        Note a judgement.

        :param valve: its name.
        :param stamp: of the measurement that it rests on [ns]; None where it rests on none.
        :param steady: time of a clock that is never set [s].
        """
        before = self._stamps.get(valve)
        if stamp is None or stamp == before:
            return
        if before is not None and stamp > before:
            step = (stamp - before) / SECOND
            self._steps[valve] = max(step, 0.8 * self._steps.get(valve, step))
        self._stamps[valve] = stamp
        self._fresh.setdefault(valve, Freshness()).heard(stamp, steady)

    def old(self, valve: str, clock: int, steady: float) -> bool:
        """
        Tell whether the latest judgement of a valve says nothing about now.

        :param valve: its name.
        :param clock: ROS time now [ns].
        :param steady: as for `heard`, now [s].
        :return: True if so; False where none has been heard.
        """
        fresh = self._fresh.get(valve)
        if fresh is None:
            return False
        limit = default_max_age(self._steps.get(valve, UNKNOWN)) + REPEATED
        return fresh.age(clock, steady) > limit
