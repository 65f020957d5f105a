# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a bag holds, and whether it is whole."""

import struct
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.cdr.decoder import Decoder
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.mcap.crc import crc32
from damadics_fd.bag.mcap.reader import Batch, McapFile
from damadics_fd.bag.mcap.records import HEAD, Op
from damadics_fd.bag.sources import bag_files

WHOLE, UNUSABLE, LOSSY = 0, 1, 3  # exit codes, as those of `mcap recover`
BLOCK = 1 << 24  # [B] of the file checked at a time
SEVERAL = ('/tf', '/tf_static', '/diagnostics', '/rosout', '/parameter_events')


@dataclass
class TopicReport:
    """One topic of a bag; times in ns."""

    name: str
    type: str
    count: int = 0
    start: int = 0
    end: int = 0
    steps_back: int = 0  # stamps smaller than the one before
    rolled_over: int = 0  # times that do not fit 63 bits or are negative
    _last: int = field(default=-(2**63), repr=False)

    def note(self, log_time: NDArray[np.int64], stamp: NDArray[np.int64]) -> None:
        """Take the next messages."""
        first, last = int(log_time.min()), int(log_time.max())
        self.start = min(first, self.start) if self.count else first
        self.end = max(last, self.end) if self.count else last
        self.count += len(log_time)
        self.rolled_over += int(((log_time < 0) | (stamp < 0)).sum())
        self.steps_back += int((np.diff(stamp) < 0).sum()) + int(stamp[0] < self._last)
        self._last = int(stamp[-1])


@dataclass
class Report:
    """
    What a bag holds and what is wrong with it.

    :param problems: what is damaged or lost.
    :param remarks: what is odd but complete.
    """

    path: Path
    files: int = 0
    size: int = 0
    topics: dict[str, TopicReport] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    @property
    def messages(self) -> int:
        """Messages that can be read."""
        return sum(topic.count for topic in self.topics.values())

    @property
    def code(self) -> int:
        """Exit code: 0 whole, 3 lossy, 1 unusable."""
        if not self.problems:
            return WHOLE
        return LOSSY if self.messages else UNUSABLE


def inspect(path: str | Path, limits: Limits = Limits()) -> Report:
    """
    Read a bag to its end and check everything that can be checked.

    CRC of chunks, data section and summary; indexes and counts against the messages; stamps.

    :param path: MCAP file or bag directory.
    :param limits: what the file may ask for.
    :return: the report; it never raises for what is in a file.
    """
    report = Report(Path(path))
    try:
        files = bag_files(path)
    except BagError as error:
        report.problems.append(str(error))
        return report
    for file in files:
        report.files += 1
        try:
            report.size += file.stat().st_size
            with McapFile(file, tolerant=True, limits=limits) as mcap:
                _inspect_file(mcap, report)
        except (BagError, OSError) as error:
            report.problems.append(str(error))
    for topic in report.topics.values():
        if topic.rolled_over:
            report.problems.append(f'{topic.name}: {topic.rolled_over} stamps have rolled over')
        if topic.steps_back:
            text = f'{topic.name}: stamps go back {topic.steps_back} times'
            measured = topic.name.rsplit('/', 1)[-1] == 'measurement'
            (report.problems if measured else report.remarks).append(text)
    return report


def _inspect_file(mcap: McapFile, report: Report) -> None:
    counts: Counter[int] = Counter()
    offsets = []
    decoders: dict[int, Decoder | None] = {}
    for batch in mcap.batches():
        offsets.append(batch.offset)
        if mcap.summary.chunks and not mcap.summary.moved:
            _check_index(mcap, batch)
        for number in np.unique(batch.channels).tolist():
            rows = batch.channels == number
            count = int(rows.sum())
            counts[number] += count
            if number not in mcap.channels:
                mcap.problem(batch.offset, f'{count} messages belong to a channel that is lost')
                continue
            if number not in decoders:
                decoders[number] = _stamp_decoder(mcap, number)
            _note(report, mcap, number, batch, rows, decoders)
    for channel in mcap.channels.values():
        _topic(report, mcap, channel.id)
    _check_end(mcap, counts, offsets)
    report.problems += [
        f'{mcap.path}: {problem.text} (at byte {problem.offset})' for problem in mcap.problems
    ]


def _topic(report: Report, mcap: McapFile, number: int) -> TopicReport:
    channel = mcap.channels[number]
    schema = mcap.schemas.get(channel.schema_id)
    return report.topics.setdefault(
        channel.topic, TopicReport(channel.topic, schema.name if schema else '')
    )


def _stamp_decoder(mcap: McapFile, number: int) -> Decoder | None:
    """Return a decoder for `header.stamp`, None where the topic has none or many sources."""
    if mcap.channels[number].topic in SEVERAL:
        return None
    try:
        decoder = Decoder(mcap, number, [])
    except BagError:
        return None
    members = decoder.definition.get(decoder.kind, [])
    has_header = bool(members) and members[0].type == 'std_msgs/msg/Header'
    return decoder if has_header and members[0].name == 'header' else None


def _note(
    report: Report,
    mcap: McapFile,
    number: int,
    batch: Batch,
    rows: NDArray[np.bool_],
    decoders: dict[int, Decoder | None],
) -> None:
    log_time = batch.log_times(rows)
    stamp = log_time
    decoder = decoders[number]
    if decoder:
        try:
            stamp = decoder.decode(batch, batch.starts[rows], batch.sizes[rows])['stamp']
        except BagError as error:
            mcap.problem(batch.offset, error.reason)
            decoders[number] = None
    _topic(report, mcap, number).note(log_time, stamp)


def _check_index(mcap: McapFile, batch: Batch) -> None:
    """Compare the message index of a chunk with its messages."""
    entries = mcap.summary.chunks.get(batch.offset)
    if entries is None:
        mcap.problem(batch.offset, 'the chunk is missing in the index')
        return
    for number, at in entries.items():
        rows = batch.channels == number
        places = batch.starts[rows] - 31
        pairs = np.stack([batch.log_times(rows), places], axis=1).astype('<u8')
        content = struct.pack('<HI', number, pairs.nbytes)
        size = HEAD.size + len(content) + pairs.nbytes
        found = mcap.read_bytes(at, size)
        same = found[: HEAD.size] == HEAD.pack(Op.MESSAGE_INDEX, size - HEAD.size) and (
            found[HEAD.size : HEAD.size + 6] == content
        )
        if same:  # the entries may be in any order
            listed = np.frombuffer(found[HEAD.size + 6 :], '<u8').reshape(-1, 2)
            same = bool((np.sort(listed[:, 1]) == pairs[:, 1]).all()) and bool(
                (listed[np.argsort(listed[:, 1]), 0] == pairs[:, 0]).all()
            )
        if not same:
            mcap.problem(at, 'the message index does not match the chunk')


def _check_end(mcap: McapFile, counts: Counter[int], offsets: list[int]) -> None:
    summary = mcap.summary
    if mcap.end and not summary.present:
        mcap.problem(mcap.end, 'the summary is missing or damaged')
    if mcap.end and mcap.crc and _crc(mcap) != mcap.crc:
        mcap.problem(mcap.end, 'the data section is damaged: its CRC does not match')
    if not summary.present:
        return
    missing = set(summary.chunks) - set(offsets)
    if summary.moved:
        mcap.problem(mcap.end, 'bytes are missing or were added before the summary')
    elif missing:
        mcap.problem(min(missing), f'{len(missing)} chunks of the index are lost')
    for number, count in summary.counts.items():
        if counts[number] != count:
            topic = mcap.channels[number].topic if number in mcap.channels else number
            mcap.problem(mcap.end, f'{topic}: {counts[number]} of {count} messages are left')


def _crc(mcap: McapFile) -> int:
    crc = at = 0
    while at < mcap.end:
        data = mcap.read_bytes(at, min(BLOCK, mcap.end - at))
        crc = crc32(data, crc)
        at += len(data)
    return crc
