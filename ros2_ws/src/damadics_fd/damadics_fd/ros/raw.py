# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read and write serialised messages without objects in between: most of a sample's cost."""

import struct
from operator import attrgetter

from damadics_msgs.msg import Estimate as EstimateMessage
from damadics_msgs.msg import Measurement
from rclpy.serialization import deserialize_message

from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.sample import SIGNALS, Sample
from damadics_fd.core.stamps import SECOND
from damadics_fd.ros.conversions import read_estimate, sample

HEADER = struct.Struct('<iII')  # sec, nanosec, length of frame_id, behind the encapsulation
STAMP = struct.Struct('<iI')
VALUES = struct.Struct(f'<{len(SIGNALS)}d')
ESTIMATE = struct.Struct(f'<{len(Estimate.names()) - 2}dB')  # all but stamp and phase, the phase
ESTIMATE_VALUES = attrgetter(*Estimate.names())
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
    stamp, values, tag = _fields(data, VALUES, 'measurement')
    return Sample(stamp, *values), tag


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


def any_estimate(data: bytes) -> tuple[Estimate, str]:
    """
    Read a serialised Estimate of any encapsulation.

    :param data: as DDS brings it.
    :return: the estimate, and its frame_id.
    :raises ValueError: where it is not that.
    """
    if data[:2] == LITTLE_ENDIAN:
        stamp, values, tag = _fields(data, ESTIMATE, 'estimate')
        return Estimate(stamp, *values), tag  # type: ignore[arg-type]  # the phase is an integer
    message = deserialize_message(data, EstimateMessage)
    return read_estimate(message), message.header.frame_id


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


class SampleReader:
    """Read serialised Measurements of any encapsulation, faster while their frame_id stays."""

    def __init__(self) -> None:
        self._expect('')

    def __call__(self, data: bytes) -> tuple[Sample, str]:
        """
        Read a message.

        :param data: as DDS brings it.
        :return: the sample, and its frame_id.
        :raises ValueError: where it is not that.
        """
        if len(data) >= self._size:
            order, sec, nanosec, length, text, *values = self._unpack(data)
            if length == self._length and text == self._text and order == LITTLE_ENDIAN:
                return Sample(sec * SECOND + nanosec, *values), self._tag
        found = any_sample(data)
        if found[1] != self._tag:
            self._expect(found[1])
        return found

    def _expect(self, tag: str) -> None:
        self._tag, self._text = tag, tag.encode() + b'\0'
        self._length = len(self._text)
        filled = -(HEADER.size + self._length) % 8
        layout = struct.Struct(f'<2s2xiII{self._length}s{filled}x{VALUES.format[1:]}')
        self._unpack, self._size = layout.unpack_from, layout.size


class Encoder:
    """
    Serialise messages of a header and some numbers.

    :param numbers: format of what follows the header, as of `struct`, the widest first; by
        default the number of a Float64Stamped.
    """

    def __init__(self, numbers: str = 'd') -> None:
        self._numbers = numbers
        self._tag = ''
        self._set('')

    def __call__(self, stamp: int, tag: str, *values: float) -> bytes:
        """
        Serialise a message.

        :param stamp: of its header [ns].
        :param tag: frame_id of its header.
        :param values: the numbers.
        :return: its bytes, in little-endian CDR.
        """
        if tag != self._tag:
            self._set(tag)
        sec, nanosec = divmod(stamp, SECOND)
        return self._pack(LITTLE_ENDIAN, sec, nanosec, self._length, self._text, *values)

    def _set(self, tag: str) -> None:
        """Prepare for the messages of an actuator."""
        self._tag, self._text = tag, tag.encode()
        self._length = len(self._text) + 1
        filled = -(HEADER.size + self._length) % 8
        self._pack = struct.Struct(f'<2s2xiII{self._length}s{filled}x{self._numbers}').pack


class EstimateEncoder(Encoder):
    """Serialise estimates."""

    def __init__(self) -> None:
        super().__init__(ESTIMATE.format[1:])

    def encode(self, estimate: Estimate, tag: str) -> bytes:
        """
        Serialise an estimate.

        :param estimate: of a sample.
        :param tag: of the actuator.
        :return: its message.
        """
        stamp, *values = ESTIMATE_VALUES(estimate)
        return self(stamp, tag, *values)


def _fields(data: bytes, numbers: struct.Struct, what: str) -> tuple[int, tuple[float, ...], str]:
    """Read stamp, numbers and tag of a message in little-endian CDR."""
    if data[:2] != LITTLE_ENDIAN:
        raise ValueError(f'the {what} is not in little-endian CDR')
    try:
        sec, nanosec, length = HEADER.unpack_from(data, START)
        at = HEADER.size + length
        values = numbers.unpack_from(data, START + at + -at % 8)
    except struct.error as problem:
        raise ValueError(f'the {what} is cut off: {problem}') from problem
    tag = data[START + HEADER.size : START + at - 1].decode(errors='replace')
    return sec * SECOND + nanosec, values, tag
