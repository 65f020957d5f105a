# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compiled loops over the bytes of a chunk: find the messages, gather their fields."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.arrays import Places
from damadics_fd.bag.mcap.records import Op
from damadics_fd.core.jit import jit

SCHEMA, CHANNEL, MESSAGE = int(Op.SCHEMA), int(Op.CHANNEL), int(Op.MESSAGE)
HEAD = 9  # [B] opcode and length of a record
CHANNEL_AT = 9  # [B] places in a Message record: u2 channel
BODY_AT = 31  # [B] its data
LOG_TIME = -16  # [B] its log time, counted from the data
BESIDES = 22  # [B] in its length besides the data
PLAIN_CDR = 0x0100  # the first two bytes of a message in plain CDR, little endian
BILLION = 1_000_000_000
TOGETHER = 64  # messages of which the fields are copied at once
WIDER = [np.dtype(f'<u{size}') for size in (2, 4, 8)]
SHORTEST = 64  # [B] so that views of words have several elements, which numba tells from one


class Words(NamedTuple):
    """
    Little-endian words of a chunk; `w8[i]` starts at byte `i`, whatever its alignment.

    Reading a word this way is one instruction in compiled code, and works in numpy, too.
    """

    w1: NDArray[np.uint8]
    w2: NDArray[np.uint16]
    w4: NDArray[np.uint32]
    w8: NDArray[np.uint64]


def words(data: NDArray[np.uint8]) -> Words:
    """
    View a chunk as words at any byte.

    :param data: contiguous, writable bytes (numba compiles read-only ones apart).

    >>> hex(words(np.arange(100, dtype=np.uint8)).w4[1])
    '0x4030201'
    """
    if len(data) < SHORTEST:
        data = np.concatenate([data, np.zeros(SHORTEST, np.uint8)])
    places = len(data) + 1
    wide = [np.ndarray((places - kind.itemsize,), kind, data, 0, (1,)) for kind in WIDER]
    return Words(data, *wide)


@jit
def index(
    words: Words,
    end: int,
    channels: NDArray[np.uint16],
    starts: Places,
    sizes: Places,
    others: Places,
) -> tuple[int, int, int]:
    """
    Walk the records of a chunk by their heads.

    :param words: the chunk.
    :param end: its size [B].
    :param channels: written: channel of each message.
    :param starts: written: place of the data of each message.
    :param sizes: written: size of the data of each message.
    :param others: written: places of the Schema and Channel records.
    :return: numbers of messages and of other records, and the place where the walk ended; what
        follows it is no whole record.
    """
    at = n = k = 0
    while at + HEAD <= end:
        length = words.w8[at + 1]
        if length > np.uint64(end - at - HEAD):
            break
        op = words.w1[at]
        if op == MESSAGE:
            if length < np.uint64(BESIDES):
                break
            channels[n] = words.w2[at + CHANNEL_AT]
            starts[n] = at + BODY_AT
            sizes[n] = int(np.int64(length)) - BESIDES
            n += 1
        elif op in (SCHEMA, CHANNEL):
            if k == len(others):
                break
            others[k] = at
            k += 1
        at += HEAD + int(np.int64(length))
    return n, k, at


@jit
def decode(
    words: Words,
    end: int,
    channel: int,
    size: int,
    places: NDArray[np.uint64],
    values: NDArray[np.uint32],
    offsets: NDArray[np.uint64],
    times: NDArray[np.uint64],
    out: NDArray[np.uint64],
    first: int,
) -> int:
    """
    Copy 64-bit fields and times of one channel's messages to columns, where all are alike.

    :param words: the chunk.
    :param end: its size [B].
    :param channel: number of the channel.
    :param size: size of each message [B].
    :param places: places in a Message record of the words that must be as expected, uint64.
    :param values: these words.
    :param offsets: places of the 64-bit fields in a record, k of them, uint64.
    :param times: places of the fields of builtin_interfaces/Time, m of them, uint64.
    :param out: written from column `first` on, (k + m, most) uint64; times in ns.
    :param first: column of the first message.
    :return: number of messages, -1 where anything is else than expected.
    """
    # unsigned throughout: of a signed place numba asks each time whether it counts from the end
    at, stop, head, one = np.uint64(0), np.uint64(end), np.uint64(HEAD), np.uint64(1)
    n, room, whole = np.uint64(first), np.uint64(out.shape[1]), np.uint64(size + BESIDES)
    checks, fields, stamps = np.uint64(len(places)), np.uint64(len(offsets)), np.uint64(len(times))
    begins, most = np.empty(TOGETHER, np.uint64), np.uint64(TOGETHER)
    while at + head <= stop:
        found = np.uint64(0)
        while found < most and at + head <= stop:  # find some messages
            length = words.w8[at + one]
            if words.w1[at] != MESSAGE or length > stop - at - head or length < np.uint64(BESIDES):
                return -1
            if words.w2[at + np.uint64(CHANNEL_AT)] == channel:
                if length != whole or n + found == room:
                    return -1
                same = words.w2[at + np.uint64(BODY_AT)] == PLAIN_CDR
                for j in range(checks):
                    same = same and words.w4[at + places[j]] == values[j]
                if not same:
                    return -1
                begins[found] = at
                found += one
            at += head + length
        for j in range(fields):  # field by field: half the time of message by message
            for k in range(found):
                out[j, n + k] = words.w8[begins[k] + offsets[j]]
        for j in range(stamps):
            for k in range(found):
                place = begins[k] + times[j]
                second = np.int64(np.int32(words.w4[place]))
                nanosecond = np.int64(words.w4[place + np.uint64(4)])
                out[fields + j, n + k] = second * BILLION + nanosecond
        n += found
    return int(np.int64(n)) - first if at == stop else -1


@jit
def messages_end(words: Words, end: int) -> int:
    """
    Return where a run of whole Message records ends.

    :param words: records, a message first.
    :param end: their size [B].
    """
    at = 0
    while at + HEAD <= end:
        length = words.w8[at + 1]
        if words.w1[at] != MESSAGE or length < np.uint64(BESIDES):
            break
        if length > np.uint64(end - at - HEAD):
            break
        at += HEAD + int(np.int64(length))
    return at


def warm_up() -> None:
    """Compile the loops, or load them from the cache."""
    data, none = words(np.zeros(SHORTEST, np.uint8)), np.empty(0, np.int64)
    messages_end(data, 0)
    index(data, 0, np.empty(0, np.uint16), none, none, none)
    wide, values = np.empty(0, np.uint64), np.empty(0, np.uint32)
    decode(data, 0, 0, 0, wide, values, wide, wide, np.empty((1, 2), np.uint64), 0)
