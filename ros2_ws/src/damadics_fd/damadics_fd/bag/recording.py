# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Anything that holds measurements of a valve, as a stream of columns."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from damadics_fd.bag.arrays import Columns
from damadics_fd.bag.blocks.layouts import BLOCK
from damadics_fd.bag.blocks.reader import BlockReader
from damadics_fd.bag.cdr.definition import full_name
from damadics_fd.bag.cdr.mapped import mapped
from damadics_fd.bag.columns import iter_columns, listing, open_files, read_columns
from damadics_fd.bag.errors import BagError, NoMeasurementError
from damadics_fd.bag.mapping import SIGNALS, Source, parse_maps
from damadics_fd.bag.sources import find_bags
from damadics_fd.bag.tables.table import Table, read_table

TABLES = ('.csv', '.txt', '.tsv', '.parquet', '.pq')
MEASUREMENT = 'damadics_msgs/msg/Measurement'
__all__ = ['SIGNALS', 'Recording', 'find_recordings', 'parse_maps']
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
    :param valve: namespace of the valve where the topic holds blocks of many.
    :param tag: tag of the actuator, where blocks name it.
    """

    path: Path
    topic: str = '/measurement'
    maps: Mapping[str, Source] = field(default_factory=dict)
    table: Table | None = None
    valve: str = ''
    tag: str = ''

    @property
    def name(self) -> str:
        """What to call it."""
        if self.table and self.table.name:
            return f'{self.path}#{self.table.name}'
        if self.valve:
            return f'{self.path}#{self.valve}'
        special = not self.maps and self.topic != '/measurement' and not self.table
        return f'{self.path}#{self.topic}' if special else str(self.path)

    @property
    def place(self) -> str:
        """Namespace of the valve in its bag, with a slash behind."""
        return f'{self.valve}/' if self.valve else self.topic.removesuffix('measurement')

    def chunks(self, on_problem: Told) -> Iterator[Columns]:
        """
        Yield its columns piece by piece.

        :param on_problem: told each damaged place, which is left out.
        :raises BagError: where it cannot be read.
        """
        if self.table:
            yield from self.table.chunks(on_problem)
        elif self.maps:
            yield mapped(self.path, self.maps, on_problem)
        else:
            for columns in iter_columns(
                self.path, self.topic, valve=self.valve, on_problem=on_problem
            ):
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
        try:
            return read_columns(
                self.path, self.place + 'fault_state', ['fault', 'strength'], on_problem=on_problem
            )
        except BagError:
            return None  # real valves do not tell


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
        kinds, counts = _topics(path)
        blocks = [name for name, kind in sorted(kinds.items()) if kind == BLOCK and counts[name]]
        if topic:
            return _named(path, topic, [*kinds], blocks)
        topics = _measurements(kinds, counts)
    except BagError as error:
        problems.append(error)
        return []
    found: list[Recording] = []
    for name in blocks:
        try:
            found += _in_blocks(path, name)
        except BagError as error:
            problems.append(error)
    if not topics and not blocks:
        problems.append(
            NoMeasurementError(
                f'has no measurement; it has {listing(kinds)}. Name the'
                ' signals: --map cv=/topic.field --map x1=/topic.field',
                path,
            )
        )
    if len(topics) > MOST_VALVES:
        problems.append(
            BagError(
                f'holds {len(topics)} valves, more than {MOST_VALVES}: name one: --topic', path
            )
        )
        return found
    problems += [
        NoMeasurementError(f'the topic {name} is empty', path)
        for name, count in topics.items()
        if not count
    ]
    return [*(Recording(path, name) for name, count in topics.items() if count), *found]


def _in_blocks(path: Path, topic: str) -> list[Recording]:
    """List the valves of the blocks of a topic."""
    reader = BlockReader(path, topic, lambda text: None)  # what is odd is told when it is replayed
    return [Recording(path, topic, valve=name, tag=reader.tags[name]) for name in reader.names]


def _named(
    path: Path, topic: str, present: Sequence[str], blocks: Sequence[str]
) -> list[Recording]:
    """Return what `--topic` names: a topic, all valves of blocks, or one of these valves."""
    bare = topic.lstrip('/')
    for name in (topic, '/' + bare, bare):
        if name in blocks:
            return _in_blocks(path, name)
        if name in present:
            return [Recording(path, topic)]
    valve = '/' + bare.removesuffix('/measurement').strip('/')
    found = [one for name in blocks for one in _in_blocks(path, name) if one.valve == valve]
    return found or [Recording(path, topic)]


def _topics(path: Path) -> tuple[dict[str, str], Counter[str]]:
    """
    List the topics of a bag.

    :return: type and number of messages of each; where the file does not tell, these count as one.
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
    return kinds, counts


def _measurements(kinds: Mapping[str, str], counts: Mapping[str, int]) -> dict[str, int]:
    """Count the messages of the topics of a bag that hold measurements of one valve each."""
    return {
        topic: counts[topic]
        for topic, kind in sorted(kinds.items())
        if kind == MEASUREMENT or topic.rsplit('/', 1)[-1] == 'measurement'
    }
