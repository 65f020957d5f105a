# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""How old a judgement is, by the stamp that it rests on, and stamps that jump ahead."""

import math
from typing import Generic, TypeVar

from damadics_msgs.msg import FaultFlag

from damadics_fd.core.stamps import DATE, SECOND, is_date

LEAST_MAX_AGE = 2.0  # s
PERIODS = 3.0  # sample periods; slower samples are that old by nature
BACK = SECOND  # ns that stamps may be out of order without being another run
INTERRUPTED = 0.3  # s without a sample, after which a source of simulated stamps may have paused
MISSED = 2.5  # of the usual time between two samples, where these are slower
WINDOW = 2.0  # s; two of them with the same delay after it say that it has
IN_WINDOW = 3.0  # samples at least
EVEN = 0.1  # s
JUMP = 60.0  # s that a stamp may run ahead of the time that has passed
NOT_MONITORING = FaultFlag.STATE_NOT_MONITORING
AGREEING = 3  # samples in a row that make a jump ahead credible

Item = TypeVar('Item')


def default_max_age(period: float) -> float:
    """
    Return the age from which a judgement is not healthy any more.

    :param period: of the samples [s].
    :return: the age [s].
    """
    return max(LEAST_MAX_AGE, PERIODS * period)


def judged_stamp(flag: FaultFlag) -> int | None:
    """
    Return the stamp that the age of a judgement may be counted from.

    Before the first sample a detector's flags are stamped 0, or as the alarm of before a restart.

    :param flag: the message.
    :return: [ns]; None where the flag rests on no sample, or nobody knows when it was taken.
    """
    return counted_stamp(flag.state, flag.header.stamp.sec * SECOND + flag.header.stamp.nanosec)


def counted_stamp(state: int, stamp: int) -> int | None:
    """
    Return the stamp that the age of a judgement may be counted from, as `judged_stamp`.

    :param state: of the flag.
    :param stamp: of the flag [ns].
    :return: [ns] or None.
    """
    judges = state != NOT_MONITORING
    return stamp if is_date(stamp) or (judges and stamp > 0) else None


class Freshness:
    """
    The age of what was heard last: clock less stamp where the stamp is a date.

    With simulated time the clock is that of /clock, for all stamps. Other stamps count from the
    start of a run: for them the age is what clock less stamp exceeds its smallest value since the
    source was first heard by, so that a queue that grows shows. Where samples stop for a while and
    then run on with an even delay, which no queue has, the source was paused: the pause is no age.

    :param simulated: the clock is that of /clock.
    """

    def __init__(self, simulated: bool = False) -> None:
        self._simulated = simulated
        self._stamp: int | None = None
        self._steady = 0.0  # when it was heard [s]
        self._least = math.inf  # of steady time less stamp [s]
        self._usual = math.inf  # time between two samples [s]
        self._delay = 0.0  # of the newest sample: steady time less stamp [s]
        self._pause = 0.0  # what the last interruption may have been [s]
        self._window = 0.0  # when the present window began [s]
        self._lowest = math.inf  # delay in it [s]
        self._before = math.inf  # delay in the one before [s]
        self.waiting: list[tuple[int, float]] = []  # what is noted when somebody asks for the age

    def heard(self, stamp: int, steady: float) -> None:
        """
        Note a sample.

        :param stamp: of its measurement [ns].
        :param steady: time of a clock that is never set [s].
        """
        if self.waiting:
            self._settle()
        self._note(stamp, steady)

    def _settle(self) -> None:
        """Note what waits: many samples at once cost a third of one at a time."""
        waiting, self.waiting[:] = self.waiting.copy(), []
        for stamp, steady in waiting:
            self._note(stamp, steady)

    def _note(self, stamp: int, steady: float) -> None:
        before, self._stamp = self._stamp, stamp
        if before is not None and before >= DATE <= stamp:
            return  # the clock alone tells the age of a date
        delay = steady - stamp / SECOND
        if before is None or stamp < before - BACK or (abs(before) < DATE) != (abs(stamp) < DATE):
            self._least = delay
            self._pause = 0.0
        else:
            gap, known = steady - self._steady, self._usual < math.inf
            if gap > INTERRUPTED and not (known and gap <= MISSED * self._usual):
                self._pause += max(delay - self._delay, 0.0)
                self._begin_window(steady, math.inf)
            elif known:
                self._usual += 0.2 * (gap - self._usual)
            if not known:
                self._usual = gap
        if delay < self._least:
            self._least = delay
        self._delay, self._steady = delay, steady
        if self._pause > 0.0:
            self._lowest = min(self._lowest, delay)
            if steady - self._window > max(WINDOW, IN_WINDOW * self._usual):
                if abs(self._lowest - self._before) < EVEN:
                    self._least += min(self._pause, self._lowest - self._least)
                    self._pause = 0.0
                self._begin_window(steady, self._lowest)

    def _begin_window(self, steady: float, before: float) -> None:
        self._window, self._before, self._lowest = steady, before, math.inf

    def age(self, clock: int, steady: float) -> float:
        """
        Return the age of the newest sample.

        :param clock: ROS time now [ns].
        :param steady: as for `heard`, now [s].
        :return: age [s], infinite before the first; negative where the stamp is in the future.
        """
        if self.waiting:
            self._settle()
        if self._stamp is None:
            return math.inf
        if self._simulated or is_date(self._stamp):
            return (clock - self._stamp) / SECOND
        return steady - self._stamp / SECOND - self._least


class ForwardJumps(Generic[Item]):
    """
    Hold a sample whose stamp runs far ahead of time until others agree with it.

    One wrong stamp would otherwise end a shelf and start the filters afresh.
    """

    def __init__(self) -> None:
        self.refused = 0  # samples that no other agreed with
        self._last: int | None = None  # stamp of the latest sample that was let through [ns]
        self._steady = 0.0  # when [s]
        self._held: list[tuple[int, Item]] = []

    @property
    def holds(self) -> int:
        """Number of samples that wait for others to agree."""
        return len(self._held)

    def passes(self, stamp: int, steady: float) -> bool:
        """
        Take the stamp of a sample that nothing is odd about, as nearly always.

        :param stamp: of its measurement [ns].
        :param steady: time of a clock that is never set [s].
        :return: False where `admit` has to take the sample.
        """
        last = self._last
        if last is None or self._held or stamp - last > (steady - self._steady + JUMP) * SECOND:
            return False
        self._last, self._steady = stamp, steady
        return True

    def admit(self, stamp: int, item: Item, steady: float) -> list[Item]:
        """
        Take a sample.

        :param stamp: of its measurement [ns].
        :param item: the sample.
        :param steady: time of a clock that is never set [s].
        :return: what may be judged now, in order; mostly the sample itself.
        """
        last = self._last
        if last is None or stamp - last <= (steady - self._steady + JUMP) * SECOND:
            if self._held:
                self.refused += len(self._held)
                self._held.clear()
            self._last, self._steady = stamp, steady
            return [item]
        if self._held and not 0 < stamp - self._held[-1][0] <= JUMP * SECOND:
            self.refused += len(self._held)
            self._held.clear()
        self._held.append((stamp, item))
        if len(self._held) < AGREEING:
            return []
        released = [one for _, one in self._held]
        self._held.clear()
        self._last, self._steady = stamp, steady
        return released
