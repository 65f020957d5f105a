# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Publish samples: each valve on its own topic, or many in blocks."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from damadics_fd.core.sample import SIGNALS
from damadics_fd.ros import qos
from damadics_msgs.msg import Measurement
from rclpy.node import Node

NANO = 1_000_000_000
P1, P2, PS = (SIGNALS.index(name) for name in ('p1', 'p2', 'ps'))


class ValveName(NamedTuple):
    """How a valve is known: its namespace and its tag."""

    name: str
    actuator: str


class Output(Protocol):
    """Takes samples; `flush` is called after each batch of them."""

    @property
    def samples(self) -> int:
        """Number of samples taken."""

    @property
    def zero(self) -> set[str]:
        """Valves whose p1, p2 and ps are all exactly 0."""

    def send(self, valve: int, stamp: int, values: list[float]) -> None:
        """Take a sample: number of the valve, stamp [ns], the values of `SIGNALS`."""

    def flush(self) -> None:
        """Publish what is still held."""


class Topics:
    """
    Publish each sample on the topic `measurement` of its valve.

    :param node: that publishes.
    :param valves: in the order of their numbers.
    """

    def __init__(self, node: Node, valves: Sequence[ValveName]) -> None:
        self.samples = 0
        self.zero: set[str] = set()
        self._names = [valve.name for valve in valves]
        self._publishers = [
            node.create_publisher(Measurement, f'/{valve.name}/measurement', qos.SAMPLES)
            for valve in valves
        ]
        self._messages = [Measurement() for _ in valves]
        for message, valve in zip(self._messages, valves, strict=True):
            message.header.frame_id = valve.actuator

    def send(self, valve: int, stamp: int, values: list[float]) -> None:
        """Publish a sample."""
        message = self._messages[valve]
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, NANO)
        (
            message.cv,
            message.x1,
            message.p1,
            message.p2,
            message.t1,
            message.flow,
            message.ps,
        ) = values
        self._publishers[valve].publish(message)
        self.samples += 1
        look_for_zeros(self.zero, self._names[valve], values)

    def flush(self) -> None:
        """Do nothing: every sample has gone."""


def look_for_zeros(zero: set[str], name: str, values: Sequence[float]) -> None:
    """
    Note a valve whose pressures are all exactly 0, as of a client that leaves fields out.

    :param zero: names of such valves, written.
    :param name: of the valve.
    :param values: of `SIGNALS`.
    """
    if values[P1] == values[P2] == values[PS] == 0.0:
        zero.add(name)
    elif zero:
        zero.discard(name)


def output_of(how: str, node: Node, valves: Sequence[ValveName]) -> Output:
    """
    Make the output that a configuration asks for.

    :param how: `topics` or `blocks`.
    :param node: that publishes.
    :param valves: in the order of their numbers.
    :return: the output.
    """
    if how == 'blocks':
        from damadics_connect.blocks import Blocks

        return Blocks(node, valves)
    return Topics(node, valves)
