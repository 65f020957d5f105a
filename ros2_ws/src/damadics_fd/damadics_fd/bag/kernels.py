# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compiled loops over the bytes of a chunk: find the messages, gather their fields."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.records import Op
from damadics_fd.core.jit import jit

SCHEMA, CHANNEL, MESSAGE = int(Op.SCHEMA), int(Op.CHANNEL), int(Op.MESSAGE)
HEAD = 9  # [B] opcode and length of a record
MESSAGE_HEAD = 31  # [B] of a Message record before its data


@jit
def word2(data: NDArray, at: int) -> Any:
    """Return the little-endian u16 at a place."""
    return np.uint16(data[at]) | np.uint16(np.uint16(data[at + 1]) << np.uint16(8))


@jit
def word4(data: NDArray, at: int) -> Any:
    """Return the little-endian u32 at a place; compiles to one load."""
    return (
        np.uint32(data[at]) | np.uint32(data[at + 1]) << np.uint32(8)
        | np.uint32(data[at + 2]) << np.uint32(16) | np.uint32(data[at + 3]) << np.uint32(24)
    )


@jit
def word8(data: NDArray, at: int) -> Any:
    """Return the little-endian u64 at a place; compiles to one load."""
    low, high = np.uint64(word4(data, at)), np.uint64(word4(data, at + 4))
    return low | high << np.uint64(32)


@jit
def index(
    data: NDArray, channels: NDArray, starts: NDArray, sizes: NDArray, others: NDArray
) -> tuple[int, int, int]:
    """
    Walk the records of a chunk by their heads.

    :param data: records, uint8.
    :param channels: written: channel of each message.
    :param starts: written: place of the data of each message.
    :param sizes: written: size of the data of each message.
    :param others: written: places of the Schema and Channel records.
    :return: numbers of messages and of other records, and the place where the walk ended; what
        follows it is no whole record.
    """
    at = n = k = 0
    while at + HEAD <= len(data):
        length = word8(data, at + 1)
        if length > np.uint64(len(data) - at - HEAD):
            break
        op = data[at]
        if op == MESSAGE:
            if length < 22:
                break
            channels[n] = word2(data, at + HEAD)
            starts[n] = at + MESSAGE_HEAD
            sizes[n] = np.int64(length) - 22
            n += 1
        elif op in (SCHEMA, CHANNEL):
            if k == len(others):
                break
            others[k] = at
            k += 1
        at += HEAD + int(length)
    return n, k, at


@jit
def gather2(data: NDArray, starts: NDArray, offset: int, out: NDArray) -> None:
    """Copy one 16-bit field of each message; `out` is (n,) uint16."""
    for i in range(len(starts)):
        out[i] = word2(data, starts[i] + offset)


@jit
def gather4(data: NDArray, starts: NDArray, offset: int, out: NDArray) -> None:
    """Copy one 32-bit field of each message; `out` is (n,) uint32."""
    for i in range(len(starts)):
        out[i] = word4(data, starts[i] + offset)


@jit
def gather8(data: NDArray, starts: NDArray, offsets: NDArray, out: NDArray, first: int) -> None:
    """Copy k 64-bit fields of n messages to columns `first`.. of `out`, uint64 with k rows."""
    for i in range(len(starts)):
        for j in range(len(offsets)):
            out[j, first + i] = word8(data, starts[i] + offsets[j])


@jit
def select(channels: NDArray, starts: NDArray, sizes: NDArray, channel: int) -> tuple[int, int]:
    """
    Move the places of one channel's messages to the front of `starts`.

    :return: number of messages, and their size, -1 where they differ.
    """
    n = 0
    size = 0
    for i in range(len(starts)):
        if channels[i] == channel:
            size = sizes[i] if n == 0 or sizes[i] == size else -1
            starts[n] = starts[i]
            n += 1
    return n, size


@jit
def gather_stamp(data: NDArray, starts: NDArray, offset: int, out: NDArray, first: int) -> None:
    """Copy a little-endian builtin_interfaces/Time of n messages to `out` from `first` on [ns]."""
    for i in range(len(starts)):
        seconds = np.int64(np.int32(word4(data, starts[i] + offset)))
        out[first + i] = seconds * 1_000_000_000 + np.int64(word4(data, starts[i] + offset + 4))


@jit
def same_layout(
    data: NDArray, starts: NDArray, order: int, offsets: NDArray, values: NDArray, out: NDArray
) -> None:
    """
    Tell which messages have the CDR header and the length words of a layout.

    :param data: records, uint8.
    :param starts: places of the messages.
    :param order: 1 little endian, 0 big endian.
    :param offsets: places of the length words in a message.
    :param values: their values, as read little endian.
    :param out: written, bool.
    """
    for i in range(len(starts)):
        at = starts[i]
        same = data[at] == 0 and data[at + 1] == order
        for j in range(len(offsets)):
            same = same and word4(data, at + offsets[j]) == values[j]
        out[i] = same


def warm_up() -> None:
    """Compile the loops, or load them from the cache."""
    data = np.frombuffer(bytes(64), np.uint8)
    starts, words = np.zeros(1, np.int64), np.zeros(1, np.int64)
    index(data, np.empty(3, np.uint16), np.empty(3, np.int64), np.empty(3, np.int64), starts)
    gather2(data, starts, 0, np.empty(1, np.uint16))
    gather4(data, starts, 0, np.empty(1, np.uint32))
    gather8(data, starts, words, np.empty((1, 1), np.uint64), 0)
    gather_stamp(data, starts, 0, np.empty(1, np.int64), 0)
    select(np.empty(0, np.uint16), starts[:0], starts[:0], 0)
    same_layout(data, starts, 1, words, np.zeros(1, np.uint32), np.empty(1, bool))
