# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The channels of one file of a bag."""

from damadics_fd.bag.cdr.definition import schema_text
from damadics_fd.bag.mcap.writer import McapWriter
from damadics_fd.bag.rosbag2 import Topic, qos_text


class Channels:
    """
    Declare topics in a file when they are first used, as rosbag2 does.

    :param mcap: the file.
    """

    def __init__(self, mcap: McapWriter):
        self._mcap = mcap
        self._numbers: dict[str, int] = {}
        self._schemas: dict[str, int] = {}

    def of(self, topic: Topic) -> int:
        """Return the channel of a topic."""
        number = self._numbers.get(topic.name)
        if number is None:
            if topic.type not in self._schemas:
                text = schema_text(topic.type).encode()
                self._schemas[topic.type] = self._mcap.add_schema(topic.type, 'ros2msg', text)
            metadata = {
                'offered_qos_profiles': qos_text(topic.offered_qos),
                'topic_type_hash': topic.type_hash,
            }
            schema = self._schemas[topic.type]
            number = self._mcap.add_channel(schema, topic.name, 'cdr', metadata)
            self._numbers[topic.name] = number
        return number
