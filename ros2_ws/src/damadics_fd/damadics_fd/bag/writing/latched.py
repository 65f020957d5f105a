# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The last latched messages of each topic, which every new file of a recording begins with."""

from collections import deque
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from damadics_fd.bag.rosbag2 import QosProfile, Topic

MOST_MESSAGES = 100  # of one topic
MOST_BYTES = 1 << 24  # of one topic


class Kept(NamedTuple):
    """A message and when it was logged and published [ns]."""

    topic: Topic
    data: bytes
    log_time: int
    publish_time: int


class Latched:
    """
    Keep the last messages of topics whose publishers all offer them to late subscribers.

    As many as the publishers keep, within bounds.
    """

    def __init__(self) -> None:
        self._depths: dict[str, tuple[Sequence[QosProfile], int]] = {}
        self._kept: dict[str, deque[Kept]] = {}

    def keep(self, message: Kept) -> None:
        """Take note of a message."""
        topic = message.topic
        offered, depth = self._depths.get(topic.name, ((), -1))
        if depth < 0 or offered is not topic.offered_qos:
            depth = _depth(topic.offered_qos)
            self._depths[topic.name] = topic.offered_qos, depth
        if not depth:
            return
        kept = self._kept.setdefault(topic.name, deque())
        kept.append(message)
        while len(kept) > depth or sum(len(other.data) for other in kept) > MOST_BYTES:
            kept.popleft()

    def before(self, log_time: int) -> Iterator[Kept]:
        """Yield what was logged before an instant [ns], in order."""
        found = [message for kept in self._kept.values() for message in kept]
        for message in sorted(found, key=lambda entry: entry.log_time):
            if message.log_time < log_time:
                yield message


def _depth(offered: Sequence[QosProfile]) -> int:
    """Return how many messages of a topic a late subscriber gets, 0 where it is not latched."""
    if not offered or any(
        str(p.get('durability')) not in ('transient_local', '1') for p in offered
    ):
        return 0
    depths = [depth for p in offered if isinstance(depth := p.get('depth'), int)]
    return max(1, min(sum(depths) or 1, MOST_MESSAGES))
