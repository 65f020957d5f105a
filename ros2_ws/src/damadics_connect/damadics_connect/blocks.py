# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Publish the samples of many valves in few messages."""

import zlib
from array import array
from collections.abc import Sequence

import numpy as np
from damadics_fd.core.sample import SIGNALS
from damadics_fd.ros import qos
from damadics_msgs.msg import FleetLayout, MeasurementBlock
from rclpy.node import Node

from damadics_connect.publishing import NANO, ValveName, look_for_zeros

MOST_ROWS = 4096  # of one message


class Blocks:
    """
    Publish samples on `measurement_block`, and on `fleet/layout` whose they are.

    The version of the layout is a checksum of its lists: the same valves have the same version
    after a restart, and two sources of blocks do not have one by chance.

    :param node: that publishes.
    :param valves: in the order of their numbers.
    """

    def __init__(self, node: Node, valves: Sequence[ValveName]) -> None:
        self.samples = 0
        self.zero: set[str] = set()
        self._names = [valve.name for valve in valves]
        self._valve: list[int] = []
        self._stamp: list[int] = []
        self._rows: list[list[float]] = []
        layout = FleetLayout(
            valve=[f'/{valve.name}' for valve in valves],
            actuator=[valve.actuator for valve in valves],
            area=[''] * len(valves),
        )
        layout.header.stamp = node.get_clock().now().to_msg()
        lists = '\n'.join(f'{valve.name}\t{valve.actuator}' for valve in valves)
        layout.version = self._version = zlib.crc32(lists.encode())
        self._layout = node.create_publisher(FleetLayout, '/fleet/layout', qos.latched(1))
        self._layout.publish(layout)
        self._publisher = node.create_publisher(
            MeasurementBlock, '/measurement_block', qos.SAMPLES
        )

    def send(self, valve: int, stamp: int, values: list[float]) -> None:
        """Take a sample into the block."""
        self._valve.append(valve)
        self._stamp.append(stamp)
        self._rows.append(values)
        look_for_zeros(self.zero, self._names[valve], values)
        if len(self._rows) >= MOST_ROWS:
            self.flush()

    def flush(self) -> None:
        """Publish the block."""
        if not self._rows:
            return
        message = MeasurementBlock(layout=self._version)
        newest = max(self._stamp)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(newest, NANO)
        message.valve = array('I', self._valve)
        message.stamp = array('q', self._stamp)
        columns = np.array(self._rows, np.float64).T
        for name, column in zip(SIGNALS, columns, strict=True):
            if not np.isnan(column).all():
                setattr(message, name, array('d', column.tobytes()))
        self._publisher.publish(message)
        self.samples += len(self._rows)
        self._valve, self._stamp, self._rows = [], [], []
