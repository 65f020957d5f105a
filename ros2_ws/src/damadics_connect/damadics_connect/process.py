# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A connector as a process: asyncio in the main thread, its ROS 2 node in another."""

import asyncio
import logging
import signal
import sys
import threading
from collections.abc import Awaitable, Callable, Sequence

import rclpy
from damadics_fd.ros.diagnostics import Diagnostics, Report
from damadics_fd.ros.entities import Entities
from damadics_fd.ros.spin import spin_until
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.node import Node

from damadics_connect.settings import ConfigError

WRONG_USAGE = 2  # exit code: starting again would not help


class ConnectError(Exception):
    """A connector cannot start; the message names cause and remedy in one line."""


class Graph:
    """
    The node of a connector, spun in a thread of its own.

    :param name: of the node.
    :param ros_args: arguments of ROS 2, from `--ros-args` on.
    """

    def __init__(self, name: str, ros_args: Sequence[str] = ()) -> None:
        rclpy.init(
            args=list(ros_args), signal_handler_options=rclpy.signals.SignalHandlerOptions.NO
        )
        self.node = Node(name)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._spin, name='ros', daemon=True)

    def tell_health(self, what: str, report: Callable[[], Report]) -> None:
        """
        Have a report published on `/diagnostics` once a second.

        :param what: is reported on.
        :param report: returns level, sentence and key-values.
        """
        Diagnostics(self.node, Entities(self.node), what, report)

    def start(self) -> None:
        """Begin to spin; make publishers, subscriptions and timers before."""
        self._thread.start()

    def stop(self) -> None:
        """Leave the graph."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(5.0)
        rclpy.try_shutdown()

    def _spin(self) -> None:
        executor = EventsExecutor()
        executor.add_node(self.node)
        try:
            spin_until(lambda: self._stop.is_set() or not rclpy.ok(), executor, [self.node])
        except ExternalShutdownException:
            return
        finally:
            executor.shutdown()
            self.node.destroy_node()


def run(name: str, main: Callable[[], Awaitable[int]], quiet: Sequence[str] = ()) -> int:
    """
    Run a connector until it has finished or a signal comes.

    :param name: of the command, for messages.
    :param main: its work; it is cancelled by SIGINT and SIGTERM.
    :param quiet: loggers of libraries that would print what is told in a line of our own, and
        might print more than they should.
    :return: the exit code.
    """
    for logger in quiet:
        logging.getLogger(logger).setLevel(logging.CRITICAL + 1)

    async def guarded() -> int:
        task = asyncio.ensure_future(main())
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, task.cancel)
        try:
            return await task
        except asyncio.CancelledError:
            return 0

    try:
        return asyncio.run(guarded())
    except ConfigError as problem:
        print(f'{name}: {problem}', file=sys.stderr)
        return WRONG_USAGE
    except (ConnectError, OSError) as problem:
        print(f'{name}: {problem}', file=sys.stderr)
        return 1
