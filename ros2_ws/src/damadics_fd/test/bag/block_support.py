# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bags with blocks of many valves, for tests."""

import array

import numpy as np
from damadics_fd.bag import BagWriter
from damadics_fd.bag.rosbag2 import qos

from .bag_support import stroke

SIGNALS = ('cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps')
CODES = {'valve': 'I', 'stamp': 'q'} | dict.fromkeys(SIGNALS, 'd')
LATCHED = qos(durability='transient_local', depth=1)
LATE = 10**18  # ns, log time of the first block


def valves(count: int = 4, rows: int = 3000) -> dict[str, dict[str, np.ndarray]]:
    """Return columns of valves, each with a course of its own; the stem of the first jumps."""
    rng = np.random.default_rng(3)
    found = {}
    for n in range(count):
        columns = {name: stroke(rows, 100.0)[name] for name in ('stamp', *SIGNALS)}
        columns['x1'] = columns['x1'] + 1e-4 * rng.standard_normal(rows)
        columns['stamp'] = columns['stamp'] + n * 1000
        if n:
            columns['x1'] = np.clip(columns['x1'] * (1.0 - 0.01 * n), 0.0, 1.0)
        found[f'/lv{n}'] = columns
    return found


class Blocks:
    """
    Write blocks and layouts.

    :param path: bag.
    :param topic: of the blocks.
    """

    def __init__(self, path, topic: str = '/measurement_block') -> None:
        self._bag = BagWriter(path, chunk_size=1 << 16)
        self._layout = self._bag.add_topic(
            topic.rpartition('/')[0] + '/fleet/layout', 'damadics_msgs/msg/FleetLayout', [LATCHED]
        )
        self._block = self._bag.add_topic(topic, 'damadics_msgs/msg/MeasurementBlock', [qos()])
        self._clock = LATE

    def __enter__(self):
        return self

    def __exit__(self, *exception) -> None:
        self._bag.close()

    def layout(self, version: int, names, tags=None) -> None:
        from damadics_msgs.msg import FleetLayout
        from rclpy.serialization import serialize_message

        names = list(names)
        message = FleetLayout(version=version, valve=names)
        message.actuator = list(tags or (name.strip('/').upper() for name in names))
        message.area = [''] * len(names)
        self._put(self._layout, serialize_message(message))

    def block(self, version: int, **columns) -> None:
        from damadics_msgs.msg import MeasurementBlock
        from rclpy.serialization import serialize_message

        message = MeasurementBlock(layout=version)
        message.header.stamp.sec = 77
        for name, values in columns.items():
            code = CODES[name]
            kind = {'I': np.uint32, 'q': np.int64, 'd': np.float64}[code]
            setattr(message, name, array.array(code, np.asarray(values, kind).tobytes()))
        self._put(self._block, serialize_message(message))

    def _put(self, topic, data: bytes) -> None:
        self._clock += 1000
        self._bag.write(topic, data, self._clock, self._clock)


def _column(columns, signal: str) -> np.ndarray:
    return columns.get(signal, np.full(len(columns['stamp']), np.nan))


def write_blocks(path, columns, version: int = 7, sizes=(50, 31, 1, 200)) -> None:
    """Write the rows of valves in blocks of changing size, the valves mixed."""
    names = list(columns)
    stamp = np.concatenate([columns[name]['stamp'] for name in names])
    valve = np.repeat(np.arange(len(names)), [len(columns[name]['stamp']) for name in names])
    order = np.lexsort((valve, stamp))
    mixed = {'valve': valve[order], 'stamp': stamp[order]} | {
        signal: np.concatenate([_column(columns[name], signal) for name in names])[order]
        for signal in SIGNALS
    }
    with Blocks(path) as bag:
        bag.layout(version, names)
        first = turn = 0
        while first < len(order):
            size = sizes[turn % len(sizes)]
            rows = slice(first, first + size)
            bag.block(version, **{name: column[rows] for name, column in mixed.items()})
            first, turn = first + size, turn + 1
