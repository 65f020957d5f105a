# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Topics of single valves of a fleet: their measurement in, their flag and events out."""

import struct
from collections.abc import Callable
from typing import NamedTuple

from damadics_msgs.msg import FaultEvent, FaultFlag, Measurement
from rclpy.publisher import Publisher

from damadics_fd.core.sample import SIGNALS, Sample
from damadics_fd.core.stamps import SECOND
from damadics_fd.nodes.fleet.members import Member
from damadics_fd.ros import qos
from damadics_fd.ros.entities import Entities

HEADER = struct.Struct('<iII')  # sec, nanosec, length of frame_id, behind the encapsulation
VALUES = struct.Struct(f'<{len(SIGNALS)}d')
LITTLE_ENDIAN = b'\x00\x01'


class Exposed(NamedTuple):
    """Hold the publishers of one valve."""

    flag: Publisher
    event: Publisher


def sample_of(data: bytes) -> Sample:
    """
    Read a serialised Measurement without making a message of it.

    :param data: as DDS brings it.
    :return: the sample.
    :raises ValueError: where it is not that.
    """
    if data[:2] != LITTLE_ENDIAN:
        raise ValueError('the measurement is not in little-endian CDR')
    try:
        sec, nanosec, length = HEADER.unpack_from(data, 4)
        at = HEADER.size + length
        values = VALUES.unpack_from(data, 4 + at + -at % 8)
    except struct.error as problem:
        raise ValueError(f'the measurement is cut off: {problem}') from problem
    return Sample(sec * SECOND + nanosec, *values)


def expose(
    entities: Entities, number: int, member: Member, take: Callable[[int, bytes], None]
) -> Exposed:
    """
    Give a valve topics of its own.

    :param entities: of the fleet's node.
    :param number: of the valve.
    :param member: the valve.
    :param take: called with its number and each serialised measurement.
    :return: its publishers.
    """
    entities.subscription(
        Measurement,
        member.measurement,
        lambda data: take(number, bytes(data)),
        qos.SAMPLES,
        raw=True,
    )
    return Exposed(
        entities.publisher(FaultFlag, f'{member.namespace}/fault_flag', qos.FLAG),
        entities.publisher(FaultEvent, f'{member.namespace}/fault_event', qos.EVENTS),
    )
