# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Save every intact message of a damaged bag into a new one."""

from pathlib import Path

import numpy as np
import yaml

from damadics_fd.bag import inspection
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.inspection import Report
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.mcap.reader import Batch, McapFile
from damadics_fd.bag.mcap.writer import McapWriter
from damadics_fd.bag.rosbag2 import METADATA_FILE, BagFile, BagMetadata, Topic
from damadics_fd.bag.sources import bag_files
from damadics_fd.bag.writer import WholeWrites


def salvage(path: str | Path, out: str | Path, limits: Limits = Limits()) -> Report:
    """
    Copy what is intact.

    Messages, topics and metadata are copied byte for byte; indexes, statistics and, for a
    directory, `metadata.yaml` are made anew.

    :param path: MCAP file or bag directory.
    :param out: file to write, or directory where `path` is one.
    :param limits: what the file may ask for.
    :return: the report on `path`; its code is 0 where nothing was lost.
    :raises BagError: where `out` exists or cannot be written.
    """
    path, out = Path(path), Path(out)
    if out.exists():
        raise BagError('exists; give another name', out)
    report = inspection.inspect(path, limits)
    if report.code == inspection.UNUSABLE:
        return report
    topics: dict[str, Topic] = {}
    files: list[BagFile] = []
    try:
        if path.is_dir():
            out.mkdir(parents=True)
        for source in bag_files(path):
            name = f'{out.name}_{len(files)}.mcap' if path.is_dir() else out.name
            target = out / name if path.is_dir() else out
            copied = _copy(source, target, topics, limits)
            if copied:
                files.append(copied)
        if path.is_dir():
            text = BagMetadata(list(topics.values()), files).to_yaml()
            (out / METADATA_FILE).write_text(text, encoding='utf-8')
    except OSError as error:
        raise BagError(f'cannot be written: {error.strerror}', out) from error
    return report


def _copy(source: Path, target: Path, topics: dict[str, Topic], limits: Limits) -> BagFile | None:
    try:
        mcap = McapFile(source, tolerant=True, limits=limits)
    except BagError:
        return None  # the report has it
    with mcap, WholeWrites(target) as stream:
        file = BagFile(target.name)
        writer = McapWriter(stream, mcap.profile or 'ros2')
        declared: set[int] = set()
        schemas: set[int] = set()
        for batch in mcap.batches():
            for channel in [c for c in mcap.channels.values() if c.id not in declared]:
                schema = mcap.schemas.get(channel.schema_id)
                if schema and schema.id not in schemas:
                    schemas.add(schema.id)
                    writer.put_schema(schema)
                if schema or not channel.schema_id:
                    declared.add(channel.id)
                    writer.put_channel(channel)
                    topics.setdefault(channel.topic, _topic(mcap, channel.id))
            _write(writer, batch, declared, mcap, file)
        for name, entries in mcap.metadata:
            if name != 'rosbag2':
                writer.add_metadata(name, entries)
        metadata = BagMetadata(list(topics.values()), [file]).to_yaml(root=False)
        writer.add_metadata('rosbag2', {'serialized_metadata': metadata})
        writer.finish()
    return file


def _write(
    writer: McapWriter, batch: Batch, declared: set[int], mcap: McapFile, file: BagFile
) -> None:
    rows = np.flatnonzero(np.isin(batch.channels, list(declared)))
    if not len(rows):
        return
    log_times = batch.log_times(rows)
    begins, ends = batch.starts[rows] - 31, batch.starts[rows] + batch.sizes[rows]
    if (begins[1:] == ends[:-1]).all():
        data = batch.data[begins[0] : ends[-1]].tobytes()
    else:
        data = b''.join(batch.data[a:b].tobytes() for a, b in zip(begins, ends, strict=True))
    sizes = ends - begins
    offsets = np.cumsum(sizes) - sizes
    channels = batch.channels[rows]
    writer.add_records(data, channels, log_times.view(np.uint64), offsets)
    start, end = int(log_times.min()), int(log_times.max())
    file.start = min(start, file.start) if file.counts else start
    file.end = max(end, file.end) if file.counts else end
    for number, count in zip(*np.unique(channels, return_counts=True), strict=True):
        name = mcap.channels[int(number)].topic
        file.counts[name] = file.counts.get(name, 0) + int(count)


def _topic(mcap: McapFile, number: int) -> Topic:
    channel = mcap.channels[number]
    schema = mcap.schemas.get(channel.schema_id)
    try:
        offered = yaml.safe_load(channel.metadata.get('offered_qos_profiles', ''))
    except yaml.YAMLError:
        offered = None
    profiles = [p for p in offered if isinstance(p, dict)] if isinstance(offered, list) else []
    return Topic(
        channel.topic,
        schema.name if schema else '',
        profiles,
        channel.metadata.get('topic_type_hash', ''),
    )
