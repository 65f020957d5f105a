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
    node = None
    try:
        node = make_node()
        executor = EventsExecutor()
        executor.add_node(node)
        # Never untimed: an untimed spin of this executor does not return in some builds. Many
        # callbacks a call, where spin_once returns after each.
        never: Future = Future()
        while rclpy.ok() and not node.finished:
            executor.spin_until_future_complete(never, 0.1)
    except StartError as problem:
        print(problem, file=sys.stderr)
        return 1
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except Exception:
        if rclpy.ok():
            raise
        # a signal has ended the context between two calls, or while the node was starting
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return node.exit_code if node is not None else 0
