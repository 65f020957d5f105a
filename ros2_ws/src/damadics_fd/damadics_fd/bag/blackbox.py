# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The black box: the last seconds in memory, written when a fault is flagged."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from damadics_fd.bag.cdr.definition import parse_definition, schema_text
from damadics_fd.bag.cdr.layout import layout_of
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.rosbag2 import QosProfile, Topic
from damadics_fd.bag.writer import NANO, BagWriter

FLAG = 'damadics_msgs/msg/FaultFlag'
MOST_BYTES = 1 << 29  # held in memory, whatever the seconds
MOST_EVENTS = 8  # written at the same time


@dataclass
class Event:
    """A bag that is being written."""

    bag: BagWriter
    end: int  # [ns] log time


class BlackBox:
    """
    Hold the last messages of all topics; write a bag from before until after each fault.

    It stands where a `BagWriter` stands. A fault is the rise of `fault` in any `FaultFlag`.

    :param path: directory in which each event gets its bag `event_000`, `event_001`, ...
    :param before: seconds before the flag that are kept.
    :param after: seconds after the flag that are added.
    :raises BagError: where the directory cannot be made.
    """

    def __init__(self, path: str | Path, before: float, after: float):
        self.path = Path(path)
        self._before, self._after = int(before * NANO), int(after * NANO)
        self._ring: deque[tuple[Topic, bytes, int, int]] = deque()
        self._bytes = 0
        self._topics: dict[str, Topic] = {}
        self._faults: dict[str, bool] = {}
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
        """Take one message."""
        self._ring.append((topic, data, log_time, publish_time))
        self._bytes += len(data)
        while self._ring[0][2] < log_time - self._before or self._bytes > MOST_BYTES:
            self._bytes -= len(self._ring.popleft()[1])
        for event in self._active:
            event.bag.write(_declared(event.bag, topic), data, log_time, publish_time)
        if self._active and log_time >= self._active[0].end:
            self._finish(self._active.pop(0))
        if topic.type == FLAG and self._rises(topic, data) and len(self._active) < MOST_EVENTS:
            self._begin(topic, log_time)

    def _rises(self, topic: Topic, data: bytes) -> bool:
        definition = parse_definition(FLAG, schema_text(FLAG))
        layout = layout_of(definition, FLAG, data)
        fault = bool(data[next(p.offset for p in layout.places if p.name == 'fault')])
        before = self._faults.get(topic.name, False)
        self._faults[topic.name] = fault
        return fault and not before

    def _begin(self, flag: Topic, log_time: int) -> None:
        while (path := self.path / f'event_{self._number:03d}').exists():
            self._number += 1
        bag = BagWriter(path, custom_data={'flag': flag.name, 'flagged_at_ns': str(log_time)})
        for topic in self._topics.values():
            _declared(bag, topic)
        for topic, data, logged, published in self._ring:
            bag.write(_declared(bag, topic), data, logged, published)
        self._active.append(Event(bag, log_time + self._after))

    def _finish(self, event: Event) -> None:
        event.bag.close()
        self._size += event.bag.size
        for name, count in event.bag.counts.items():
            self._written[name] = self._written.get(name, 0) + count

    def flush(self) -> None:
        """Hand all messages of open bags to the operating system."""
        for event in self._active:
            event.bag.flush()

    def flush_if_due(self) -> None:
        """Flush open bags whose oldest message waits too long."""
        for event in self._active:
            event.bag.flush_if_due()

    def drop_oldest(self) -> bool:
        """Tell that nothing can be removed: bags of faults are kept."""
        return False

    @property
    def size(self) -> int:
        """Bytes in all bags."""
        return self._size + sum(event.bag.size for event in self._active)

    @property
    def counts(self) -> dict[str, int]:
        """Messages in all bags, by topic."""
        counts = dict.fromkeys(self._topics, 0) | self._written
        for event in self._active:
            for name, count in event.bag.counts.items():
                counts[name] = counts.get(name, 0) + count
        return counts

    def close(self) -> None:
        """Finish the bags that are open."""
        while self._active:
            self._finish(self._active.pop(0))


def _declared(bag: BagWriter, topic: Topic) -> Topic:
    return bag.add_topic(topic.name, topic.type, topic.offered_qos, topic.type_hash)
