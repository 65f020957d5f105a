# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Start a node, spin it until it has finished or a signal comes, and end it cleanly."""

import gc
import signal
import sys
from collections.abc import Callable
from typing import Protocol

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

SLICE = 0.05  # s between two looks at the signals


class SpinnableNode(Protocol):
    """What `spin` needs of a node."""

    finished: bool
    exit_code: int

    def destroy_node(self) -> None:
        """Release what the node holds."""


class StartError(Exception):
    """A node refuses to start; the message names every cause and its remedy."""


def spin(make_node: Callable[[], SpinnableNode], args: list[str] | None = None) -> int:
    """
    Run one node as a process does.

    :param make_node: makes the node; may raise `StartError`.
    :param args: command line, `sys.argv` by default.
    :return: the exit code: 0 after SIGINT, SIGTERM or the end of the node's work, 1 where the
        node did not start, or what the node gives.
    """
    stop: list[int] = []
    node = None

    def end(number: int, frame: object) -> None:
        stop.append(number)
        if node is None and len(stop) == 1:
            raise KeyboardInterrupt  # it may take a while to make the node

    # Not the handlers of rclpy: they end the context at the first signal and give the second one
    # to Python, whose KeyboardInterrupt aborts the process in the executor's C++. Launch sends
    # two: Ctrl-C reaches the whole group, and launch passes it on.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = make_node()
        executor = EventsExecutor()
        executor.add_node(node)
        # Never untimed: an untimed spin of this executor does not return in some builds. Many
        # callbacks a call, where spin_once returns after each.
        never: Future = Future()
        while not (stop or node.finished):
            executor.spin_until_future_complete(never, SLICE)
    except StartError as problem:
        print(problem, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 0
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)  # it is ending already
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
        # Leave nothing to the interpreter's last collections: they cost 0.35 s of CPU time, which
        # a fleet of many nodes would wait for when it ends.
        gc.freeze()
    return node.exit_code
