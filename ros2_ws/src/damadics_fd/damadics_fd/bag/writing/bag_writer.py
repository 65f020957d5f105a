# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Write bags as rosbag2 does, so that `ros2 bag`, Foxglove, `rosbags` and `mcap` read them."""

import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.arrays import Column
from damadics_fd.bag.cdr.definition import schema_text, type_hash
from damadics_fd.bag.cdr.layout import stamped_encoder
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.mcap.writer import CHUNK_SIZE, LEVEL, McapWriter
from damadics_fd.bag.rosbag2 import (
    METADATA_FILE,
    BagFile,
    BagMetadata,
    QosProfile,
    Topic,
)
from damadics_fd.bag.writing.channels import Channels
from damadics_fd.bag.writing.latched import Kept, Latched
from damadics_fd.bag.writing.whole_writes import WholeWrites

FLUSH_PERIOD = 0.5  # [s] a crash loses at most what came since the last flush
NANO = 1_000_000_000


class BagWriter:
    """
    Write one bag.

    `path` names a bag directory, which gets `metadata.yaml` and `<name>_0.mcap`, `<name>_1.mcap`,
    ...; or, where it ends in `.mcap`, a single file. An `OSError` while writing (disk full) loses
    nothing: the messages stay in the open chunk, and the next `flush` tries again.

    :param path: directory to create, or file to write.
    :param split_bytes: start a new file once this one has so many bytes, 0 for never.
    :param split_seconds: start a new file once this one spans so much log time, 0 for never.
    :param quota_bytes: remove the oldest files of this bag beyond so many bytes, 0 for never.
    :param chunk_size: uncompressed size of a chunk [B].
    :param flush_period: greatest age of a message that is not yet in the file [s].
    :param level: zstd compression level.
    :param custom_data: entries for the `custom_data` of the bag.
    :raises BagError: where the directory already holds something or cannot be created.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        split_bytes: int = 0,
        split_seconds: float = 0.0,
        quota_bytes: int = 0,
        chunk_size: int = CHUNK_SIZE,
        flush_period: float = FLUSH_PERIOD,
        level: int = LEVEL,
        custom_data: Mapping[str, str] | None = None,
    ):
        self.path = Path(path)
        self._single = self.path.suffix == '.mcap'
        if self._single and (split_bytes or split_seconds or quota_bytes):
            raise BagError('a single .mcap file cannot be split; give a directory', path)
        self._quota_bytes = quota_bytes
        self._split_bytes = split_bytes or quota_bytes // 8
        self._split_time = int(split_seconds * NANO)
        self._flush_period = flush_period
        self._make_mcap = partial(McapWriter, chunk_size=chunk_size, level=level)
        self._custom_data = dict(custom_data or {})
        self._topics: dict[str, Topic] = {}
        self._files: list[BagFile] = []
        self._sizes: dict[str, int] = {}  # of the finished files
        self._number = 0
        self._splits = bool(self._split_bytes or self._split_time)
        self._latched = Latched()
        self._held: list[Kept] = []  # while the next file cannot be opened
        self._create()
        self._open()

    def _create(self) -> None:
        self._folder = self.path.parent if self._single else self.path
        try:
            if not self._single and self._folder.is_dir() and any(self._folder.iterdir()):
                raise BagError('exists and is not empty; give the bag another name', self.path)
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise BagError(f'cannot create the bag: {error.strerror}', self.path) from error

    def _open(self) -> None:
        """Open the next file; what waits is written to it, latched messages first."""
        name = self.path.name if self._single else f'{self.path.name}_{self._number}.mcap'
        path = self._folder / name
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            stream = WholeWrites(path)
        except OSError as error:
            remedy = '; give another name' if isinstance(error, FileExistsError) else ''
            raise BagError(f'cannot write: {error.strerror}{remedy}', path) from error
        try:
            self._mcap = self._make_mcap(stream)
        except OSError as error:
            stream.close()
            path.unlink()
            raise BagError(f'cannot write: {error.strerror}', path) from error
        self._stream, self._described = stream, False
        self._number += 1
        self._channels = Channels(self._mcap)
        self._file = BagFile(name)
        self._files.append(self._file)
        held, self._held = self._held, []
        for message in held:
            self._add(*message)

    def add_topic(
        self,
        name: str,
        kind: str,
        offered_qos: Sequence[QosProfile] = (),
        hash_: str = '',
    ) -> Topic:
        """
        Declare a topic; a second declaration returns the first.

        :param name: fully qualified name of the topic.
        :param kind: message type, `package/msg/Type`.
        :param offered_qos: what its publishers offer, by `rosbag2.qos`; a topic that has neither
            publisher nor message at the end is no part of the bag.
        :param hash_: type hash, taken from the installed type where it is not given.
        :raises BagError: where the message type is not installed.
        """
        if name not in self._topics:
            schema_text(kind)  # refused here rather than with the first message
            self._topics[name] = Topic(name, kind, list(offered_qos), hash_ or type_hash(kind))
        return self._topics[name]

    def write(self, topic: Topic, data: bytes, log_time: int, publish_time: int) -> None:
        """
        Write one message.

        :param topic: as returned by `add_topic`.
        :param data: serialised message.
        :param log_time: when it was received [ns].
        :param publish_time: when it was published [ns].
        """
        if self._splits or self._held:
            try:
                self._split_if_due(log_time)
            except (OSError, BagError):
                if self._stream.closed:
                    self._held.append(Kept(topic, data, log_time, publish_time))
                else:
                    self._add(topic, data, log_time, publish_time)
                raise
        self._add(topic, data, log_time, publish_time)

    def _add(self, topic: Topic, data: bytes, log_time: int, publish_time: int) -> None:
        if self._splits and not self._file.counts:  # a late reader of this file wants them, too
            for kept in self._latched.before(log_time):
                self._put(kept.topic, kept.data, log_time, kept.publish_time)
        self._put(topic, data, log_time, publish_time)
        if self._splits:
            self._latched.keep(Kept(topic, data, log_time, publish_time))

    def _put(self, topic: Topic, data: bytes, log_time: int, publish_time: int) -> None:
        channel = self._channels.of(topic)
        self._file.note(topic.name, log_time, log_time, 1)
        self._mcap.add_message(channel, data, log_time, publish_time)

    def write_columns(
        self,
        stamp: NDArray[np.int64],
        messages: Mapping[str, Mapping[str, Column]],
        frame_id: str,
    ) -> None:
        """
        Write columns of stamped messages; at each stamp one message of each topic, in this order.

        :param stamp: `header.stamp`, log and publish time of each row, ascending [ns].
        :param messages: for each declared topic its columns by dotted field name.
        :param frame_id: `header.frame_id` of all messages.
        :raises BagError: where a column is no field of its message or no topic is declared.
        """
        if not len(stamp):
            return
        channels = []
        payloads = []
        for name, columns in messages.items():
            topic = self._topics[name]
            payloads.append(stamped_encoder(topic.type, frame_id)(columns, stamp))
            channels.append(self._channels.of(topic))
            self._file.note(name, int(stamp[0]), int(stamp[-1]), len(stamp))
        self._mcap.add_rows(channels, stamp, payloads)

    def _split_if_due(self, log_time: int) -> None:
        if self._stream.closed:  # the next file could not be opened before
            self._open()
            return
        file = self._file
        too_big = self._split_bytes and self._mcap.position >= self._split_bytes
        too_long = self._split_time and log_time - file.start >= self._split_time
        if file.counts and (too_big or too_long):
            self._finish_file()
            self._open()
            while self._quota_bytes and self.size > self._quota_bytes and self.drop_oldest():
                pass

    def drop_oldest(self) -> bool:
        """Remove the oldest finished file of the bag; tell whether there was one."""
        if len(self._files) < 2:
            return False
        file = self._files.pop(0)
        (self._folder / file.path).unlink(missing_ok=True)
        self._sizes.pop(file.path, None)
        return True

    def flush(self) -> None:
        """Hand all messages to the operating system."""
        if self._stream.closed and self._held:
            self._open()
        self._stream.restore()
        self._mcap.flush()

    def flush_if_due(self) -> None:
        """Flush where the oldest message not yet in the file has reached the flush period."""
        if self._mcap.pending and (
            time.monotonic() - self._mcap.chunk_opened >= self._flush_period
        ):
            self.flush()

    @property
    def size(self) -> int:
        """Bytes in all files of the bag."""
        return sum(self._sizes.values()) + self._mcap.position

    @property
    def unsaved(self) -> int:
        """Messages that are in memory only."""
        return self._mcap.waiting + len(self._held)

    def abandon(self) -> None:
        """Let go of a file that cannot be finished; its whole chunks stay readable."""
        self._stream.close()

    @property
    def counts(self) -> dict[str, int]:
        """Messages in the bag by topic."""
        return {
            name: sum(file.counts.get(name, 0) for file in self._files) for name in self._topics
        }

    def _metadata(self) -> BagMetadata:
        return BagMetadata(self._present(), self._files, self._custom_data)

    def _present(self) -> list[Topic]:
        counts = self.counts
        return [t for t in list(self._topics.values()) if t.offered_qos or counts[t.name]]

    def _finish_file(self) -> None:
        for topic in self._present():
            self._channels.of(topic)  # a topic without messages is part of the bag, too
        self._stream.restore()
        if not self._described:
            entries = {'serialized_metadata': self._metadata().to_yaml(root=False)}
            self._mcap.add_metadata('rosbag2', entries)
            self._described = True
        self._mcap.finish()
        self._stream.close()
        self._sizes[self._file.path] = self._mcap.position
        if not self._single:
            fresh = self._folder / f'.{METADATA_FILE}'
            fresh.write_text(self._metadata().to_yaml(), encoding='utf-8')
            fresh.replace(self._folder / METADATA_FILE)

    def close(self) -> None:
        """Finish the last file and write `metadata.yaml`."""
        if self._held:
            self._open()
        if not self._stream.closed:
            self._finish_file()
            self._mcap.position = 0  # counted with the finished files

    def __enter__(self) -> 'BagWriter':
        """Return the writer."""
        return self

    def __exit__(self, *exception: object) -> None:
        """Close the bag."""
        self.close()
