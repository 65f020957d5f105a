# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read serialised messages without making messages of them: most of what a sample costs."""

import struct

from damadics_msgs.msg import Measurement
from rclpy.serialization import deserialize_message

from damadics_fd.core.sample import SIGNALS, Sample
from damadics_fd.core.stamps import SECOND
from damadics_fd.ros.conversions import sample

HEADER = struct.Struct('<iII')  # sec, nanosec, length of frame_id, behind the encapsulation
STAMP = struct.Struct('<iI')
VALUES = struct.Struct(f'<{len(SIGNALS)}d')
LITTLE_ENDIAN = b'\x00\x01'  # the encapsulation of nearly every machine
START = 4  # behind the encapsulation


def sample_of(data: bytes) -> Sample:
    """
    Read a serialised Measurement.

    :param data: as DDS brings it.
    :return: the sample.
    :raises ValueError: where it is not that.
    """
    return tagged_sample(data)[0]


def tagged_sample(data: bytes) -> tuple[Sample, str]:
    """
    Read a serialised Measurement and whose it is.

    :param data: as DDS brings it.
    :return: the sample, and its frame_id.
    :raises ValueError: where it is not that.
    """
    if data[:2] != LITTLE_ENDIAN:
        raise ValueError('the measurement is not in little-endian CDR')
    try:
        sec, nanosec, length = HEADER.unpack_from(data, START)
        at = HEADER.size + length
        values = VALUES.unpack_from(data, START + at + -at % 8)
    except struct.error as problem:
        raise ValueError(f'the measurement is cut off: {problem}') from problem
    tag = data[START + HEADER.size : START + at - 1].decode(errors='replace')
    return Sample(sec * SECOND + nanosec, *values), tag


def any_sample(data: bytes) -> tuple[Sample, str]:
    """
    Read a serialised Measurement of any encapsulation.

    :param data: as DDS brings it.
    :return: the sample, and its frame_id.
    :raises ValueError: where it is not that.
    """
    if data[:2] == LITTLE_ENDIAN:
        return tagged_sample(data)
    message = deserialize_message(data, Measurement)
    return sample(message), message.header.frame_id


def stamp_of(data: bytes) -> int | None:
    """
    Read the stamp of a serialised message that begins with a header.

    :param data: as DDS brings it.
    :return: the stamp [ns]; None where the encapsulation is another or the message too short.
    """
    if data[:2] != LITTLE_ENDIAN or len(data) < START + STAMP.size:
        return None
    sec, nanosec = STAMP.unpack_from(data, START)
    return int(sec) * SECOND + int(nanosec)
