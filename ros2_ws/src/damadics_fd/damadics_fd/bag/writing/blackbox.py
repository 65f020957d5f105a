# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The black box: the last seconds in memory, written when a fault is flagged."""

import shutil
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.cdr.definition import Definition, parse_definition, schema_text
from damadics_fd.bag.cdr.layout import layout_of
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.rosbag2 import QosProfile, Topic
from damadics_fd.bag.writing.bag_writer import NANO, BagWriter
from damadics_fd.bag.writing.latched import Kept, Latched

FLAG, STATUS = 'damadics_msgs/msg/FaultFlag', 'damadics_msgs/msg/FleetStatus'
FAULTY = (FLAG, STATUS)  # types that tell of faults
MOST_BYTES = 1 << 29  # held in memory, whatever the seconds
MOST_EVENTS = 8  # written at the same time


@dataclass
class Event:
    """
    What surrounds a fault.

    :param flag: name of the topic that flagged it.
    :param at: log time of the flag [ns].
    :param end: log time of the last message that belongs to it [ns].
    :param waiting: messages not yet in the bag.
    :param bag: the bag, None as long as the disk does not take one.
    :param over: its last message has come.
    """

    flag: str
    at: int
    end: int
    waiting: deque[Kept] = field(default_factory=deque)
    bag: BagWriter | None = None
    over: bool = False


class BlackBox:
    """
    Hold the last messages of all topics; write a bag from before until after each fault.

    It stands where a `BagWriter` stands. A fault is the rise of `fault` in any `FaultFlag`, or of
    any valve in a `FleetStatus`. Its
    messages wait in memory while the disk is full, and an `OSError` is retried by `flush`.
    Latched messages from before stand at the head of each bag.

    :param path: directory in which each event gets its bag `event_000`, `event_001`, ...
    :param before: seconds before the flag that are kept.
    :param after: seconds after the flag that are added.
    :raises BagError: where the directory cannot be made.
    """

    def __init__(self, path: str | Path, before: float, after: float):
        self.path = Path(path)
        self.missed = 0  # faults beyond those that can be written at the same time
        self._before, self._after = int(before * NANO), int(after * NANO)
        self._ring: deque[Kept] = deque()
        self._bytes = 0
        self._latched = Latched()
        self._topics: dict[str, Topic] = {}
        self._faults: dict[str, frozenset[int]] = {}  # valves, by the topic that tells of them
        self._active: list[Event] = []
        self._written: dict[str, int] = {}
        self._size = 0
        self._number = 0
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise BagError(f'cannot be created: {error.strerror}', path) from error

    def add_topic(
        self, name: str, kind: str, offered_qos: Sequence[QosProfile] = (), hash_: str = ''
    ) -> Topic:
        """Declare a topic; a second declaration returns the first."""
        if name not in self._topics:
            schema_text(kind)
            self._topics[name] = Topic(name, kind, list(offered_qos), hash_)
        return self._topics[name]

    def write(self, topic: Topic, data: bytes, log_time: int, publish_time: int) -> None:
        """Take one message; what a full disk does not take waits in memory."""
        message = Kept(topic, data, log_time, publish_time)
        self._ring.append(message)
        self._bytes += len(data)
        while self._ring[0].log_time < log_time - self._before or self._bytes > MOST_BYTES:
            self._bytes -= len(self._ring[0].data)
            self._latched.keep(self._ring.popleft())
        for event in self._active:
            if not event.over:
                event.waiting.append(message)
                event.over = log_time >= event.end
        if topic.type in FAULTY and self._rises(topic, data):
            self._begin(topic, log_time)
        self._drain()

    def _rises(self, topic: Topic, data: bytes) -> bool:
        """Tell whether a valve has a fault that had none before."""
        faulty = _faulty(topic.type, data)
        before = self._faults.get(topic.name, frozenset())
        self._faults[topic.name] = faulty
        return not faulty <= before

    def _begin(self, flag: Topic, log_time: int) -> None:
        """Note a fault before anything is tried that may fail."""
        if len(self._active) >= MOST_EVENTS:
            self.missed += 1
            return
        first = self._ring[0].log_time
        event = Event(flag.name, log_time, log_time + self._after)
        event.waiting += [kept._replace(log_time=first) for kept in self._latched.before(first)]
        event.waiting += self._ring
        self._active.append(event)

    def _drain(self) -> None:
        """Write what waits and close what is over."""
        for event in list(self._active):
            event.bag = event.bag or self._open(event)
            while event.waiting:
                message = event.waiting.popleft()
                topic = message.topic
                event.bag.write(_declared(event.bag, topic), *message[1:])
            if event.over:
                self._finish(event)

    def _open(self, event: Event) -> BagWriter:
        while (path := self.path / f'event_{self._number:03d}').exists():
            self._number += 1
        about = {'flag': event.flag, 'flagged_at_ns': str(event.at)}
        try:
            bag = BagWriter(path, custom_data=about)
        except (OSError, BagError):
            shutil.rmtree(path, ignore_errors=True)  # made just now, and empty
            raise
        for topic in self._topics.values():
            _declared(bag, topic)
        return bag

    def _finish(self, event: Event) -> None:
        if event.bag:
            event.bag.close()
            self._size += event.bag.size
            for name, count in event.bag.counts.items():
                self._written[name] = self._written.get(name, 0) + count
        self._active.remove(event)

    def flush(self) -> None:
        """Hand all messages of open bags to the operating system."""
        self._drain()
        for event in self._active:
            if event.bag:
                event.bag.flush()

    def flush_if_due(self) -> None:
        """Flush open bags whose oldest message waits too long."""
        for event in self._active:
            if event.bag:
                event.bag.flush_if_due()

    def drop_oldest(self) -> bool:
        """Tell that nothing can be removed: bags of faults are kept."""
        return False

    @property
    def unsaved(self) -> int:
        """Messages of faults that are in memory only."""
        return sum(
            len(event.waiting) + (event.bag.unsaved if event.bag else 0) for event in self._active
        )

    def abandon(self) -> None:
        """Let go of bags that cannot be finished; their whole chunks stay readable."""
        for event in self._active:
            if event.bag:
                event.bag.abandon()

    @property
    def size(self) -> int:
        """Bytes in all bags."""
        return self._size + sum(event.bag.size for event in self._active if event.bag)

    @property
    def counts(self) -> dict[str, int]:
        """Messages in all bags, by topic."""
        counts = dict.fromkeys(self._topics, 0) | self._written
        for event in self._active:
            for name, count in event.bag.counts.items() if event.bag else ():
                counts[name] = counts.get(name, 0) + count
        return counts

    def close(self) -> None:
        """Finish the bags that are open."""
        self._drain()
        for event in list(self._active):
            self._finish(event)


def _faulty(kind: str, data: bytes) -> frozenset[int]:
    """Return the valves that a message says have a fault: 0 of one valve, numbers of a fleet."""
    layout = layout_of(_up_to_fault(kind), kind, data)
    fields = {place.name: place for place in layout.places}

    def column(name: str) -> NDArray[np.int64]:
        place = fields[name]
        number = np.dtype(layout.order + place.dtype)
        count = 1 if place.repeat is None else place.repeat
        return np.frombuffer(data, number, count, place.offset).astype(np.int64)

    fault = column('fault') != 0
    if kind == FLAG:
        return frozenset(np.flatnonzero(fault).tolist())
    valve = column('valve')
    known = valve[: len(fault)][fault[: len(valve)]]
    return frozenset((known + (int(column('layout')[0]) << 32)).tolist())  # a new list is news


@cache
def _up_to_fault(kind: str) -> Definition:
    """Return the definition without what follows the faults, of which a fleet has much."""
    definition = dict(parse_definition(kind, schema_text(kind)))
    names = [member.name for member in definition[kind]]
    definition[kind] = definition[kind][: names.index('fault') + 1]
    return definition


def _declared(bag: BagWriter, topic: Topic) -> Topic:
    return bag.add_topic(topic.name, topic.type, topic.offered_qos, topic.type_hash)
