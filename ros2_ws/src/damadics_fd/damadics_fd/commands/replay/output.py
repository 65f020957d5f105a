# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Results of a replay as a table for people, JSON, CSV and Parquet."""

import csv
import json
import os
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from damadics_fd.bag.errors import printable
from damadics_fd.commands.replay.outcome import FAILED, NONE, Outcome

FORMATS = ('.json', '.csv', '.parquet')
SHOWN = 8  # detections in the table
COLUMNS = {  # of a row and their types in Parquet
    'bag': 'string',
    'mode': 'string',
    'verdict': 'string',
    'status': 'string',
    'samples': 'int64',
    'duration_s': 'float64',
    'samples_per_s': 'float64',
    't': 'float64',
    'stamp': 'int64',
    'residual': 'float64',
    'threshold': 'float64',
    'ratio': 'float64',
    'level': 'int64',
    'occurrence': 'int64',
    'onset': 'float64',
    'test': 'string',
    'cause': 'string',
    'candidates': 'string',
    'confidence': 'float64',
    'strength': 'float64',
    'spread': 'float64',
    'text': 'string',
    'refused': 'string',
    'problems': 'string',
    'lossy': 'bool',
    'error': 'string',
}


def _pace(samples: float) -> str:
    return f'{samples / 1e6:.2f} M' if samples >= 1e4 else f'{samples:,.0f}'


def print_table(outcomes: Sequence[Outcome]) -> None:
    """Print one line per recording."""
    rows = [('bag', 'mode', 'samples', 'duration', 'samples/s', 'detections [s]')]
    for outcome in outcomes:
        times = [f'{detection["t"]:.4f}' for detection in outcome.detections[:SHOWN]]
        more = len(outcome.detections) - len(times)
        text = ', '.join(times) + (f', and {more} more' if more else '')
        if not text:
            text = NONE if outcome.verdict == NONE else f'none: {outcome.status}'
        refused = sum(outcome.refused.values())
        bag = printable(outcome.bag)
        if outcome.error:
            rows.append((bag, outcome.mode, '', '', '', FAILED))
            continue
        rows.append(
            (
                bag,
                outcome.mode,
                f'{outcome.samples:,}',
                f'{outcome.duration_s:.1f} s',
                _pace(outcome.samples_per_s),
                text + (f'  ({refused} samples refused)' if refused else ''),
            )
        )
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = [
            cell.rjust(width) if 2 <= i <= 4 else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        print('  '.join(cells).rstrip())


def check_format(path: Path) -> None:
    """
    Refuse a file that could not be written, before the work is done.

    :param path: file for the results.
    :raises RuntimeError: where its suffix is none of `FORMATS`, or pyarrow is missing for Parquet.
    """
    if path.suffix not in FORMATS:
        raise RuntimeError(f'--out {path}: the suffix must be one of {", ".join(FORMATS)}')
    if path.suffix == '.parquet' and find_spec('pyarrow') is None:
        raise RuntimeError(f'--out {path}: Parquet needs pyarrow: pip install pyarrow')


def make_folder(folder: Path) -> None:
    """
    Create a folder for results, before the work is done.

    :param folder: the folder.
    :raises RuntimeError: where nothing can be written to it.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RuntimeError(f'{folder} cannot be created: {error.strerror}') from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise RuntimeError(f'{folder} cannot be written to; choose another folder')


def write_outcomes(outcomes: Sequence[Outcome], path: Path) -> None:
    """
    Write results to a file, with one content in every format.

    JSON is a list with one object per recording. CSV and Parquet have one row per detection, and
    one with an empty `t` for a recording without; `refused` and `problems` are JSON in a cell.

    :param outcomes: what became of each recording.
    :param path: file; its suffix chooses the format.
    :raises RuntimeError: as `check_format`.
    """
    check_format(path)
    make_folder(path.parent)
    if path.suffix == '.json':
        text = json.dumps([outcome.content() for outcome in outcomes], indent=1, allow_nan=False)
        path.write_text(text + '\n', encoding='utf-8')
        return
    rows = [row for outcome in outcomes for row in _rows(outcome)]
    if path.suffix == '.csv':
        with path.open('w', encoding='utf-8', newline='') as file:
            writer = csv.DictWriter(file, list(COLUMNS), restval='')
            writer.writeheader()
            writer.writerows(rows)
        return
    import pyarrow
    from pyarrow import parquet

    schema = pyarrow.schema([(name, kind) for name, kind in COLUMNS.items()])
    parquet.write_table(pyarrow.Table.from_pylist(rows, schema=schema), path)


def _rows(outcome: Outcome) -> list[dict[str, object]]:
    """Return a row per detection, or one without."""
    about = outcome.content() | {
        'refused': json.dumps(outcome.refused),
        'problems': json.dumps(outcome.problems, ensure_ascii=False),
    }
    del about['detections']
    return [about | detection for detection in outcome.detections] or [about]
