# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Publish the samples of a valve that another program writes: `my_reader | python driver.py /lv101`.

The first line names the columns, any of t (s since 1970, when it was measured), cv, x1, p1, p2,
t1, flow, ps; then a line per sample. What is left out is not measured.
"""

import sys

import rclpy
from damadics_msgs.msg import Measurement
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time

SIGNALS = ('cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps')
SAMPLES = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
NOT_MEASURED = float('nan')


def main(valve: str) -> None:
    """Publish until the input ends or Ctrl-C."""
    rclpy.init()
    node = rclpy.create_node('driver', namespace=valve)
    publisher = node.create_publisher(Measurement, 'measurement', SAMPLES)
    names = sys.stdin.readline().split()
    if unknown := set(names) - {'t', *SIGNALS}:
        sys.exit(
            f'no such column: {", ".join(sorted(unknown))}; there are t, {", ".join(SIGNALS)}'
        )
    try:
        for number, line in enumerate(sys.stdin, 2):
            try:
                values = dict(zip(names, map(float, line.split()), strict=True))
            except ValueError:
                sys.exit(f'line {number}: give {len(names)} numbers ({" ".join(names)}): {line}')
            message = Measurement(**{name: values.get(name, NOT_MEASURED) for name in SIGNALS})
            measured = values.get('t')
            stamp = node.get_clock().now() if measured is None else Time(seconds=measured)
            message.header.stamp = stamp.to_msg()
            publisher.publish(message)
    except KeyboardInterrupt:
        node.destroy_node()


if __name__ == '__main__':
    main(sys.argv[1] if len(sys.argv) > 1 else '/lv101')
