# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Keep the timers of nodes going when somebody sets the system clock back."""

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from rclpy.node import Node

PERIOD = 0.1  # s between two looks at the clocks
STEP = 0.05  # s that the system clock is behind where it should be


@contextmanager
def timers_kept_going(nodes: Sequence[Node]) -> Iterator[None]:
    """
    Start all timers of nodes anew when the system clock is set back.

    rclpy waits for its timers, those of the steady clock too, until a time of the system clock
    where it was built for an old C library, as its wheels are: after a step of an hour back no
    timer would fire for an hour, and silence of the input would go unnoticed.

    :param nodes: whose timers they are; may change meanwhile.
    :return: a context.
    """
    ended = False

    def watch() -> None:
        ahead = time.time() - time.monotonic()
        while not ended:
            time.sleep(PERIOD)
            now = time.time() - time.monotonic()
            if now < ahead - STEP:
                for node in list(nodes):
                    for timer in node.timers:
                        timer.reset()
            ahead = now

    thread = threading.Thread(target=watch, name='clock step', daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended = True
        thread.join()
