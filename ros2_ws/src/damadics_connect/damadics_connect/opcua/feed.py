# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The valves with one period: what is subscribed to together."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from damadics_connect.joining import NANO, Joiner
from damadics_connect.publishing import Output
from damadics_connect.valve_list import ValveSource

SHORTEST_INTERVAL, LONGEST_INTERVAL = 0.02, 0.5  # s between two messages of the server
HELD_UP = 2.0  # s for which the server keeps values while it, the network or we are held up


class Options(NamedTuple):
    """How the server is asked."""

    interval: float = 0.0  # s between two messages of the server; 0: half the valve's period
    queue: int = 0  # values kept for one message; 0: those of 2 s more
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
        self.tick = min(max(self.interval / 2.0, 0.01), 0.1)  # s between two looks
        self.queue = options.queue or round((self.interval + HELD_UP) / period) + 2
        self.items: list[Item] = []
        self.nodes: list[str] = []
        self.joiners: dict[str, Joiner] = {}
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

    def look(self, now: int) -> None:
        """
        Emit what is due of every valve.

        :param now: monotonic time [ns].
        """
        for joiner in self.joiners.values():
            joiner.look(now)
