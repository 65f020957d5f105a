# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The recorder node: raw subscriptions to topics as they appear."""

import importlib
import inspect
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from damadics_fd.bag import rosbag2
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.rosbag2 import Topic
from damadics_fd.bag.writing.spool import Spool
from damadics_fd.ros.graph_events import GraphEvents
from damadics_fd.ros.loss_count import Sequence

DEPTH = 100_000  # messages that may wait in the middleware while this process is held up
LOOK_PERIOD = 0.1  # [s] from a change of the graph to a look at it, at most
LOOK_SHARE = 0.1  # of the time that looks may take while the graph keeps changing
BLIND_PERIOD = 1.0  # [s] between two looks where the middleware tells of no changes
MOST_SHOWN = 50  # topics counted one by one in /diagnostics
BLOCK_TOPIC = 'measurement_block'
OWN_TOPICS = {  # subscribed before they have a publisher, so that nothing of them is missed
    'measurement': ('damadics_msgs/msg/Measurement', False),
    'fault_state': ('damadics_msgs/msg/FaultState', False),
    'estimate': ('damadics_msgs/msg/Estimate', False),
    'residual': ('damadics_msgs/msg/Float64Stamped', False),
    'threshold': ('damadics_msgs/msg/Float64Stamped', False),
    'fault_flag': ('damadics_msgs/msg/FaultFlag', True),
    'fault_event': ('damadics_msgs/msg/FaultEvent', True),
    BLOCK_TOPIC: ('damadics_msgs/msg/MeasurementBlock', False),
}


def layout_topic(block_topic: str) -> str:
    """
    Return the topic that says which valves the blocks of a topic name.

    >>> layout_topic('/north/measurement_block')
    '/north/fleet/layout'
    """
    return block_topic.removesuffix(BLOCK_TOPIC) + 'fleet/layout'


class Recorded(NamedTuple):
    """A topic with the subscription that feeds it and what this asks of the publishers."""

    topic: Topic
    subscription: Subscription
    reliable: bool
    latched: bool
    sequence: Sequence


def describe(profile: QoSProfile) -> rosbag2.QosProfile:
    """Describe the quality of service of a publisher as rosbag2 writes it."""
    spans = {}
    for name in ('deadline', 'lifespan', 'liveliness_lease_duration'):
        nanoseconds = getattr(profile, name).nanoseconds
        spans[name] = {'sec': nanoseconds // 10**9, 'nsec': nanoseconds % 10**9}
    return rosbag2.qos(
        profile.reliability.name.lower(),
        profile.durability.name.lower(),
        profile.history.name.lower(),
        profile.depth,
        liveliness=profile.liveliness.name.lower(),
        **spans,
    )


def matching(reliable: bool, latched: bool) -> QoSProfile:
    """Return the profile of a subscription that asks for no more than is offered."""
    return QoSProfile(
        depth=DEPTH,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


class Recorder(Node):
    """
    Record topics as they appear.

    :param spool: takes the messages.
    :param topics: names of the topics to record, empty for all.
    """

    def __init__(self, spool: Spool, topics: list[str]):
        super().__init__('recorder')
        self._spool = spool
        self.newest = 0  # when the last message was published [ns]
        self._wanted = {self.resolve_topic_name(name) for name in topics}
        # blocks name their valves by number: without the list of these nobody can read them
        self._wanted |= {layout_topic(n) for n in self._wanted if n.endswith(f'/{BLOCK_TOPIC}')}
        self._recorded: dict[str, Recorded] = {}
        self._refused: set[str] = set()
        self._now: Callable[[], int] = time.time_ns
        if self.get_parameter('use_sim_time').value:
            self._now = lambda: self.get_clock().now().nanoseconds
        for name, (kind, latched) in OWN_TOPICS.items():
            full = self.resolve_topic_name(name)
            if not self._wanted or full in self._wanted:
                self._record(full, kind, True, latched)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._changed = threading.Event()
        self._looked = 0.0  # [s] monotonic time of the last look, and what it took
        self._look_took = 0.0
        self._graph: GraphEvents | None = None
        try:
            self._graph = GraphEvents(self, self._changed.set)
        except OSError as error:
            self.get_logger().warning(f'asking for topics once a second: {error}')
        self.look()
        self.create_timer(LOOK_PERIOD, self._look_if_changed)
        self.create_timer(1.0, self._report)

    @property
    def topics(self) -> list[str]:
        """Names of the topics that are recorded."""
        return sorted(self._recorded)

    @property
    def wanted(self) -> set[str]:
        """Names of the topics that were asked for, none where it is all."""
        return self._wanted

    def _look_if_changed(self) -> None:
        """Look where the graph has changed; less often the longer a look takes."""
        since = time.monotonic() - self._looked
        due = self._changed.is_set() if self._graph else since >= BLIND_PERIOD
        if due and since * LOOK_SHARE >= self._look_took:
            self._changed.clear()
            began = time.monotonic()
            self.look()
            self._looked = time.monotonic()
            self._look_took = self._looked - began

    def destroy_node(self) -> None:
        """Stop watching the graph, and let go of everything."""
        if self._graph:
            self._graph.close()
            self._graph = None
        super().destroy_node()

    def look(self) -> None:
        """Subscribe to topics that have appeared, as their publishers offer them; count losses."""
        for name, kinds in self.get_topic_names_and_types():
            if name in self._refused or (self._wanted and name not in self._wanted):
                continue
            infos = self.get_publishers_info_by_topic(name)
            if not infos:
                continue
            kind = infos[0].topic_type
            offers = [info.qos_profile for info in infos if info.topic_type == kind]
            reliable = all(o.reliability == ReliabilityPolicy.RELIABLE for o in offers)
            latched = all(o.durability == DurabilityPolicy.TRANSIENT_LOCAL for o in offers)
            known = self._recorded.get(name)
            if known and known.topic.type != kind:
                self._refuse(name, f'its type is {", ".join(kinds)}, not {known.topic.type}')
                continue
            if known and (known.reliable > reliable or known.latched > latched):
                self.destroy_subscription(known.subscription)  # asks for more than is offered
                known = None
            if not known:
                self._record(name, kind, reliable, latched)
            if name in self._recorded:
                found = self._recorded[name]
                found.topic.offered_qos = [describe(offer) for offer in offers]
                found.sequence.settle(bytes(info.endpoint_gid) for info in infos)

    def _refuse(self, name: str, reason: str) -> None:
        self._refused.add(name)
        self.get_logger().error(f'cannot record {name}: {reason}')

    def _record(self, name: str, kind: str, reliable: bool, latched: bool) -> None:
        try:
            topic = self._spool.bag.add_topic(name, kind)  # refuses what is no installed message
            package, folder, short = kind.split('/')
            message_type = getattr(importlib.import_module(f'{package}.{folder}'), short)
        except (ImportError, AttributeError, BagError) as error:
            self._refuse(name, str(error))
            return
        put, now, sequence = self._spool.put, self._now, self._sequence(name)
        first = True

        def receive(*given: Any) -> None:
            nonlocal first
            # rclpy 7.1.6 hands message and info over as one pair in this executor
            data, info = given if len(given) == 2 else given[0]
            if first:  # the channel is written with the first message: who publishes it?
                first = False
                infos = self.get_publishers_info_by_topic(name)
                topic.offered_qos = [describe(info.qos_profile) for info in infos]
            number = info['publication_sequence_number']
            if number is not None:
                sequence.note(number)
            logged = now()
            self.newest = info['source_timestamp'] or logged
            put((topic, data, logged, self.newest))

        receive.__signature__ = inspect.signature(lambda message, info: None)  # type: ignore[attr-defined]
        # no event of the middleware, not even the default ones: taking one can block for ever
        # in this executor while messages arrive (seen in rclpy 7.1.6, message_lost)
        events = SubscriptionEventCallbacks(use_default_callbacks=False)
        subscription = self.create_subscription(
            message_type,
            name,
            receive,
            matching(reliable, latched),
            raw=True,
            event_callbacks=events,
        )
        self._recorded[name] = Recorded(topic, subscription, reliable, latched, sequence)

    def _sequence(self, name: str) -> Sequence:
        return self._recorded[name].sequence if name in self._recorded else Sequence()

    @property
    def lost(self) -> dict[str, int]:
        """Messages that never arrived, by topic."""
        return {name: recorded.sequence.lost for name, recorded in self._recorded.items()}

    def _report(self) -> None:
        """Publish what is recorded, waiting, lost and dropped."""
        spool, bag = self._spool, self._spool.bag
        if not self._changed.is_set():
            for recorded in self._recorded.values():
                recorded.sequence.settle_unchanged()
        status = DiagnosticStatus(
            name='recorder: bag',
            hardware_id=str(bag.path),
            level=DiagnosticStatus.OK,
            message='recording',
        )
        if spool.error or spool.dropped:
            status.level = DiagnosticStatus.ERROR
            status.message = f'cannot write: {spool.error}' if spool.error else 'messages dropped'
        elif any(self.lost.values()):
            status.level = DiagnosticStatus.WARN
            status.message = f'{sum(self.lost.values())} messages lost on the way'
        elif self._refused:
            status.level = DiagnosticStatus.WARN
            status.message = 'topics refused'
        values = {
            'Size (B)': bag.size,
            'Messages waiting': spool.waiting,
            'Messages dropped': spool.dropped,
            'Free disk (B)': free_bytes(bag.path),
            'Topics refused': ' '.join(sorted(self._refused)),
            'Messages': sum(bag.counts.values()),
            'Topics': len(self._recorded),
            **{f'Messages on {name}': count for name, count in _first(bag.counts)},
            **{f'Messages lost on {name}': count for name, count in self.lost.items() if count},
        }
        status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)


def _first(counts: dict[str, int]) -> list[tuple[str, int]]:
    """Return the counts of the first topics: a thousand pairs a second cost a core its share."""
    return list(counts.items())[:MOST_SHOWN]


def free_bytes(path: Path) -> int:
    """Return the free space of the disk of a bag, -1 where it cannot be told."""
    try:
        return shutil.disk_usage(path.parent).free
    except OSError:
        return -1
