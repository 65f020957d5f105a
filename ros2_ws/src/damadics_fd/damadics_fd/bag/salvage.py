# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Save every intact message of a damaged bag into a new one."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.batch import MESSAGE_HEAD, Batch
from damadics_fd.bag.cdr.definition import installed_type, schema_text
from damadics_fd.bag.checking import inspection
from damadics_fd.bag.checking.inspection import LOSSY, UNUSABLE, WHOLE, Report
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.grouping import grouped
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.mcap.reader import McapFile
from damadics_fd.bag.mcap.records import HEAD, Channel, Extent, Op, Schema, parse_attachment
from damadics_fd.bag.mcap.writer import McapWriter
from damadics_fd.bag.messages import MessageFile
from damadics_fd.bag.opening import open_file
from damadics_fd.bag.rosbag2 import METADATA_FILE, BagFile, BagMetadata, Topic, parse_qos
from damadics_fd.bag.sources import bag_files
from damadics_fd.bag.writing.whole_writes import WholeWrites

ROSBAG2 = 'rosbag2'  # name of the metadata that describes a bag
MOST_NAMELESS = 16  # channels whose record is lost that are saved
ROWS = 1 << 18  # messages in a chunk of the new file
BLOCK = 1 << 22  # [B] of an attachment copied at a time


@dataclass
class Salvage:
    """
    What was found and what was saved.

    :param found: the report on the damaged bag.
    :param saved: the report on the new one, read back; None where nothing was written.
    """

    found: Report
    saved: Report | None = None

    @property
    def code(self) -> int:
        """Exit code: 0 nothing was lost, 3 something was, 1 nothing could be saved."""
        if not self.saved or (self.found.messages and not self.saved.messages):
            return UNUSABLE
        return WHOLE if self.found.code == WHOLE and not self.missing else LOSSY

    @property
    def missing(self) -> int:
        """Messages that could be read and are not in the new bag."""
        return max(0, self.found.messages - (self.saved.messages if self.saved else 0))


def salvage(path: str | Path, out: str | Path, limits: Limits = Limits()) -> Salvage:
    """
    Copy what is intact.

    Messages, topics, attachments and metadata are copied byte for byte; indexes, statistics and,
    for a directory, `metadata.yaml` are made anew.

    :param path: file or bag directory.
    :param out: file to write, or directory where `path` is one.
    :param limits: what the file may ask for.
    :raises BagError: where `out` exists or cannot be written.
    """
    path, out = Path(path), Path(out)
    if out.exists() or out.is_symlink():
        raise BagError('exists; give another name', out)
    result = Salvage(inspection.inspect(path, limits))
    if result.found.code == UNUSABLE:
        return result
    topics: dict[str, Topic] = {}
    files: list[BagFile] = []
    try:
        if path.is_dir():
            out.mkdir(parents=True)
        for source in bag_files(path):
            name = f'{out.name}_{len(files)}.mcap' if path.is_dir() else out.name
            target = out / name if path.is_dir() else out
            try:
                file = open_file(source, tolerant=True, limits=limits)
            except BagError:
                continue  # the report has it
            with file:
                copy = _Copy(file, target, topics, result.found.code == WHOLE)
                files.append(copy.run())
        if path.is_dir():
            text = BagMetadata(list(topics.values()), files).to_yaml()
            (out / METADATA_FILE).write_text(text, encoding='utf-8')
    except OSError as error:
        raise BagError(f'cannot be written: {error.strerror}', out) from error
    result.saved = inspection.inspect(out, limits)
    return result


class _Copy:
    """
    Copy one file.

    :param file: the file.
    :param target: the new one.
    :param topics: gets the topics.
    :param whole: nothing is lost, so that what describes the bag still holds.
    """

    def __init__(self, file: MessageFile, target: Path, topics: dict[str, Topic], whole: bool):
        self._file, self._target = file, target
        self._topics, self._whole = topics, whole
        self._declared: set[int] = set()
        self._schemas: set[int] = set()
        self._nameless = 0
        self._waiting: list[Channel] = []  # for their schema
        self._channels_seen = self._schemas_seen = 0

    def run(self) -> BagFile:
        """Copy everything; return what was written."""
        written = BagFile(self._target.name)
        with WholeWrites(self._target) as stream:
            self._writer = McapWriter(stream, self._file.profile)
            for batch in self._file.batches():
                used = {number for number, _ in batch.by_channel()}
                self._declare(self._ready(used))
                self._declare(self._lost(used))
                self._write(batch, used, written)
            self._declare(list(self._file.channels.values()))
            described = isinstance(self._file, McapFile) and self._extras(self._file)
            if not described and self._file.profile == 'ros2':
                names = {channel.topic for channel in self._file.channels.values()}
                topics = [topic for name, topic in self._topics.items() if name in names]
                text = BagMetadata(topics, [written]).to_yaml(root=False)
                self._writer.add_metadata(ROSBAG2, {'serialized_metadata': text})
            self._writer.finish()
        return written

    def _declare(self, channels: list[Channel]) -> None:
        """Write channels that are new, each with what is known of its schema."""
        for channel in channels:
            if channel.id in self._declared:
                continue
            schema = self._file.schemas.get(channel.schema_id) if channel.schema_id else None
            if channel.schema_id and not schema:
                schema = _installed(channel)
            if schema and schema.id not in self._schemas:
                self._schemas.add(schema.id)
                self._writer.put_schema(schema)
            number = schema.id if schema else 0
            self._declared.add(channel.id)
            self._writer.put_channel(
                Channel(
                    channel.id,
                    number,
                    channel.topic,
                    channel.message_encoding,
                    channel.metadata,
                )
            )
            self._topics.setdefault(channel.topic, _topic(channel, schema))

    def _ready(self, used: set[int]) -> list[Channel]:
        """Return channels that can be written: those in use, and those whose schema is known."""
        channels, schemas = self._file.channels, self._file.schemas
        new = list(islice(reversed(channels.values()), len(channels) - self._channels_seen))
        self._channels_seen = len(channels)
        late = new[::-1]
        if len(schemas) != self._schemas_seen:
            # a schema comes before its messages, not always before its channel
            late, self._waiting = self._waiting + late, []
            self._schemas_seen = len(schemas)
        ready = [channel for channel in late if self._complete(channel)]
        self._waiting += [channel for channel in late if not self._complete(channel)]
        return ready + [channels[number] for number in sorted(used) if number in channels]

    def _complete(self, channel: Channel) -> bool:
        return not channel.schema_id or channel.schema_id in self._file.schemas

    def _lost(self, used: set[int]) -> list[Channel]:
        """Return stand-ins for channels whose record is lost."""
        found = sorted(used - self._declared)[: MOST_NAMELESS - self._nameless]
        self._nameless += len(found)
        return [Channel(number, 0, f'/lost_channel_{number}', '', {}) for number in found]

    def _write(self, batch: Batch, used: set[int], written: BagFile) -> None:
        saved = used & self._declared
        if not saved:
            return
        rows = np.arange(len(batch.channels))
        if saved != used:
            rows = np.flatnonzero(np.isin(batch.channels, list(saved)))
        for first in range(0, len(rows), ROWS):
            self._write_rows(batch, rows[first : first + ROWS], written)

    def _write_rows(self, batch: Batch, rows: NDArray[np.int64], written: BagFile) -> None:
        log_times = batch.log_times(rows)
        begins = batch.starts[rows] - MESSAGE_HEAD
        ends = batch.starts[rows] + batch.sizes[rows]
        if (begins[1:] == ends[:-1]).all():
            data = batch.data[begins[0] : ends[-1]].tobytes()
        else:
            pairs = zip(begins.tolist(), ends.tolist(), strict=True)
            data = b''.join(batch.data[a:b].tobytes() for a, b in pairs)
        sizes = ends - begins
        offsets = np.cumsum(sizes) - sizes
        self._writer.add_records(data, batch.channels[rows], log_times.view(np.uint64), offsets)
        start, end = int(log_times.min()), int(log_times.max())
        for number, part in grouped(batch.channels[rows]):
            known = self._file.channels.get(number)
            topic = known.topic if known else f'/lost_channel_{number}'
            written.note(topic, start, end, len(part))

    def _extras(self, mcap: McapFile) -> bool:
        """Copy attachments and metadata; tell whether one of them describes the bag."""
        described = False
        for extent in mcap.extras:
            if extent.op == Op.ATTACHMENT:
                if mcap.is_intact(extent):
                    about = parse_attachment(mcap.read_bytes, extent.at)
                    self._writer.put_attachment(about, extent.length, _blocks(mcap, extent))
                continue
            if extent.name == ROSBAG2 and not self._whole:
                continue  # its counts no longer hold
            described |= extent.name == ROSBAG2
            self._writer.put_metadata(extent.name, b''.join(_blocks(mcap, extent)))
        return described or (self._whole and not _describes(mcap))


def _describes(mcap: McapFile) -> bool:
    return any(extra.op == Op.METADATA and extra.name == ROSBAG2 for extra in mcap.extras)


def _blocks(mcap: McapFile, extent: Extent) -> Iterator[bytes]:
    end = extent.at + extent.length
    yield HEAD.pack(extent.op, extent.length - HEAD.size)  # the one in the file may be damaged
    for at in range(extent.at + HEAD.size, end, BLOCK):
        yield mcap.read_bytes(at, min(BLOCK, end - at))


def _installed(channel: Channel) -> Schema | None:
    """Return the installed definition where a schema is lost and its hash is known."""
    name = installed_type(channel.metadata.get('topic_type_hash', ''))
    if not name:
        return None
    return Schema(channel.schema_id, name, 'ros2msg', schema_text(name).encode())


def _topic(channel: Channel, schema: Schema | None) -> Topic:
    return Topic(
        channel.topic,
        schema.name if schema else '',
        parse_qos(channel.metadata.get('offered_qos_profiles', '')[: Limits().yaml]),
        channel.metadata.get('topic_type_hash', ''),
        channel.message_encoding,
    )
