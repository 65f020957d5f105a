# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings as columns at one sample per period: CSV, MCAP, bag folders, Parquet."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.mapping import Source
from damadics_fd.bag.recording import Recording, find_recordings, parse_maps

from damadics_evaluate.columns import NANOSECONDS, SIGNALS, Columns

PARQUET = '.parquet'


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
    :return: columns by name of the recording.
    :raises ValueError: where a recording cannot be read.
    """
    found: dict[str, Columns] = {}
    for path in paths:
        if path.suffix.lower() == PARQUET:
            found[str(path)] = thinned(_parquet(path, maps), period)
            continue
        try:
            for recording in find_recordings([path], maps=parse_maps(maps), actuator=actuator):
                found[recording.name] = thinned(_columns(recording, tell), period)
        except BagError as error:
            raise ValueError(str(error)) from error
    return found


def _columns(recording: Recording, tell: Callable[[str], None]) -> Columns:
    parts = list(recording.chunks(tell))
    if not parts or not sum(len(part['stamp']) for part in parts):
        raise ValueError(f'{recording.name}: holds no sample')
    names = [name for name in ('stamp', *SIGNALS) if all(name in part for part in parts)]
    return {name: np.concatenate([part[name] for part in parts]) for name in names}


def _parquet(path: Path, texts: list[str]) -> Columns:
    """Read a Parquet file: `stamp` (ns) or `t` (s), and the signals by name or map."""
    try:
        from pyarrow import ArrowException, parquet
    except ImportError as error:
        raise ValueError(f'{path}: Parquet needs pyarrow: pip install pyarrow') from error
    try:
        table = parquet.read_table(path)
    except (OSError, ArrowException) as error:
        raise ValueError(f'{path}: cannot be read as Parquet: {error}') from error
    maps = parse_maps(texts)
    columns: Columns = {}
    for signal in ('stamp', 't', *SIGNALS):
        source = maps.get(signal, Source(signal))
        if source.name in table.column_names:
            values = table[source.name].to_numpy()
            columns[signal] = source.scale(values) if signal in maps else values
    if 'stamp' not in columns and 't' in columns:
        columns['stamp'] = np.round(columns['t'] * NANOSECONDS)
    columns.pop('t', None)
    missing = [name for name in ('stamp', 'cv', 'x1') if name not in columns]
    if missing:
        raise ValueError(
            f'{path}: no {", ".join(missing)}; it has {", ".join(table.column_names)}; name them: '
            '--map cv=COLUMN'
        )
    columns['stamp'] = columns['stamp'].astype('datetime64[ns]').astype(np.int64)
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
