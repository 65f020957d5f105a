# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Join the signals of one valve, which a source sends one by one, to samples on the valve's clock.

A source sends what changes. Signals that change within one period are one sample, stamped with the
newest source time in it. While the source is known to be alive, no change is not silence: the last
value holds, and a sample of held values follows each period. No clock is read here: every call
says what time it is on a clock that nobody sets.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from damadics_fd.core.sample import SIGNALS

from damadics_connect.source_clock import DAY, MOST_LATE, NANO, SourceClock

STEP = NANO  # ns; stamps further back than this may be a clock set back, others are only late
LONGEST_FILL = 3 * NANO  # ns, or three periods: a longer pause is a gap, not a hold
STILL = 2 * NANO  # ns after which a change with an unchanged time has a time of ours
WAIT = 2 * NANO  # ns for the first values of all signals
FIRST_HOLD = 3 * NANO // 10  # ns without a change before the first held sample: a source that
# has been changing and pauses for less is more likely held up than at rest
NAN = math.nan
TELLING = 0b11  # CV and X tell how late a source is: t1 or ps may come by a slow way of their own
Emit = Callable[[int, list[float]], None]


@dataclass
class Tally:
    """What was done with the values of one valve."""

    samples: int = 0
    held: int = 0  # samples without a change
    late: int = 0  # values older than what had been taken in
    overtaken: int = 0  # changes that came when a held sample of their time had been sent
    repeated: int = 0  # values sent twice
    future: int = 0  # stamps more than a day ahead
    still: int = 0  # values that have changed with the time of long before
    steps: int = 0  # of the source's clock
    gaps: int = 0
    last_gap: tuple[int, int] = (0, 0)  # stamps around it [ns]
    bad: dict[str, str] = field(default_factory=dict)  # why, by signal
    uncertain: dict[str, int] = field(default_factory=dict)  # how often, by signal


class Joiner:
    """
    The joined signals of one valve.

    :param period: of the valve's clock [ns].
    :param settle: how much later than the first change of a sample its others may arrive [ns].
    :param signals: numbers in `SIGNALS` of those that the source has.
    :param emit: takes stamp [ns] and the values of all of `SIGNALS`; the list is its own.
    """

    def __init__(self, period: int, settle: int, signals: tuple[int, ...], emit: Emit) -> None:
        self.tally = Tally()
        self.newest = 0  # source time of the newest value taken in [ns]
        self._period = period
        self._settle = settle
        self._first_hold = max(settle, FIRST_HOLD)
        self._holding = False  # the last sample was a held one
        self._clock = SourceClock()
        self._step = max(STEP, 3 * period)
        self._emit = emit
        self._expected = sum(1 << slot for slot in signals)
        self._values = [NAN] * len(SIGNALS)
        self._times = [0] * len(SIGNALS)
        self._since = [0] * len(SIGNALS)  # when each of them came
        self._back = [0] * len(SIGNALS)
        self._known = 0  # signals that have a value since the session began
        self._group: list[tuple[int, float]] = []
        self._mask = 0
        self._news = False  # the group has changes, not only first values of the session
        self._start = self._end = self._opened = 0
        self._last = 0  # stamp of the last sample
        self._sent_at = 0
        self._alive_since = 0
        self._resumed = False
        self._first = True  # no sample since the session began
        self._set_back_there = False  # the server's clock was
        self._behind = 0  # stamp of a change far behind the last sample

    @property
    def last(self) -> int:
        """Stamp of the last sample [ns], 0 before the first."""
        return self._last

    @property
    def period(self) -> float:
        """Of the valve's clock [s]."""
        return self._period / NANO

    @property
    def waiting_for(self) -> tuple[str, ...]:
        """Signals that have sent nothing since the session began."""
        missing = self._expected & ~self._known
        return tuple(name for slot, name in enumerate(SIGNALS) if missing >> slot & 1)

    def begin(self, now: int) -> None:
        """
        Begin a session: wait for the present values of all signals.

        :param now: [ns].
        """
        self._known = self._mask = 0
        self._news = False
        self._group.clear()
        self._alive_since = now
        self._resumed = self._last > 0
        self._first = True
        self._set_back_there = False
        self._clock.begin(now)

    def source_clock(self, source_now: int, now: int) -> None:
        """
        Take the server's clock, which is the source's as long as no change has told the time.

        :param source_now: [ns].
        :param now: [ns].
        """
        self._clock.guess(source_now, now)

    def server_set_back(self) -> None:
        """Expect the source's clock to be set back, as that of its server was."""
        self._set_back_there = True

    def lateness(self, now: int) -> int:
        """Return how late changes have come of late [ns]."""
        return self._clock.latest(now)

    def without(self, slot: int) -> None:
        """Go on without a signal that the source does not have."""
        self._expected &= ~(1 << slot)
        self._values[slot] = NAN

    def take(self, slot: int, stamp: int, value: float, now: int) -> None:
        """
        Take in one value; those of one batch in the order of their stamps.

        :param slot: number in `SIGNALS`.
        :param stamp: source time [ns].
        :param value: scaled; NaN for a bad one.
        :param now: [ns].
        """
        before = self._times[slot]
        bit = 1 << slot
        told = stamp
        if stamp <= before:
            if stamp == before:
                held = self._values[slot]
                if value == held or (value != value and held != held):
                    self.tally.repeated += bool(self._known & bit)
                    self._known |= bit
                    return
                if now - self._since[slot] > STILL:
                    told = self._clock.server_at(now)
                    self.tally.still += value == value  # a bad one may keep the time of a good one
            elif not self._set_back(slot, stamp, before, now):
                return
        else:
            self._since[slot] = now
        self._times[slot] = stamp
        stamp = told
        if self._clock.known and stamp - self._clock.at(now) > DAY:
            self.tally.future += 1
            stamp = self._times[slot] = self._clock.at(now)
        if self._group and (
            stamp - self._start >= self._period
            or (self._mask & bit and 2 * (stamp - self._start) >= self._period)
        ):
            self._close(now)
        if not self._group:
            self._start = self._end = stamp
            self._opened = now
        self._group.append((slot, value))
        self._mask |= bit
        self._news |= bool(self._known & bit)
        self._known |= bit
        if stamp > self._end:
            self._end = stamp
        if self._mask == self._expected:
            self._close(now)

    def look(self, now: int, known: int | None = None) -> None:
        """
        Emit what is due; call it often, and only while the source is alive.

        :param now: [ns].
        :param known: up to when all changes have come [ns]; None: up to now.
        """
        known = now if known is None else known
        if self._group and known - self._opened >= self._settle:
            self._close(now)
        if self._group or not self._complete(now) or not self._clock.known:
            return
        due = self._due(known)
        if not self._last or due - self._last > max(LONGEST_FILL, 3 * self._period):
            newest = max(self._times)
            if newest > due:
                due = newest
            if due > self._last:
                self._tell_gap(due)
                self._send(due, known, held=due != newest)
            return
        while self._last <= due:
            self._send(self._last + self._period, known, held=True)
            due = self._due(known)

    def _due(self, known: int) -> int:
        """Return the stamp after which a held sample is due."""
        wait = self._settle if self._holding or not self._last else self._first_hold
        late = min(self._clock.latest(known), MOST_LATE)
        if late > wait:
            wait = late + self._settle  # the next may come later still
        return self._clock.at(known) - self._period - wait

    def _close(self, now: int) -> None:
        """End the present sample: fill the time before it, apply it, send it."""
        start, end = self._start, self._end
        telling = self._mask & TELLING != 0 or not self._expected & TELLING
        late = self._clock.hear(end, now, telling=telling)
        complete = self._complete(now)
        if complete and self._last and not self._resumed:
            self._fill(start, now)
        for slot, value in self._group:
            self._values[slot] = value
        news, self._news = self._news, False
        self._group.clear()
        self._mask = 0
        if self._first and late > self._period + self._settle:
            if not news:
                return  # of long ago, as every session begins with: it is held from now on
            if self._clock.guessed:
                self._clock.set(end, now)
                late = 0
        if telling:
            self._clock.late(late, now)
        if end <= self._last:
            self._take_overtaken(end, now, complete, telling)
        elif complete:
            if self._last:
                self._tell_gap(end)
            self._set_back_there, self._behind = False, 0
            self._send(end, now, held=False)

    def _take_overtaken(self, end: int, now: int, complete: bool, telling: bool) -> None:
        """Tell a clock that was set back from changes that have come too late."""
        back = self._last - end
        if back < self._step:
            self._clock.set(end, now)  # set back a little, or late: which does not matter
        elif complete and (self._clock.guessed or self._set_back_there):
            self._go_back(end, now)
            self._send(end, now, held=False)
            return
        elif telling and back > MOST_LATE:
            if complete and 0 < self._behind <= end:
                self._go_back(end, now)
                self._send(end, now, held=False)
                return
            self._behind = end
        self.tally.overtaken += 1

    def _go_back(self, stamp: int, now: int) -> None:
        """Go on at a stamp of a clock that was set back."""
        self.tally.steps += 1
        self._set_back_there, self._behind = False, 0
        self._clock.set(stamp, now)
        self._times = [min(each, stamp) for each in self._times]
        self._back = [0] * len(SIGNALS)

    def _complete(self, now: int) -> bool:
        return not self._expected & ~self._known or now - self._alive_since > WAIT

    def _fill(self, start: int, now: int) -> None:
        """Send held values for the periods since the last sample in which nothing changed."""
        pause = start - self._last
        if 2 * pause <= 3 * self._period:
            return
        if pause > max(LONGEST_FILL, 3 * self._period):
            return
        if pause > now - self._sent_at + self._settle + self._period:
            return  # the source's clock was set forward: no such time has passed
        for _ in range(round(pause / self._period) - 1):
            self._send(self._last + self._period, now, held=True)

    def _tell_gap(self, stamp: int) -> None:
        if stamp - self._last > max(LONGEST_FILL, 3 * self._period) and self._last:
            self.tally.gaps += 1
            self.tally.last_gap = (self._last, stamp)
        self._resumed = False

    def _set_back(self, slot: int, stamp: int, before: int, now: int) -> bool:
        """Tell a clock that was set back from a value that is late: it goes on from there."""
        back = self._back[slot]
        expected = self._set_back_there and before - stamp >= self._step
        if not expected and (not back or stamp <= back):
            self._back[slot] = stamp if before - stamp >= self._step else 0
            self._known |= 1 << slot
            self.tally.late += 1
            return False
        if self._group:
            self._close(now)
        self._go_back(stamp, now)
        self._times = [min(each, stamp - 1) for each in self._times]
        self._last = 0
        return True

    def _send(self, stamp: int, now: int, held: bool) -> None:
        self._last = stamp
        self._first = False
        self._clock.guessed &= held
        self._holding = held
        self._sent_at = now
        self.tally.samples += 1
        self.tally.held += held
        self._emit(stamp, self._values.copy())
