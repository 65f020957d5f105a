# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Anything that holds measurements of a valve, as a stream of columns."""

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from damadics_fd.bag.arrays import Column, Columns, Places
from damadics_fd.bag.cdr.definition import full_name
from damadics_fd.bag.columns import iter_columns, listing, open_files, read_columns
from damadics_fd.bag.errors import BagError, NoMeasurementError
from damadics_fd.bag.mapping import SIGNALS, Source, parse_maps
from damadics_fd.bag.sources import find_bags
from damadics_fd.bag.tables.table import Table, read_table

TABLES = ('.csv', '.txt', '.tsv', '.parquet', '.pq')
MEASUREMENT = 'damadics_msgs/msg/Measurement'
__all__ = ['SIGNALS', 'Recording', 'find_recordings', 'parse_maps']
_ELEMENT = re.compile(r'\[(\d+)\]$')  # of an array
MOST_VALVES = 1000  # in one bag that are replayed without being asked for
Told = Callable[[str], None]


@dataclass(frozen=True)
class Recording:
    """
    One valve in one bag or table.

    :param path: MCAP file, bag directory or table.
    :param topic: topic of the measurements in a bag.
    :param maps: where signals are, if not in a `Measurement`.
    :param table: the table, where it is one.
    """

    path: Path
    topic: str = '/measurement'
    maps: Mapping[str, Source] = field(default_factory=dict)
    table: Table | None = None

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
            yield from self.table.chunks(on_problem)
        elif self.maps:
            yield self._mapped(on_problem)
        else:
            for columns in iter_columns(self.path, self.topic, on_problem=on_problem):
                if not {'cv', 'x1'} <= columns.keys():
                    raise BagError(
                        f'{self.topic} has no field cv or x1; it has {listing(columns)}. Name the'
                        ' signals: --map cv=/topic.field --map x1=/topic.field',
                        self.path,
                    )
                yield columns

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
        parsed: dict[str, tuple[str, str, int | None]] = {}
        for signal, source in self.maps.items():
            topic, dot, name = source.name.partition('.')
            if not dot:
                raise BagError(f'--map {signal}={source.name}: write /topic.field', self.path)
            index = _ELEMENT.search(name)
            parsed[signal] = (
                topic,
                _ELEMENT.sub('', name),
                int(index[1]) if index else None,
            )
        if not {'cv', 'x1'} <= parsed.keys():
            raise BagError('--map must name at least cv and x1', self.path)
        read = {
            topic: read_columns(
                self.path,
                topic,
                sorted({name for other, name, _ in parsed.values() if other == topic}),
                on_problem=on_problem,
            )
            for topic in {topic for topic, _, _ in parsed.values()}
        }
        clock = self._clock(read)
        base = read[parsed['x1'][0]][clock]
        columns: Columns = {'stamp': base}
        for signal, (topic, name, element) in parsed.items():
            values = np.asarray(read[topic][name], float)
            if values.ndim > 1 and element is not None and element < values.shape[1]:
                values = values[:, element]
            if values.ndim != 1:
                raise BagError(
                    f'--map {signal}={topic}.{name}: the field is an array of'
                    f' {values.shape[1]}; write {topic}.{name}[0]',
                    self.path,
                )
            scaled = self.maps[signal].scale(values)
            columns[signal] = hold(read[topic][clock], scaled, base)
        known = np.isfinite(columns['cv'])
        if len(base) and not known.any():
            raise BagError(
                f'--map: no message of {parsed["cv"][0]} comes before the last one of'
                f' {parsed["x1"][0]}',
                self.path,
            )
        return {name: column[known] for name, column in columns.items()}

    def _clock(self, read: Mapping[str, Columns]) -> str:
        """
        Choose the one clock for signals of several topics: their stamps where all have them.

        :raises BagError: where the recorder's clock cannot serve instead.
        """
        unstamped = [topic for topic, columns in read.items() if 'stamp' not in columns]
        if not unstamped:
            return 'stamp'
        for topic, columns in read.items():
            logged = columns['log_time']
            if len(logged) > 1 and logged[0] == logged[-1]:
                raise BagError(
                    f'--map: {", ".join(sorted(unstamped))} has no header.stamp, and all messages'
                    f' of {topic} were logged at the same instant: these topics have no clock in'
                    ' common',
                    self.path,
                )
        return 'log_time'


def hold(stamp: Places, values: Column, at: Places) -> Column:
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
    paths: Sequence[str | Path],
    topic: str | None = None,
    maps: Mapping[str, Source] = {},
    actuator: int | None = None,
    on_problem: Callable[[BagError], None] | None = None,
) -> list[Recording]:
    """
    List every valve in files, bags and folders.

    :param paths: MCAP files, bag directories, tables, folders of such.
    :param topic: topic of the measurements; None for all that are called `measurement` or hold
        `damadics_msgs/Measurement`.
    :param maps: where signals are, by `parse_maps`.
    :param actuator: actuator of a table with the plant's tags; None for all.
    :param on_problem: told what is left out: a `NoMeasurementError` where there are recordings
        beside it, else a plain `BagError`. Where it is None, the latter is raised.
    :return: recordings in the order of the paths.
    :raises BagError: where a path holds none.
    """
    found: list[Recording] = []
    for path in map(Path, paths):
        here: list[Recording] = []
        problems: list[BagError] = []
        try:
            for entry in _entries(path):
                here += _recordings(entry, topic, maps, actuator, problems)
        except BagError as error:
            problems.append(error)
        found += here
        for problem in problems:
            beside = here and isinstance(problem, NoMeasurementError)
            if on_problem:
                on_problem(problem if beside else BagError(problem.reason, problem.path or path))
            elif not beside:
                raise problem
    return found


def _entries(path: Path) -> list[Path]:
    """List the tables and bags that a path names."""
    if not path.is_dir():
        return [path] if path.suffix.lower() in TABLES else find_bags(path)
    tables = sorted(p for p in path.iterdir() if p.suffix.lower() in TABLES)
    try:
        return [*tables, *find_bags(path)]
    except BagError:
        if tables:
            return tables
        raise


def _recordings(
    path: Path,
    topic: str | None,
    maps: Mapping[str, Source],
    actuator: int | None,
    problems: list[BagError],
) -> list[Recording]:
    """List the valves in one table or bag; `problems` gets what is left out."""
    try:
        if path.suffix.lower() in TABLES:
            return [Recording(path, table=part) for part in read_table(path, actuator, maps)]
        if maps:
            return [Recording(path, maps=maps)]
        if topic:
            return [Recording(path, topic)]
        topics = measurement_topics(path)
    except BagError as error:
        problems.append(error)
        return []
    if len(topics) > MOST_VALVES:
        problems.append(
            BagError(
                f'holds {len(topics)} valves, more than {MOST_VALVES}: name one: --topic', path
            )
        )
        return []
    problems += [
        NoMeasurementError(f'the topic {name} is empty', path)
        for name, count in topics.items()
        if not count
    ]
    return [Recording(path, name) for name, count in topics.items() if count]


def measurement_topics(path: Path) -> dict[str, int]:
    """
    Count the messages of the topics of a bag that hold measurements of a valve.

    :return: at least one topic; where the file does not tell, its messages count as one.
    :raises NoMeasurementError: where there is none.
    :raises BagError: where it cannot be read.
    """
    kinds: dict[str, str] = {}
    counts: Counter[str] = Counter()
    damage: list[str] = []
    for mcap in open_files(path, damage.append):
        sizes = mcap.stated
        if not mcap.channels:  # no summary: the channels are among the messages
            read: Counter[int] = Counter()
            for batch in mcap.batches():
                read.update({number: len(rows) for number, rows in batch.by_channel()})
            sizes = read
        damage += [problem.text for problem in mcap.problems]
        for channel in mcap.channels.values():
            schema = mcap.schemas.get(channel.schema_id)
            kinds[channel.topic] = full_name(schema.name) if schema else ''
            counts[channel.topic] += sizes.get(channel.id, 0) if sizes else 1
    if damage and not kinds:
        raise BagError(f'{damage[0]}, and nothing in it can be read', path)
    topics = {
        topic: counts[topic]
        for topic, kind in sorted(kinds.items())
        if kind == MEASUREMENT or topic.rsplit('/', 1)[-1] == 'measurement'
    }
    if not topics:
        raise NoMeasurementError(
            f'has no measurement; it has {listing(kinds)}. Name the'
            ' signals: --map cv=/topic.field --map x1=/topic.field',
            path,
        )
    return topics
