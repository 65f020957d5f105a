# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Start nodes, spin them until they have finished or a signal comes, and end them cleanly."""

import gc
import signal
import sys
import time
from collections.abc import Callable, Sequence

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as rcl
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from damadics_fd.core.text import SENTENCE, plain
from damadics_fd.ros.process.clock_step import timers_kept_going
from damadics_fd.ros.process.sockets import let_messages_wait

WRONG = (NameValidationException, ParameterException)
LOOK = 0.1  # s between two looks at whether to end
FINISHING = 60.0  # s that subscribers may need for the last samples of a node that is done
LEAVING = 5.0  # s that they may need where a signal ends the process
QUIET = 0.02  # s without a message, three times in a row: nothing is on its way any more
TIMES_QUIET = 3
STREAM = 0.12  # s after which a stream that goes on is left
HELD_UP = 5.0  # s that messages of before the end may take where this process is held up
LONG = 3600.0  # s; a call costs 30 bytes that rclpy never frees


class SpinnableNode(Node):
    """A node that says when it has finished, and how."""

    finished: bool
    exit_code: int


class StartError(Exception):
    """A node refuses to start; the message names every cause and its remedy."""

    exit_code = 1


class UsageError(StartError):
    """What a node was given is wrong: it would be as wrong after a restart."""

    exit_code = 2


def spin_until(done: Callable[[], bool], executor: EventsExecutor, nodes: Sequence[Node]) -> None:
    """
    Let nodes work until there is a reason to end.

    :param done: looked at ten times a second; a handler of signals may make it true.
    :param executor: that has the nodes.
    :param nodes: at least one.
    """
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    let_messages_wait()
    with timers_kept_going(nodes):
        while not done():
            ended: Future[None] = Future()

            def look(ended: 'Future[None]' = ended) -> None:
                if done():
                    ended.set_result(None)

            timer = nodes[0].create_timer(LOOK, look, clock=steady)
            try:
                # Never untimed: an untimed spin of this executor does not return in some builds.
                # Many callbacks a call, where spin_once returns after each.
                executor.spin_until_future_complete(ended, LONG)
            except ExternalShutdownException:
                raise
            except Exception as error:  # of rclpy itself: the other nodes must go on
                nodes[0].get_logger().error(f'internal error: {type(error).__name__}: {error}')
                time.sleep(LOOK)
            nodes[0].destroy_timer(timer)


def take_what_is_on_its_way(
    executor: EventsExecutor, received: Callable[[], int], newest: Callable[[], int]
) -> None:
    """
    Let subscribers take what was published until now.

    A machine that is busy may hold this process up while messages wait for it: to hear nothing
    counts only where it could listen, and what was published before is waited for.

    :param executor: that has the subscribers.
    :param received: returns how many messages came so far.
    :param newest: returns when the last of them was published [ns, wall clock].
    """
    now, start = time.time_ns(), time.monotonic()
    never: Future[None] = Future()
    quiet = 0
    while quiet < TIMES_QUIET and time.monotonic() < start + HELD_UP:
        before, began = received(), time.monotonic()
        executor.spin_until_future_complete(never, QUIET)
        if received() != before:
            quiet = 0
            # of after, so those of before have come; but a publisher's clock may be ahead
            if newest() > now and time.monotonic() > start + STREAM:
                return
        elif time.monotonic() - began < 2.0 * QUIET:
            quiet += 1


def let_subscribers_take(nodes: Sequence[Node], patience: float) -> bool:
    """
    Wait until the reliable subscribers of nodes have what was published: it goes with the nodes.

    :param nodes: that are about to be destroyed.
    :param patience: time it may take, for all nodes [s].
    :return: whether all have all.
    """
    deadline = time.monotonic() + patience
    for publisher in [publisher for node in nodes for publisher in node.publishers]:
        if publisher.get_subscription_count():
            left = max(deadline - time.monotonic(), 0.001)
            if not publisher.wait_for_all_acked(Duration(seconds=left)):
                print(
                    f'{publisher.topic_name}: left before every subscriber had all',
                    file=sys.stderr,
                )
                return False
    return True


def spin(make_node: Callable[[], SpinnableNode], args: list[str] | None = None) -> int:
    """
    Run one node as a process does.

    :param make_node: makes the node; may raise `StartError`.
    :param args: command line, `sys.argv` by default.
    :return: the exit code: 0 after SIGINT, SIGTERM or the end of the node's work, 1 where the
        node did not start, or what the node gives.
    """
    return spin_all([make_node], args)


def spin_all(makers: Sequence[Callable[[], SpinnableNode]], args: list[str] | None = None) -> int:
    """
    Run nodes together in one process, until the last has finished.

    :param makers: each makes a node; may raise `StartError`, then none runs.
    :param args: command line, `sys.argv` by default.
    :return: the exit code as of `spin`, the largest of the nodes.
    """
    stop: list[int] = []
    nodes: list[SpinnableNode] = []
    ready = False
    exit_code = 0

    def end(number: int, frame: object) -> None:
        stop.append(number)
        if not ready and len(stop) == 1:
            raise KeyboardInterrupt  # it may take a while to make the nodes

    # Not the handlers of rclpy: they end the context at the first signal and give the second one
    # to Python, whose KeyboardInterrupt aborts the process in the executor's C++. Launch sends
    # two: Ctrl-C reaches the whole group, and launch passes it on.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        executor = EventsExecutor()
        for make_node in makers:
            nodes.append(make_node())
            executor.add_node(nodes[-1])
        ready = True
        while nodes and not stop:
            spin_until(lambda: bool(stop) or any(node.finished for node in nodes), executor, nodes)
            for node in [node for node in nodes if node.finished]:
                exit_code = max(exit_code, node.exit_code)
                nodes.remove(node)
                executor.remove_node(node)
                let_subscribers_take([node], FINISHING)
                node.destroy_node()
    except StartError as problem:
        print(problem, file=sys.stderr)
        return problem.exit_code
    except (rcl.RCLError, rcl.UnknownROSArgsError, *WRONG) as problem:
        print(f'wrong arguments: {plain(str(problem), SENTENCE)}', file=sys.stderr)
        return UsageError.exit_code
    except KeyboardInterrupt:
        return 0
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)  # it is ending already
        let_subscribers_take(nodes, LEAVING)
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()
        # Leave nothing to the interpreter's last collections: they cost 0.35 s of CPU time, which
        # a fleet of many nodes would wait for when it ends.
        gc.freeze()
    return max([exit_code, *(node.exit_code for node in nodes)])
