# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The valves with one period: what is subscribed to together."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

from damadics_fd.core.sample import SIGNALS

from damadics_connect.joining import Joiner
from damadics_connect.opcua.horizon import Horizon
from damadics_connect.opcua.values import status_of
from damadics_connect.opcua.wire import Changes
from damadics_connect.publishing import Output
from damadics_connect.source_clock import NANO
from damadics_connect.valve_list import ValveSource

SHORTEST_INTERVAL, LONGEST_INTERVAL = 0.02, 0.5  # s between two messages of the server
SOONEST_WORD, LATEST_WORD = 0.1, 0.5  # s after which a server that has nothing new says so
HELD_UP = 5.0  # s for which the server keeps values while it, the network or we are held up
QUALITY = 0xC0000000  # the two bits of a status code that say good, uncertain or bad
UNCERTAIN = 0x40000000
OVERFLOW = 0x480  # of a data value: the server's queue was too short


class Options(NamedTuple):
    """How the server is asked."""

    interval: float = 0.0  # s between two messages of the server; 0: half the valve's period
    queue: int = 0  # values kept for one message; 0: those of 5 s more
    poll: bool = False  # read instead of subscribing


class Item(NamedTuple):
    """One signal of one valve, as a monitored item of the server."""

    valve: str
    slot: int
    scale: Callable[[float], float]
    joiner: Joiner


class Feed:
    """
    The valves with one period: one subscription.

    :param period: [s].
    :param valves: with the numbers that the output knows them by.
    :param options: how the server is asked.
    :param output: takes the samples.
    """

    def __init__(
        self, period: float, valves: dict[int, ValveSource], options: Options, output: Output
    ) -> None:
        self.period = period
        half = min(max(period / 2.0, SHORTEST_INTERVAL), LONGEST_INTERVAL)
        self.interval = options.interval or half
        self.word = max(min(max(period, SOONEST_WORD), LATEST_WORD), self.interval)
        self.patience = self.word  # s until the server says something, as it has agreed to
        self.tick = min(max(self.interval / 2.0, 0.01), 0.1)  # s between two looks
        self.queue = options.queue or round((self.interval + HELD_UP) / period) + 2
        self.heard = 0.0  # monotonic time of the last word [s]
        self.at = 0  # the same as `hear` returned it [ns]
        self.lost = 0  # values that the server's queue had no room for
        self.items: list[Item] = []
        self.nodes: list[str] = []
        self.joiners: dict[str, Joiner] = {}
        self._horizon = Horizon()
        settle = int((1.5 * self.interval + 0.05) * NANO)
        for number, valve in valves.items():
            joiner = Joiner(
                int(period * NANO),
                settle,
                tuple(signal.slot for signal in valve.signals),
                partial(output.send, number),
            )
            self.joiners[valve.name] = joiner
            for signal in valve.signals:
                self.items.append(Item(valve.name, signal.slot, signal.scale, joiner))
                self.nodes.append(signal.source)

    @property
    def prompt(self) -> bool:
        """Whether the server speaks so often that held values can wait for its word."""
        return self.patience <= 1.5 * self.word

    def begin(self, now: int, patience: float = 0.0) -> None:
        """
        Begin a session.

        :param now: monotonic time [ns].
        :param patience: time after which the server always says something [s]; 0: as asked for.
        """
        self.heard = now / NANO
        self.patience = patience or self.word
        self._horizon.begin(now)
        for joiner in self.joiners.values():
            joiner.begin(now)

    def hear(self, published: int, now: int) -> int:
        """
        Note a word of the server.

        :param published: when it was put together, by the server's clock [ns]; 0: not known.
        :param now: monotonic time [ns].
        :return: the time for `take` and `look` [ns].
        """
        self.heard = now / NANO
        pace = int(self.patience * NANO)
        before = self._horizon.steps_back
        self.at = self._horizon.heard(published if self.prompt else 0, now, pace)
        if self._horizon.steps_back > before:
            for joiner in self.joiners.values():
                joiner.server_set_back()
        return self.at

    def take(self, changes: Changes, wall: int, at: int) -> None:
        """
        Take values that have changed.

        :param changes: in any order of their stamps.
        :param wall: time of the server [ns], for values without a stamp.
        :param at: as `hear` returned it [ns].
        """
        for joiner in self.joiners.values():
            joiner.source_clock(wall, at)
        order: Sequence[int] = range(len(changes.stamp))
        if any(a > b for a, b in zip(changes.stamp, changes.stamp[1:], strict=False)):
            order = sorted(order, key=changes.stamp.__getitem__)
        items = self.items
        for n in order:
            item = items[changes.handle[n]]
            status, value = changes.status[n], changes.value[n]
            if status or changes.kind[n]:
                value = self._judge(item, status, value, changes.kind[n])
            elif item.joiner.tally.bad:
                item.joiner.tally.bad.pop(SIGNALS[item.slot], None)
            item.joiner.take(item.slot, changes.stamp[n] or wall, item.scale(value), at)

    def look(self, at: int) -> None:
        """
        Emit what is due of every valve.

        :param at: as `hear` returned it, or the present [ns].
        """
        known = self._horizon.known if self.prompt else at
        for joiner in self.joiners.values():
            joiner.look(at, known)

    def _judge(self, item: Item, status: int, value: float, kind: str) -> float:
        """Return a value by its quality: NaN for a bad one or for what is no number."""
        tally, name = item.joiner.tally, SIGNALS[item.slot]
        self.lost += status & OVERFLOW == OVERFLOW
        quality = status & QUALITY
        if quality == UNCERTAIN:
            tally.uncertain[name] = tally.uncertain.get(name, 0) + 1
        if quality not in (0, UNCERTAIN):
            tally.bad[name] = status_of(status).name
            return float('nan')
        if kind:
            tally.bad[name] = f'{kind} where a number is expected'
            return float('nan')
        tally.bad.pop(name, None)
        return value
