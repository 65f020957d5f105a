# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The rows of an SQLite bag as Message records of MCAP, block by block."""

import sqlite3
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.cdr.kernels import (
    BESIDES,
    BODY_AT,
    CHANNEL_AT,
    LOG_TIME,
    SHORTEST,
    Words,
    words,
)
from damadics_fd.bag.compressed import Unpacker
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.mcap.records import Op
from damadics_fd.bag.mcap.unpack import ZSTD_MAGIC

CHUNK = 1 << 19  # [B] of messages handled at a time: they fit the cache
MOST_ROWS = 20_000  # handled at a time
MOST_JOINED = 1 << 24  # [B] of messages that the database may join
GREATEST = (1 << 63) - 1  # id of a row
UNPACKED = 1 << 24  # [B] of compressed messages from which on they are handled
Row = tuple[int, int, int, bytes]  # id, topic, time, data
_ROWS = (
    'SELECT rowid, topic_id, timestamp, data FROM messages WHERE rowid >= ? ORDER BY rowid LIMIT ?'
)
# one value for many rows; between their data stands the room for the head of a record
_JOINED = (
    "SELECT CAST(group_concat(data, ?) AS BLOB), group_concat(timestamp, ' '),"
    " group_concat(topic_id, ' '), group_concat(length(data), ' ')"
    ' FROM messages WHERE rowid BETWEEN ? AND ?'
)
_ZSTD = int.from_bytes(ZSTD_MAGIC, 'little')


class Block(NamedTuple):
    """
    Rows as Message records.

    :param first: id of the first row.
    :param last: id of the last row.
    :param rows: how many they are.
    :param channels: of the messages among them.
    :param records: the messages.
    """

    first: int
    last: int
    rows: int
    channels: NDArray[np.int64]
    records: NDArray[np.uint8]


class Rows:
    """
    Read the rows of a bag.

    :param database: the bag.
    :param numbers: channels by the id of the topic.
    :param unpack: decompresses messages.
    :param longest: message that is read [B].
    :param tell: told what is no message: an id and a text.
    """

    def __init__(
        self,
        database: sqlite3.Connection,
        numbers: Mapping[int, int],
        unpack: Unpacker,
        longest: int,
        tell: Callable[[int, str], None],
    ):
        self._database, self._numbers, self._unpack = database, numbers, unpack
        self._longest, self._tell = longest, tell
        self._buffer = np.empty(0, np.uint8)  # used again: it need not be mapped again
        self._channel_of = np.array(sorted(numbers.items()), np.int64).reshape(-1, 2)
        (last,) = database.execute('SELECT max(rowid) FROM messages').fetchone()
        self._last: int = last if isinstance(last, int) else 0
        (encoding,) = database.execute('PRAGMA encoding').fetchone()
        self._joins = encoding == 'UTF-8'  # others would be translated

    def blocks(self, first: int) -> Iterator[Block]:
        """
        Yield messages block by block from a row id on; each is to be used until the next.

        :raises sqlite3.Error: where the database is damaged.
        """
        count = 1
        while first <= GREATEST:
            size = rows = 0
            try:
                for block in self._read(first, count):
                    yield block
                    first, rows = block.last + 1, rows + block.rows
                    size += len(block.records)
            except sqlite3.Error:
                if count == 1:
                    raise
                count = max(1, count // 8)  # up to the damaged row
                continue
            if not rows:
                return
            count = max(1, min(MOST_ROWS, 8 * count, CHUNK * rows // max(size, 1)))

    def _read(self, first: int, count: int) -> Iterator[Block]:
        joined = self._joined(first, count)
        if joined:
            yield joined
            return
        rows: list[Row] = self._database.execute(_ROWS, (first, count)).fetchall()
        yield from map(self._encoded, self._parted(rows))

    def readable(self, first: int) -> bool:
        """Tell whether there is a row from an id on, and can be read."""
        try:
            return self._database.execute(_ROWS, (first, 1)).fetchone() is not None
        except sqlite3.Error:
            return False

    def _joined(self, first: int, count: int) -> Block | None:
        """Let the database put rows together; None where one of them is out of the ordinary."""
        last = min(first + count - 1, self._last)
        if not self._joins or last <= first:
            return None
        self._database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_JOINED)
        try:
            parameters = (bytes(BODY_AT), first, last)
            data, *texts = self._database.execute(_JOINED, parameters).fetchone()
        except sqlite3.Error:
            return None
        finally:
            self._database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, self._longest)
        if data is None:
            return None
        try:
            with warnings.catch_warnings(action='error'):
                times, topics, sizes = (np.fromstring(text, np.int64, sep=' ') for text in texts)
        except (ValueError, TypeError, DeprecationWarning):
            return None
        if not len(times) == len(topics) == len(sizes):
            return None  # some are empty
        ends = np.cumsum(sizes + BODY_AT)
        if ends[-1] != len(data) + BODY_AT or not len(self._channel_of):
            return None
        places = np.searchsorted(self._channel_of[:, 0], topics)
        found = self._channel_of[np.minimum(places, len(self._channel_of) - 1)]
        if (found[:, 0] != topics).any():
            return None
        if len(self._buffer) < ends[-1] + SHORTEST:
            self._buffer = np.empty(2 * ends[-1] + SHORTEST, np.uint8)
        buffer = self._buffer[: ends[-1] + SHORTEST]
        buffer[BODY_AT : ends[-1]] = np.frombuffer(data, np.uint8)
        bodies = ends - sizes
        view = words(buffer)
        _write_heads(view, bodies, sizes, found[:, 1], times)
        long = bodies[sizes >= len(ZSTD_MAGIC)]
        if (view.w4[long] == _ZSTD).any():
            return None
        return Block(first, last, len(times), found[:, 1], buffer[: ends[-1]])

    def _parted(self, rows: list[Row]) -> Iterator[list[Row]]:
        """Part rows that get large when they are decompressed."""
        part: list[Row] = []
        total = 0
        for row in rows:
            part.append(row)
            try:
                total += self._unpack.size(row[3])
            except (BagError, TypeError):
                continue  # told where it is decompressed
            if total > UNPACKED:
                yield part
                part, total = [], 0
        if part:
            yield part

    def _encoded(self, rows: Sequence[Row]) -> Block:
        """Return rows as Message records, those that are none left out."""
        good: list[tuple[int, int, bytes]] = []
        for row in rows:
            try:
                good.append(self._message(row))
            except (TypeError, KeyError, BagError):
                continue
        first, last = rows[0][0], rows[-1][0]
        if len(good) < len(rows):
            self._tell(first, f'{len(rows) - len(good)} rows are no messages of a topic')
        channels = np.array([number for number, *_ in good], np.int64)
        if not good:
            return Block(first, last, len(rows), channels, np.empty(0, np.uint8))
        sizes = np.array([len(data) for *_, data in good], np.int64)
        times = np.array([time for _, time, _ in good], np.int64)
        room = bytes(BODY_AT)
        parts = chain.from_iterable((room, data) for *_, data in good)
        buffer = np.frombuffer(bytearray().join((*parts, bytes(SHORTEST))), np.uint8)
        _write_heads(words(buffer), np.cumsum(sizes + BODY_AT) - sizes, sizes, channels, times)
        return Block(first, last, len(rows), channels, buffer[:-SHORTEST])

    def _message(self, row: Row) -> tuple[int, int, bytes]:
        """Return channel, time and message; an error where the row is none."""
        _, topic, time, payload = row
        if not isinstance(payload, bytes) or not isinstance(time, int):
            raise TypeError
        return self._numbers[topic], time, self._unpack(payload)


def _write_heads(
    view: Words,
    bodies: NDArray[np.int64],
    sizes: NDArray[np.int64],
    channels: NDArray[np.int64],
    times: NDArray[np.int64],
) -> None:
    """Write the head of each record in front of its data, which stands there already."""
    begins = bodies - BODY_AT
    view.w1[begins] = Op.MESSAGE
    view.w8[begins + 1] = (sizes + BESIDES).view(np.uint64)
    view.w2[begins + CHANNEL_AT] = channels
    view.w4[begins + CHANNEL_AT + 2] = 0  # sequence
    view.w8[bodies + LOG_TIME] = times.view(np.uint64)
    view.w8[bodies + LOG_TIME + 8] = times.view(np.uint64)
