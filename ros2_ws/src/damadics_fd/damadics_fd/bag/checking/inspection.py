# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a bag holds, and whether it is whole."""

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.arrays import Columns, Places
from damadics_fd.bag.batch import Batch
from damadics_fd.bag.cdr.decoder import Decoder, merge
from damadics_fd.bag.checking.stated import read_metadata
from damadics_fd.bag.checking.timing import Timing
from damadics_fd.bag.errors import BagError, printable
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.messages import MessageFile
from damadics_fd.bag.opening import open_file
from damadics_fd.bag.rosbag2 import METADATA_FILE
from damadics_fd.bag.sources import bag_files, missing_files

WHOLE, UNUSABLE, LOSSY = 0, 1, 3  # exit codes, as those of `mcap recover`
SEVERAL = ('/tf', '/tf_static', '/diagnostics', '/rosout', '/parameter_events')
MOST_MISMATCHES = 20  # topics told one by one


@dataclass
class TopicReport:
    """One topic of a bag."""

    name: str
    type: str
    timing: Timing = field(default_factory=Timing)

    @property
    def count(self) -> int:
        """Messages that can be read."""
        return self.timing.count


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
    attachments: int = 0
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
        return LOSSY if self.messages or self.attachments else UNUSABLE

    @property
    def start(self) -> int:
        """First log time of all topics [ns]."""
        return min((t.timing.start for t in self.topics.values() if t.count), default=0)

    @property
    def end(self) -> int:
        """Last log time of all topics [ns]."""
        return max((t.timing.end for t in self.topics.values() if t.count), default=0)


def inspect(path: str | Path, limits: Limits = Limits()) -> Report:
    """
    Read a bag to its end and check everything that can be checked.

    CRC of chunks, attachments, data section and summary; indexes and counts against the messages
    and `metadata.yaml`; stamps.

    :param path: file or bag directory.
    :param limits: what the files may ask for.
    :return: the report; it never raises for what is in a file.
    """
    report = Report(Path(path))
    try:
        files = bag_files(path)
        report.problems += missing_files(path)
    except BagError as error:
        report.problems.append(str(error))
        return report
    for name in files:
        report.files += 1
        try:
            report.size += name.stat().st_size
            with open_file(name, tolerant=True, limits=limits) as file:
                _inspect_file(file, report)
        except (BagError, OSError) as error:
            report.problems.append(printable(str(error)))
    _compare_with_metadata(report)
    for topic in report.topics.values():
        timing = topic.timing
        measured = topic.name.rsplit('/', 1)[-1] == 'measurement'
        told = report.problems if measured else report.remarks
        if timing.negative:
            told.append(f'{topic.name}: {timing.negative} stamps have rolled over')
        if timing.steps_back:
            told.append(f'{topic.name}: stamps go back {timing.steps_back} times')
    return report


def _compare_with_metadata(report: Report) -> None:
    stated = read_metadata(report.path) if report.path.is_dir() else None
    if not stated:
        return
    wrong = [
        f'{name}: {report.topics[name].count if name in report.topics else 0} of {count} messages'
        f' that {METADATA_FILE} lists are there'
        for name, count in stated.counts.items()
        if count != (report.topics[name].count if name in report.topics else 0)
    ]
    report.problems += wrong[:MOST_MISMATCHES]
    if not wrong and stated.messages >= 0 and stated.messages != report.messages:
        report.problems.append(
            f'{report.messages} of {stated.messages} messages that {METADATA_FILE} lists are there'
        )


def _inspect_file(file: MessageFile, report: Report) -> None:
    counts: Counter[int] = Counter()
    decoders: dict[int, Decoder | None] = {}
    for batch in file.batches():
        file.check_batch(batch)
        times: dict[str, list[tuple[Places, Columns]]] = {}
        lost = 0
        for number, rows in batch.by_channel():
            counts[number] += len(rows)
            if number not in file.channels:
                lost += len(rows)
                continue
            if number not in decoders:
                decoders[number] = _stamp_decoder(file, number)
            log_time, stamp = _times(file, number, batch, rows, decoders)
            name = _topic(report, file, number).name
            times.setdefault(name, []).append((rows, {'log_time': log_time, 'stamp': stamp}))
        if lost:
            file.problem(batch.offset, f'{lost} messages belong to a channel that is lost')
        for name, groups in times.items():
            report.topics[name].timing.note(**merge(groups))
    for channel in file.channels.values():
        _topic(report, file, channel.id)
    if file.stated:
        file.topic_counts({number: counts[number] for number in {*file.stated, *counts}})
    file.check()
    report.attachments += file.attachments
    report.problems += file.told()
    report.remarks += [f'{file.path}: {remark}' for remark in file.remarks]


def _topic(report: Report, file: MessageFile, number: int) -> TopicReport:
    channel = file.channels[number]
    schema = file.schemas.get(channel.schema_id)
    return report.topics.setdefault(
        channel.topic, TopicReport(channel.topic, schema.name if schema else '')
    )


def _stamp_decoder(file: MessageFile, number: int) -> Decoder | None:
    """Return a decoder for `header.stamp`, None where the topic has none or many sources."""
    if file.channels[number].topic in SEVERAL:
        return None
    try:
        decoder = Decoder(file, number, [])
    except BagError:
        return None
    return decoder if decoder.is_stamped else None


def _times(
    file: MessageFile,
    number: int,
    batch: Batch,
    rows: Places,
    decoders: dict[int, Decoder | None],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return log times and stamps of messages of a channel; `decoders` loses those that fail."""
    log_time = batch.log_times(rows)
    decoder = decoders[number]
    if decoder:
        try:
            if decoder.is_costly:
                return log_time, decoder.stamps(batch, rows)
            decoded = decoder.decode(batch, batch.starts[rows], batch.sizes[rows])
            return log_time, decoded['stamp']
        except BagError as error:
            file.problem(batch.offset, error.reason)
            decoders[number] = None
    return log_time, log_time
