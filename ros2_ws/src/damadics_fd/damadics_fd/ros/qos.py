# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The qualities of service of the public topics; see docs/architecture.md."""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

HELD = 100_000  # samples: a process may be held up; memory is taken only when needed
SAMPLES = QoSProfile(  # of a topic that carries samples
    history=HistoryPolicy.KEEP_LAST,
    depth=HELD,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)

BLOCKS = QoSProfile(  # of a topic that carries samples of many valves
    history=HistoryPolicy.KEEP_LAST,
    depth=2000,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)


def latched(depth: int) -> QoSProfile:
    """
    Return the profile of a topic whose last messages a late subscriber gets at once.

    :param depth: number of messages kept for late subscribers.
    :return: the profile.
    """
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )


FLAG = latched(1)
EVENTS = latched(100)
DIAGNOSTICS = QoSProfile(depth=10)
COMMANDS = QoSProfile(depth=10)  # volatile: who comes late moves nothing
