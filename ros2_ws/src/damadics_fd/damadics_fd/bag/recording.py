# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Anything that holds measurements of a valve, as a stream of columns."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.columns import iter_columns, read_columns
from damadics_fd.bag.decoder import Columns
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.reader import McapFile
from damadics_fd.bag.sources import bag_files, find_bags
from damadics_fd.bag.tables import Table, read_table

TABLES = ('.csv', '.txt', '.tsv')
MEASUREMENT = 'damadics_msgs/msg/Measurement'
SIGNALS = ('cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps')
EPOCH = 10**17  # [ns] stamps from here on are dates, below they count from scenario zero
_MAP = re.compile(r'(\w+)=([^*]+)(?:\*([-+.\deE]+))?')
Told = Callable[[str], None]


def origin(stamp: int) -> int:
    """
    Return the stamp that counts as time zero [ns].

    :param stamp: first stamp of a recording [ns].
    :return: 0 for simulations, which count from scenario zero; the first stamp for real data.
    """
    return stamp if abs(stamp) >= EPOCH else 0


def parse_maps(texts: Sequence[str]) -> dict[str, tuple[str, float]]:
    """
    Parse what the user says about where signals are.

    :param texts: each `SIGNAL=SOURCE` or `SIGNAL=SOURCE*FACTOR`; the source is `/topic.field` in a
        bag and a column in a table.
    :return: source and factor to SI for each signal.
    :raises BagError: where a text is none of these.

    >>> parse_maps(['cv=/valve/setpoint.data*0.01'])
    {'cv': ('/valve/setpoint.data', 0.01)}
    """
    maps = {}
    for text in texts:
        match = _MAP.fullmatch(text)
        try:
            if not match or match[1] not in (*SIGNALS, 't', 'stamp'):
                raise ValueError
            maps[match[1]] = match[2], float(match[3] or 1.0)
        except ValueError:
            raise BagError(
                f'--map {text}: write SIGNAL=/topic.field or SIGNAL=COLUMN, then *FACTOR;'
                f' SIGNAL is one of {", ".join(SIGNALS)}'
            ) from None
    return maps


@dataclass(frozen=True)
class Recording:
    """
    One valve in one bag or table.

    :param path: MCAP file, bag directory or table.
    :param topic: topic of the measurements in a bag.
    :param maps: where signals are, if not in a `Measurement`.
    :param table: the table, where it is one.
    :param size: size of its files [B].
    """

    path: Path
    topic: str = '/measurement'
    maps: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    table: Table | None = None
    size: int = 0

    @property
    def name(self) -> str:
        """What to call it."""
        if self.table and self.table.name:
            return f'{self.path}#{self.table.name}'
        special = not self.maps and self.topic != '/measurement' and not self.table
        return f'{self.path}#{self.topic}' if special else str(self.path)

    def chunks(self, on_problem: Told) -> Iterator[Columns]:
        """
        Yield its columns piece by piece.

        :param on_problem: told each damaged place, which is left out.
        :raises BagError: where it cannot be read.
        """
        if self.table:
            yield from self.table.chunks()
        elif self.maps:
            yield self._mapped(on_problem)
        else:
            yield from iter_columns(self.path, self.topic, on_problem=on_problem)

    def truth(self, on_problem: Told) -> Columns | None:
        """Return `stamp`, `fault` and `strength` where a bag has them."""
        if self.table or self.maps:
            return None
        topic = self.topic.removesuffix('measurement') + 'fault_state'
        try:
            return read_columns(self.path, topic, ['fault', 'strength'], on_problem=on_problem)
        except BagError:
            return None  # real valves do not tell

    def _mapped(self, on_problem: Told) -> Columns:
        """Read signals from several topics; each holds its value until its next message."""
        parsed = {}
        for signal, (source, factor) in self.maps.items():
            topic, dot, name = source.partition('.')
            if not dot:
                raise BagError(f'--map {signal}={source}: write /topic.field', self.path)
            parsed[signal] = ('/' + topic.lstrip('/'), name, factor)
        if not {'cv', 'x1'} <= parsed.keys():
            raise BagError('--map must name at least cv and x1', self.path)
        read = {
            topic: read_columns(self.path, topic, sorted({
                name for other, name, _ in parsed.values() if other == topic
            }), on_problem=on_problem)
            for topic in {topic for topic, _, _ in parsed.values()}
        }
        base = _time(read[parsed['x1'][0]])
        columns: Columns = {'stamp': base}
        for signal, (topic, name, factor) in parsed.items():
            values = np.asarray(read[topic][name], float) * factor
            columns[signal] = hold(_time(read[topic]), values, base)
        known = np.isfinite(columns['cv'])
        return {name: column[known] for name, column in columns.items()}


def _time(columns: Columns) -> NDArray[np.int64]:
    return columns['stamp' if 'stamp' in columns else 'log_time']


def hold(stamp: NDArray, values: NDArray, at: NDArray) -> NDArray:
    """
    Return the latest value at each instant, NaN before the first.

    >>> hold(np.array([10, 20]), np.array([1.0, 2.0]), np.array([5, 10, 15, 25]))
    array([nan,  1.,  1.,  2.])
    """
    if not len(stamp):
        return np.full(len(at), np.nan)
    index = np.searchsorted(stamp, at, side='right') - 1
    return np.where(index >= 0, values[index], np.nan)


def find_recordings(
    paths: Sequence[str | Path], topic: str | None = None, maps: Mapping = {},  # noqa: B006
    actuator: int | None = None,
) -> list[Recording]:
    """
    List every valve in files, bags and folders.

    :param paths: MCAP files, bag directories, tables, folders of such.
    :param topic: topic of the measurements; None for all that are called `measurement` or hold
        `damadics_msgs/Measurement`.
    :param maps: where signals are, by `parse_maps`.
    :param actuator: actuator of a table with the plant's tags; None for all.
    :return: recordings in the order of the paths.
    :raises BagError: where a path holds none.
    """
    found: list[Recording] = []
    for path in map(Path, paths):
        tables = [path] if path.suffix.lower() in TABLES else []
        if path.is_dir():
            tables = sorted(p for p in path.iterdir() if p.suffix.lower() in TABLES)
        for table in tables:
            found += [
                Recording(table, table=part, size=table.stat().st_size)
                for part in read_table(table, actuator, maps)
            ]
        if tables and not (path.is_dir() and _has_bags(path)):
            continue
        for bag in find_bags(path):
            size = sum(file.stat().st_size for file in bag_files(bag))
            if maps:
                found.append(Recording(bag, maps=maps, size=size))
            else:
                names = [topic] if topic else measurement_topics(bag)
                found += [Recording(bag, name, size=size) for name in names]
    return found


def _has_bags(folder: Path) -> bool:
    try:
        return bool(find_bags(folder))
    except BagError:
        return False


def measurement_topics(path: Path) -> list[str]:
    """
    List the topics of a bag that hold measurements of a valve.

    :raises BagError: where there is none.
    """
    kinds: dict[str, str] = {}
    for file in bag_files(path):
        with McapFile(file, tolerant=True) as mcap:
            if not mcap.channels:
                for _ in mcap.batches():  # no summary: the channels are among the messages
                    pass
            for channel in mcap.channels.values():
                schema = mcap.schemas.get(channel.schema_id)
                kinds[channel.topic] = schema.name if schema else ''
    topics = [
        topic for topic, kind in kinds.items()
        if kind == MEASUREMENT or topic.rsplit('/', 1)[-1] == 'measurement'
    ]
    if not topics:
        raise BagError(
            f'has no measurement; it has {", ".join(sorted(kinds)) or "no topic"}. Name the'
            ' signals: --map cv=/topic.field --map x1=/topic.field', path,
        )
    return sorted(topics)
