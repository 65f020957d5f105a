# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""How far the word of a subscription reaches: what has changed before has been sent."""

from damadics_connect.lately import Lately

NANO = 1_000_000_000
WINDOW = 30 * NANO  # ns; the least delay of two of them counts
STALLED = 10 * NANO  # ns for which a stall of the server is remembered
LONGEST = 5 * NANO // 2  # ns that it is given to catch up, at most
JITTER = NANO // 20  # ns by which a message of any server may be late


class Horizon:
    """
    A clock that stands still while server, network or this process are held up.

    That nothing has changed is known up to the instant at which the newest message was put
    together, not up to now: what was written since may still be on its way. The server states
    that instant; on our own clock it is now, less what the message was delayed by beyond the
    least delay of late. A server that was held up has to catch up: what its devices changed
    meanwhile may be written after its next message. For as long as it was held up it gets time
    for that.
    """

    def __init__(self) -> None:
        self._at = 0
        self._stalls = Lately(STALLED)
        self._offset: int | None = None  # server's clock less ours, at the least delay
        self._lately: int | None = None  # the same in the present window
        self._window = self._published = 0
        self.steps_back = 0  # of the server's clock

    @property
    def known(self) -> int:
        """Up to when all that has changed has come, on our own clock [ns]."""
        return self._at - min(self._stalls.largest(self._at), LONGEST)

    def begin(self, now: int) -> None:
        """
        Begin a session.

        :param now: time of a clock that nobody sets [ns].
        """
        self._stalls = Lately(STALLED)
        self._at, self._window, self._published = now, now, 0
        self._offset = self._lately = None

    def heard(self, published: int, now: int, pace: int = 0) -> int:
        """
        Take a message of the subscription.

        :param published: when the server put it together [ns]; 0 where it does not say so.
        :param now: when it came, as for `begin` [ns].
        :param pace: longest time between two messages, as agreed [ns]; 0: not known.
        :return: when it was put together, on the clock of `now`; never back.
        """
        if not published:
            self._at = max(self._at, now)
            return self._at
        offset = published - now
        if published < self._published:  # the server's clock was set back
            self.steps_back += published < self._published - JITTER
            self._offset = self._lately = None
        pause = published - self._published
        self._published = published
        if now - self._window > WINDOW:
            self._offset, self._lately, self._window = self._lately, None, now
        self._lately = offset if self._lately is None else max(self._lately, offset)
        self._offset = self._lately if self._offset is None else max(self._offset, offset)
        before, self._at = self._at, max(self._at, published - self._offset)
        if pace and pause > pace + JITTER:  # as long as on our clock: theirs may have been set
            self._stalls.take(min(pause, self._at - before), self._at)
        return self._at
