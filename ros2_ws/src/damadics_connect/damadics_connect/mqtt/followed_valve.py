# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A valve whose samples come from a broker."""

from collections.abc import Callable

from damadics_connect.joining import Joiner
from damadics_connect.source_clock import NANO
from damadics_connect.valve_list import ValveSource


class FollowedValve:
    """
    One valve: its joiner and what its messages are called.

    :param source: of its signals.
    :param emit: takes stamp and values of each sample.
    """

    def __init__(self, source: ValveSource, emit: Callable[[int, list[float]], None]) -> None:
        self.source = source
        self.joiner = Joiner(
            int(source.period * NANO),
            int(0.3 * source.period * NANO),
            tuple(signal.slot for signal in source.signals),
            emit,
        )
        self.fields = {signal.source: signal for signal in source.signals}
        self.aliases: dict[int, str] = {}
        self.alive = False  # a Sparkplug B device that was born: what it does not say holds
        self.refused = ''
        self.unstamped = 0  # messages without a time
