# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The clock that stamps the values of one valve, and how late what it stamps comes."""

from damadics_connect.lately import Lately

NANO = 1_000_000_000
DRIFT = 200e-6  # of the source's clock against ours
DAY = 86_400 * NANO
LATE = 30 * NANO  # ns for which it is remembered how late changes have come
MOST_LATE = 60 * NANO  # ns that held samples wait for late changes
LASTING, LEAST = 60 * NANO, 20  # ns and changes after which all that come late are a lag


class SourceClock:
    """
    How far a source's clock is ahead of ours: by the changes that were on their way least.

    A source that falls behind sends changes later and later, and its server says nothing of it:
    what has not been written there yet is not missing for it. How late the changes of late have
    come tells how long to wait before a value is taken for one that has not changed. A lag that
    lasts is part of the clock.
    """

    def __init__(self) -> None:
        self.guessed = False  # no change since the session began has told the source's time
        self._late = Lately(LATE)
        self._ahead: int | None = None
        self._server: int | None = None
        self._at = 0
        self._since = self._changes = 0
        self._lately: int | None = None  # the most in the present window

    @property
    def known(self) -> bool:
        """Whether anything has told the source's time since the session began."""
        return self._ahead is not None

    def begin(self, now: int) -> None:
        """
        Begin a session.

        :param now: time of a clock that nobody sets [ns].
        """
        self._ahead = self._server = None
        self._at = now
        self._late = Lately(LATE)
        self._open_window(now)

    def guess(self, source_now: int, now: int) -> None:
        """
        Take a clock that may be the source's, as long as no change has told the time.

        :param source_now: [ns].
        :param now: as for `begin` [ns].
        """
        self._server = source_now - now
        if self._ahead is None:
            self.set(source_now, now)
            self.guessed = True

    def set(self, stamp: int, now: int) -> None:
        """Go on from a stamp that has come just now, both in [ns]."""
        self._ahead = stamp - now
        self._at = now
        self._open_window(now)

    def at(self, now: int) -> int:
        """Return the source's time [ns]; our own where nothing has told it."""
        return now + (self._ahead or 0)

    def server_at(self, now: int) -> int:
        """Return the time of the server that passes the source's values on [ns]."""
        return self.at(now) if self._server is None else now + self._server

    def hear(self, stamp: int, now: int, *, telling: bool) -> int:
        """
        Take a change.

        :param stamp: its source time [ns].
        :param now: when it came [ns].
        :param telling: whether it tells how late the source is.
        :return: how late it has come [ns].
        """
        ahead = stamp - now
        if self._ahead is None:
            self.set(stamp, now)
            return 0
        drifted = self._ahead - int((now - self._at) * DRIFT)
        self._ahead = max(ahead, drifted)
        self._at = now
        if telling:
            self._changes += 1
            self._lately = ahead if self._lately is None else max(self._lately, ahead)
            if now - self._since > LASTING and self._changes >= LEAST:
                self._ahead = self._lately
                self._open_window(now)
        return now + self._ahead - stamp

    def late(self, by: int, now: int) -> None:
        """Remember how late a change has come, both in [ns]."""
        self._late.take(by, now)

    def latest(self, now: int) -> int:
        """Return how late changes have come of late [ns]."""
        return self._late.largest(now)

    def _open_window(self, now: int) -> None:
        self._since, self._changes, self._lately = now, 0, None
