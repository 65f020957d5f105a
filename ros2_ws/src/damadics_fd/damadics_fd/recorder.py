# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The recorder node: topics, raw, into a crash-safe MCAP bag."""

import argparse
import importlib
import shutil
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.utilities import remove_ros_args

from damadics_fd.bag import BagError, BagWriter
from damadics_fd.bag.rosbag2 import QosProfile, Topic, qos
from damadics_fd.bag.spool import Spool

DEPTH = 100_000  # messages that may wait in the middleware while this process is held up
LOOK_PERIOD = 0.1  # [s] between two looks at the graph
QUIET = 0.03  # [s] without a message after which nothing is on its way any more
LAST_WAIT = 0.15  # [s] at most, from the signal to the closing of the bag
OWN_TOPICS = {  # subscribed before they have a publisher, so that nothing of them is missed
    'measurement': ('damadics_msgs/msg/Measurement', False),
    'fault_state': ('damadics_msgs/msg/FaultState', False),
    'estimate': ('damadics_msgs/msg/Estimate', False),
    'residual': ('damadics_msgs/msg/Float64Stamped', False),
    'threshold': ('damadics_msgs/msg/Float64Stamped', False),
    'fault_flag': ('damadics_msgs/msg/FaultFlag', True),
    'fault_event': ('damadics_msgs/msg/FaultEvent', True),
}


class Recorded(NamedTuple):
    """A topic with the subscription that feeds it and what this asks of the publishers."""

    topic: Topic
    subscription: Subscription
    reliable: bool
    latched: bool


def describe(profile: QoSProfile) -> QosProfile:
    """Describe the quality of service of a publisher as rosbag2 writes it."""
    spans = {}
    for name in ('deadline', 'lifespan', 'liveliness_lease_duration'):
        nanoseconds = getattr(profile, name).nanoseconds
        spans[name] = {'sec': nanoseconds // 10**9, 'nsec': nanoseconds % 10**9}
    return qos(
        profile.reliability.name.lower(), profile.durability.name.lower(),
        profile.history.name.lower(), profile.depth, liveliness=profile.liveliness.name.lower(),
        **spans,
    )


class Recorder(Node):
    """
    Record topics as they appear.

    :param bag: bag to write.
    :param topics: names of the topics to record, empty for all.
    :param rotate: remove the oldest file of the bag when the disk is full.
    """

    def __init__(self, bag: BagWriter, topics: list[str], rotate: bool = False):
        super().__init__('recorder')
        self.spool = Spool(bag, rotate)
        self._wanted = {self.resolve_topic_name(name) for name in topics}
        self._recorded: dict[str, Recorded] = {}
        self._refused: set[str] = set()
        self._lost: dict[str, int] = {}
        self._now: Callable[[], int] = time.time_ns
        if self.get_parameter('use_sim_time').value:
            self._now = lambda: self.get_clock().now().nanoseconds
        own = {self.resolve_topic_name(name): known for name, known in OWN_TOPICS.items()}
        for name, (kind, latched) in own.items():
            if not self._wanted or name in self._wanted:
                self._record(name, kind, True, latched)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self.look()
        self.create_timer(LOOK_PERIOD, self.look)
        self.create_timer(1.0, self.report)

    @property
    def topics(self) -> list[str]:
        """Names of the topics that are recorded."""
        return sorted(self._recorded)

    def look(self) -> None:
        """Subscribe to topics that have appeared, as their publishers offer them."""
        for name, kinds in self.get_topic_names_and_types():
            if name in self._refused or (self._wanted and name not in self._wanted):
                continue
            offers = [info.qos_profile for info in self.get_publishers_info_by_topic(name)]
            if not offers:
                continue
            reliable = all(o.reliability == ReliabilityPolicy.RELIABLE for o in offers)
            latched = all(o.durability == DurabilityPolicy.TRANSIENT_LOCAL for o in offers)
            known = self._recorded.get(name)
            if known and ((known.reliable and not reliable) or (known.latched and not latched)):
                self.destroy_subscription(known.subscription)  # asks for more than is offered
                known = None
            if not known:
                self._record(name, kinds[0], reliable, latched)
            if name in self._recorded:
                self._recorded[name].topic.offered_qos = [describe(offer) for offer in offers]

    def _record(self, name: str, kind: str, reliable: bool, latched: bool) -> None:
        package, folder, short = kind.split('/')
        try:
            message_type = getattr(importlib.import_module(f'{package}.{folder}'), short)
            topic = self.spool.bag.add_topic(name, kind)
        except (ImportError, AttributeError, BagError) as error:
            self._refused.add(name)
            self.get_logger().error(f'cannot record {name} of type {kind}: {error}')
            return
        put, now = self.spool.put, self._now

        def receive(data: bytes) -> None:
            put((topic, data, now()))

        def receive_first(data: bytes) -> None:
            self.look()  # the channel is written with the first message: who publishes it?
            subscription.callback = receive
            receive(data)

        profile = QoSProfile(
            depth=DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=(
                DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
            ),
        )
        events = SubscriptionEventCallbacks(
            message_lost=lambda event: self._lost.__setitem__(name, event.total_count)
        )
        subscription = self.create_subscription(
            message_type, name, receive_first, profile, raw=True, event_callbacks=events
        )
        self._recorded[name] = Recorded(topic, subscription, reliable, latched)

    def report(self) -> None:
        """Publish what is recorded, lost and waiting."""
        spool, bag = self.spool, self.spool.bag
        lost = sum(self._lost.values())
        status = DiagnosticStatus(name='recorder: bag', hardware_id=str(bag.path))
        if spool.error or spool.dropped:
            status.level = DiagnosticStatus.ERROR
            status.message = f'cannot write: {spool.error}' if spool.error else 'messages dropped'
        elif lost or self._refused:
            status.level = DiagnosticStatus.WARN
            status.message = 'messages lost' if lost else 'topics refused'
        else:
            status.level = DiagnosticStatus.OK
            status.message = 'recording'
        free = shutil.disk_usage(bag.path.parent).free
        values = {
            'Size (B)': bag.size, 'Messages waiting': spool.waiting, 'Messages lost': lost,
            'Messages dropped': spool.dropped, 'Free disk (B)': free,
            'Topics refused': ' '.join(sorted(self._refused)),
            **{f'Messages on {name}': count for name, count in bag.counts.items()},
        }
        status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)


def _arguments(args: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog='recorder', description='Record topics into an MCAP bag until SIGINT or SIGTERM.',
        epilog='example: ros2 run damadics_fd recorder measurement fault_flag --out bags/monday',
    )
    parser.add_argument('topics', nargs='*', help='topics to record; none means all')
    parser.add_argument('--all', action='store_true', help='record all topics')
    parser.add_argument(
        '--out', type=Path, help='bag directory to create, or a single .mcap file'
        ' (default: rosbag2_ and the time of day)',
    )
    parser.add_argument('--split-mb', type=float, default=0, help='new file every so many MB')
    parser.add_argument('--split-s', type=float, default=0, help='new file every so many seconds')
    parser.add_argument(
        '--quota-mb', type=float, default=0,
        help='keep the bag below so many MB by removing its oldest files',
    )
    options = parser.parse_args(args)
    if options.all and options.topics:
        parser.error('give topics or --all, not both')
    options.out = options.out or Path(time.strftime('rosbag2_%Y_%m_%d-%H_%M_%S'))
    return options


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    arguments = sys.argv if args is None else ['recorder', *args]
    options = _arguments(remove_ros_args(arguments)[1:])
    stop = []
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda signum, frame: stop.append(signum))
    try:
        bag = BagWriter(
            options.out, split_bytes=int(options.split_mb * 1e6), split_seconds=options.split_s,
            quota_bytes=int(options.quota_mb * 1e6),
        )
        node = Recorder(bag, options.topics, rotate=options.quota_mb > 0)
        print(f'recording {" ".join(node.topics)} into {bag.path}', flush=True)
        _spin(node, stop)
        node.spool.close()
    except (BagError, OSError) as error:
        print(f'recorder: {error}', file=sys.stderr)
        return 1
    finally:
        rclpy.try_shutdown()
    print(f'recorded {sum(bag.counts.values())} messages, {bag.size} bytes: {bag.path}')
    return 0


def _spin(node: Recorder, stop: list[int]) -> None:
    """Receive until a signal comes, then what is still on its way."""
    from rclpy.experimental import EventsExecutor

    executor = EventsExecutor()
    executor.add_node(node)
    never: Future = Future()
    while not stop:
        # many callbacks per call, where spin_once() returns after each; timed, because untimed
        # waiting is broken in the wheels
        executor.spin_until_future_complete(never, 0.05)
    end = time.monotonic() + LAST_WAIT
    received = -1
    while received != node.spool.received and time.monotonic() < end:
        received = node.spool.received
        executor.spin_until_future_complete(never, QUIET)


if __name__ == '__main__':
    sys.exit(main())
