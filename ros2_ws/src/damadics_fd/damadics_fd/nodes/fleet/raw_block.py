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
MOST_KEPT = 10_000_000  # bytes of a message whose memory is kept
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
    return _columns_of(body, [])


class BlockReader:
    """
    Read serialised blocks, faster while their form stays: sender, layout and lengths.

    Such blocks are copied into the same memory, so what was returned before is then overwritten.
    """

    def __init__(self) -> None:
        self._size = self._before = -1

    def __call__(self, data: bytes) -> RawBlock:
        """
        Read a serialised block.

        :param data: as DDS brings it.
        :return: its columns, as of `read_block`, valid until the next call.
        :raises ValueError: where it is no such message.
        """
        size = len(data)
        if size == self._size and self._form_of(data) == self._form:
            self._body[:] = memoryview(data)[START:]
            return self._block
        if size == self._before and size < MOST_KEPT and data[:2] == LITTLE_ENDIAN:
            self._keep(data)
            return self._block
        self._before = size
        return read_block(data)

    def _keep(self, data: bytes) -> None:
        """Read a block, and keep its form and its memory for those that follow."""
        self._size = -1
        body = np.frombuffer(data, np.uint8, offset=START).copy()
        counts: list[int] = []
        self._block = _columns_of(body, counts)
        form, behind = f'<2s2x{STAMP}x{counts[0] + NUMBER.size - STAMP}s', counts[0] + NUMBER.size
        for at in counts[1:]:
            form += f'{at - behind}x{NUMBER.size}s'
            behind = at + NUMBER.size
        self._form_of = struct.Struct(form).unpack_from
        self._form, self._body, self._size = self._form_of(data), body.data, len(data)


def _columns_of(body: NDArray[np.uint8], counts: list[int]) -> RawBlock:
    """Return the columns of a message as views of it; add where their lengths stand."""
    try:
        length = NUMBER.unpack_from(body.data, STAMP)[0]
        begin = STAMP + NUMBER.size
        sender = body[begin : begin + length].tobytes().rstrip(b'\0').decode(errors='replace')
        at = _aligned(begin + length, NUMBER.size)
        layout = NUMBER.unpack_from(body.data, at)[0]
        valve, at = _column(body, at + NUMBER.size, np.uint32, counts)
        stamp, at = _column(body, at, np.int64, counts)
        signals: dict[str, Floats] = {}
        for name in SIGNALS:
            signals[name], at = _column(body, at, np.float64, counts)
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


def _column(
    body: NDArray[np.uint8], at: int, kind: type[Number], counts: list[int]
) -> tuple[NDArray[Number], int]:
    """Return an array that lies behind its length, and where what follows begins."""
    at = _aligned(at, NUMBER.size)
    counts.append(at)
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
