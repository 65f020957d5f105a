# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of many valves that lie in one file, read in one pass."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from damadics_fd.bag.arrays import Column, Columns
from damadics_fd.bag.blocks.reader import BlockReader
from damadics_fd.bag.recording import Recording, Told

GATHERED = 1 << 20  # rows in memory at once
Source = tuple[str, str]


def source_of(recording: Recording) -> Source | None:
    """
    Tell where a recording lies among those of other valves.

    :param recording: one valve.
    :return: the same for all valves that one pass reads; None where it lies alone.
    """
    if recording.valve:
        return str(recording.path), recording.topic
    if recording.table and recording.table.valve is not None:
        return str(recording.path), ''
    return None


def read_together(
    recordings: Sequence[Recording], on_problem: Told
) -> Iterator[tuple[int, Columns]]:
    """
    Read recordings of one source.

    :param recordings: of which `source_of` is the same.
    :param on_problem: told each damaged or odd place, which is left out.
    :return: index of a recording and its next rows, each again and again.
    :raises BagError: where the file cannot be read.
    """
    first = recordings[0]
    if first.table:
        names = [one.table.valve or '' for one in recordings if one.table]
        yield from by_valve(first.table.rows(names, on_problem))
        return
    reader = BlockReader(first.path, first.topic, on_problem)
    index = np.full(len(reader.names) + 1, -1)
    number = {name: n for n, name in enumerate(reader.names)}
    for n, recording in enumerate(recordings):
        index[number.get(recording.valve, -1)] = n
    index[-1] = -1  # of a valve that the file has lost since
    yield from by_valve(_own(reader.rows(), index))


def _own(pieces: Iterable[Columns], index: Column) -> Iterator[Columns]:
    """Keep the rows of some valves; `index` gives their new numbers, -1 for the others."""
    for piece in pieces:
        valve = index[piece['valve']]
        own = valve >= 0
        if own.all():
            yield {**piece, 'valve': valve}
        elif own.any():
            yield {name: column[own] for name, column in {**piece, 'valve': valve}.items()}


def by_valve(pieces: Iterable[Columns], most: int = GATHERED) -> Iterator[tuple[int, Columns]]:
    """
    Sort rows by valve, many at a time.

    :param pieces: columns of rows with their `valve`.
    :param most: rows that are gathered before they are handed on.
    :return: the number of a valve and its rows, in their order; each valve again and again.
    """
    waiting: list[Columns] = []
    count = 0
    for piece in pieces:
        waiting.append(piece)
        count += len(piece['valve'])
        if count >= most:
            yield from _sorted(waiting)
            waiting, count = [], 0
    if waiting:
        yield from _sorted(waiting)


def _sorted(pieces: list[Columns]) -> Iterator[tuple[int, Columns]]:
    rows = {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}
    order = np.argsort(rows['valve'], kind='stable')
    valve = rows.pop('valve')[order]
    columns = {name: column[order] for name, column in rows.items()}
    first = 0
    for end in (np.flatnonzero(np.diff(valve, append=-1)) + 1).tolist():
        yield int(valve[first]), {name: column[first:end] for name, column in columns.items()}
        first = end
