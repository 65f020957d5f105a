# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Start a node, spin it until it has finished or a signal comes, and end it cleanly."""

import sys
from collections.abc import Callable
from typing import Protocol

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.task import Future


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
    rclpy.init(args=args)
    try:
        node = make_node()
    except StartError as problem:
        print(problem, file=sys.stderr)
        rclpy.try_shutdown()
        return 1
    except (KeyboardInterrupt, Exception) as problem:
        if rclpy.ok() and not isinstance(problem, KeyboardInterrupt):
            raise
        rclpy.try_shutdown()
        return 0  # a signal came while the node was starting
    executor = EventsExecutor()
    executor.add_node(node)
    try:
        # Never untimed: an untimed spin of this executor does not return in some builds. Many
        # callbacks a call, where spin_once returns after each.
        never: Future = Future()
        while rclpy.ok() and not node.finished:
            executor.spin_until_future_complete(never, 0.1)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        executor.shutdown()
        rclpy.try_shutdown()
    return node.exit_code
