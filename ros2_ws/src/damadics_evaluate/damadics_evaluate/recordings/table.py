# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The table of labelled recordings, as text and CSV."""

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from damadics_evaluate.recordings.evaluation import EventResult, Table
from damadics_evaluate.recordings.intervals import median_interval, rate_interval, share_interval


@dataclass(frozen=True)
class Row:
    """One detector over all recordings; every figure with its 95 % interval as text."""

    detector: str
    found: str
    t_dt: str
    r_fd: str
    r_td: str
    named: str
    t_it: str
    per_day: str


HEADER = (
    'detector',
    'found [95 %]',
    't_dt s, median [95 %]',
    'r_fd',
    'r_td',
    'named right [95 %]',
    't_it s',
    'false alarms per day [95 %]',
)


def rows(table: Table) -> list[Row]:
    """
    Return one row per detector that was not refused everywhere.

    :param table: of `evaluate`.
    """
    judged = {detector for detector, _ in table.false_alarms}
    return [_row(table, name) for name in table.detectors if name in judged]


def _row(table: Table, name: str) -> Row:
    events = [e for e in table.events if e.detector == name]
    found = [e for e in events if math.isfinite(e.t_dt)]
    named = [e for e in found if e.cause]
    right = sum(e.cause == e.label.fault for e in named)
    places = [place for detector, place in table.false_alarms if detector == name]
    alarms = sum(len(table.false_alarms[name, place]) for place in places)
    days = sum(table.days[place] for place in places)
    return Row(
        name,
        _share(len(found), len(events)),
        _median([e.t_dt for e in events]),
        _mean([e.r_fd for e in events]),
        _mean([e.r_td for e in events]),
        _share(right, len(found)) if named else 'names none',
        _median([e.t_it for e in events]) if named else '-',
        _rate(alarms, days),
    )


def _share(hits: int, of: int) -> str:
    if not of:
        return '-'
    low, high = share_interval(hits, of)
    return f'{hits}/{of} [{low:.2f}, {high:.2f}]'


def _median(values: Sequence[float]) -> str:
    if not values:
        return '-'
    low, high = median_interval(values)
    return f'{_number(median(values))} [{_number(low)}, {_number(high)}]'


def _number(value: float) -> str:
    if math.isnan(value):
        return '-'
    if math.isinf(value):
        return 'never' if value > 0 else '?'
    return f'{value:.3g}'


def _mean(values: Sequence[float]) -> str:
    known = [v for v in values if not math.isnan(v)]
    return f'{sum(known) / len(known):.3f}' if known else '-'


def _rate(alarms: int, days: float) -> str:
    if days <= 0.0:
        return '-'
    low, high = rate_interval(alarms, days)
    return f'{alarms / days:.3g} [{low:.2g}, {high:.2g}] ({alarms} in {days:.3g} d)'


def as_text(table: Table) -> str:
    """
    Return the result as text for a terminal.

    :param table: of `evaluate`.
    """
    grid = [HEADER, *(tuple(vars(row).values()) for row in rows(table))]
    widths = [max(len(line[i]) for line in grid) for i in range(len(HEADER))]
    lines = [
        '  '.join(text.ljust(width) for text, width in zip(line, widths, strict=True)).rstrip()
        for line in grid
    ]
    lines.append('')
    for event in table.events:
        lines.append(_line(event))
    for (detector, place), alarms in table.false_alarms.items():
        if alarms:
            at = ', '.join(f'{a.start:.0f}' for a in alarms)
            lines.append(f'false alarms of {detector} in {place}: at {at} s')
    return '\n'.join([*lines, *(f'refused: {text}' for text in table.refused)])


def _line(e: EventResult) -> str:
    where = f'{Path(e.recording).name} {e.label.fault} {e.label.start:.0f}-{e.label.end:.0f}'
    if not math.isfinite(e.t_dt):
        return f'{where}: {e.detector} does not find it'
    named = f', names {e.cause}' if e.cause else ''
    return f'{where}: {e.detector} after {e.t_dt:.3g} s, r_td {e.r_td:.3f}{named}'


def write_csv(table: Table, file: Path) -> None:
    """
    Write one line per event and detector.

    :param table: of `evaluate`.
    :param file: CSV.
    """
    with file.open('w', newline='', encoding='utf-8') as stream:
        writer = csv.writer(stream)
        writer.writerow(
            ('recording', 'fault', 'start', 'end', 'detector')
            + ('t_dt', 'r_fd', 'r_td', 't_it', 'r_ti', 'cause')
        )
        for e in table.events:
            figures = (e.t_dt, e.r_fd, e.r_td, e.t_it, e.r_ti)
            writer.writerow(
                (e.recording, e.label.fault, e.label.start, e.label.end, e.detector)
                + tuple(f'{v:g}' if math.isfinite(v) else '' for v in figures)
                + (e.cause,)
            )
