# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Print each change of a valve's judgement, and silence: `python subscriber.py /lv101`."""

import sys
import time

import rclpy
from damadics_msgs.msg import FaultFlag
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

STATES = ('not monitored', 'learning', 'healthy', 'alarm', 'latched', 'shelved', 'unknown')
LATCHED = QoSProfile(  # the present flag comes at once
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)


def main(valve: str) -> None:
    """Listen until Ctrl-C; the flag is repeated every second, silence of two is no health."""
    rclpy.init()
    node = rclpy.create_node('subscriber')
    heard, shown = 0.0, ''

    def take(flag: FaultFlag) -> None:
        nonlocal heard
        heard = time.monotonic()
        show(f'{STATES[flag.state]}: residual {flag.residual:.3g}, limit {flag.threshold:.3g}')

    def show(text: str) -> None:
        nonlocal shown
        if text.partition(':')[0] != shown.partition(':')[0]:
            print(f'{valve} {text}', flush=True)
        shown = text

    node.create_subscription(FaultFlag, f'{valve}/fault_flag', take, LATCHED)
    try:
        while rclpy.ok():
            rclpy.spin_once(node, timeout_sec=0.5)
            if time.monotonic() - heard > 2.0:
                show('not monitored: no word for 2 s')
    except KeyboardInterrupt:
        node.destroy_node()


if __name__ == '__main__':
    main(sys.argv[1] if len(sys.argv) > 1 else '/lv101')
