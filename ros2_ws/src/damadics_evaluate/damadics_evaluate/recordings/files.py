# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings as columns at one sample per period: CSV, MCAP, bag folders, Parquet."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from damadics_fd.bag.blocks.together import read_together, source_of
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.recording import Recording, find_recordings, parse_maps

from damadics_evaluate.columns import NANOSECONDS, SIGNALS, Columns


def read_recordings(
    paths: list[Path],
    maps: list[str],
    actuator: int | None,
    period: float,
    tell: Callable[[str], None],
) -> dict[str, Columns]:
    """
    Read recordings.

    :param paths: files and folders.
    :param maps: where signals are, as `replay --map` takes them: x1=COLUMN*0.01.
    :param actuator: of a table with the tags of the plant of Lublin.
    :param period: s; faster recordings are thinned to it.
    :param tell: told of everything that is left out.
    :return: columns by name of the recording, one for each valve.
    :raises ValueError: where a recording cannot be read.
    """
    found: dict[str, Columns] = {}
    try:
        recordings = find_recordings(paths, maps=parse_maps(maps), actuator=actuator)
        together: dict[object, list[Recording]] = {}
        for number, recording in enumerate(recordings):
            together.setdefault(source_of(recording) or number, []).append(recording)
        for some in together.values():
            found |= {
                name: thinned(columns, period) for name, columns in _columns(some, tell).items()
            }
    except BagError as error:
        raise ValueError(str(error)) from error
    return {one.name: found[one.name] for one in recordings if one.name in found}


def _columns(recordings: list[Recording], tell: Callable[[str], None]) -> dict[str, Columns]:
    """Read one recording, or the valves of one file in one pass."""
    parts: dict[str, list[Columns]] = {one.name: [] for one in recordings}
    if source_of(recordings[0]):
        for number, piece in read_together(recordings, tell):
            parts[recordings[number].name].append(piece)
    else:
        parts[recordings[0].name] += recordings[0].chunks(tell)
    columns: dict[str, Columns] = {}
    for name, pieces in parts.items():
        if not sum(len(piece['stamp']) for piece in pieces):
            if len(parts) == 1:
                raise ValueError(f'{name}: holds no sample')
            tell(f'{name}: holds no sample and is left out')
            continue
        kept = [kind for kind in ('stamp', *SIGNALS) if all(kind in piece for piece in pieces)]
        columns[name] = {kind: np.concatenate([piece[kind] for piece in pieces]) for kind in kept}
    return columns


def thinned(columns: Columns, period: float) -> Columns:
    """
    Return one sample per period, the first of each, in order of time.

    :param period: s.
    """
    order = np.argsort(columns['stamp'], kind='stable')
    stamp = columns['stamp'][order]
    if len(stamp) < 2 or float(np.median(np.diff(stamp))) > 0.75 * period * NANOSECONDS:
        first = np.arange(len(stamp))
    else:
        _, first = np.unique((stamp - stamp[0]) // int(period * NANOSECONDS), return_index=True)
    kept = order[first]
    return {name: np.asarray(values)[kept] for name, values in columns.items()}
