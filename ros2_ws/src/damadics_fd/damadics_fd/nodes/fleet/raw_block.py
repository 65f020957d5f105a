# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read serialised blocks of measurements: one copy, and views of it as columns."""

import struct
from typing import NamedTuple, TypeVar

import numpy as np
from damadics_msgs.msg import MeasurementBlock
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message

from damadics_fd.core.record import Floats, Ints
from damadics_fd.core.sample import SIGNALS
from damadics_fd.core.text import NAME, plain
from damadics_fd.ros.raw import LITTLE_ENDIAN, START

NUMBER = struct.Struct('<I')
STAMP = 8  # bytes of the header's stamp
Number = TypeVar('Number', bound=np.generic)


class RawBlock(NamedTuple):
    """Hold the fields of a MeasurementBlock, lengths unchecked."""

    sender: str
    layout: int
    valve: NDArray[np.uint32]
    stamp: Ints
    signals: dict[str, Floats]  # all; empty where not measured


def read_block(data: bytes) -> RawBlock:
    """
    Read a serialised block.

    :param data: as DDS brings it.
    :return: its columns; nothing but the message's own lengths was checked.
    :raises ValueError: where it is no such message.
    """
    if data[:2] != LITTLE_ENDIAN:
        return _read_message(data)
    body = np.frombuffer(data, np.uint8, offset=min(START, len(data))).copy()  # now aligned
    try:
        length = NUMBER.unpack_from(body.data, STAMP)[0]
        begin = STAMP + NUMBER.size
        sender = body[begin : begin + length].tobytes().rstrip(b'\0').decode(errors='replace')
        at = _aligned(begin + length, NUMBER.size)
        layout = NUMBER.unpack_from(body.data, at)[0]
        valve, at = _column(body, at + NUMBER.size, np.uint32)
        stamp, at = _column(body, at, np.int64)
        signals: dict[str, Floats] = {}
        for name in SIGNALS:
            signals[name], at = _column(body, at, np.float64)
    except struct.error as problem:
        raise ValueError('the message ends too early') from problem
    return RawBlock(plain(sender, NAME), int(layout), valve, stamp, signals)


def block_of(message: MeasurementBlock) -> RawBlock:
    """
    Return the columns of a message.

    :param message: the block.
    :return: its columns.
    """
    return RawBlock(
        plain(message.header.frame_id, NAME),
        message.layout,
        np.asarray(message.valve, np.uint32),
        np.asarray(message.stamp, np.int64),
        {name: np.asarray(getattr(message, name), np.float64) for name in SIGNALS},
    )


def _read_message(data: bytes) -> RawBlock:
    """Read a block of another encapsulation."""
    try:
        return block_of(deserialize_message(data, MeasurementBlock))
    except RuntimeError as problem:  # as the middleware's are
        raise ValueError(f'no block: {problem}') from problem


def _aligned(at: int, size: int) -> int:
    return -(-at // size) * size


def _column(body: NDArray[np.uint8], at: int, kind: type[Number]) -> tuple[NDArray[Number], int]:
    """Return an array that lies behind its length, and where what follows begins."""
    at = _aligned(at, NUMBER.size)
    count = NUMBER.unpack_from(body.data, at)[0]
    at += NUMBER.size
    if not count:
        return np.empty(0, kind), at
    size = np.dtype(kind).itemsize
    at = _aligned(at, size)
    end = at + count * size
    if end > len(body):
        raise ValueError('the message ends too early')
    return body[at:end].view(kind), end
