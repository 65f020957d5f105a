# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The table event x detector as text, CSV and rows for a report."""

import csv
import json
import math
from datetime import date
from pathlib import Path

from damadics_evaluate.lublin.evaluation import Evaluation
from damadics_evaluate.lublin.judge import Outcome
from damadics_evaluate.lublin.schedule import AFTER_EVENT, BEFORE_LABEL

SHOWN = 3  # causes in a cell
RULES = (
    f'An alarm from {BEFORE_LABEL:.0f} s before a label to its end counts as found; within '
    f'{AFTER_EVENT:.0f} s after an event nothing is counted. t_dt in s after the label. Events in '
    "brackets count neither way: the record of actuator 2's flow is fault-free at its f19."
)


def event_name(outcome: Outcome) -> str:
    """Return how an event is called in a table."""
    e = outcome.event
    end = f'{e.end:.0f}' if math.isfinite(e.end) else 'open'
    name = f'{e.item} {e.day} A{e.actuator} {e.fault} {e.start:.0f}-{end}'
    return name if e.counts else f'({name})'


def cell(outcome: Outcome) -> str:
    """Return what a detector made of an event, in few characters."""
    if not outcome.found:
        return '- standing' if outcome.note else '-'
    return f'{outcome.t_dt:+.0f} {short(outcome.cause)}'.strip()


def short(cause: str) -> str:
    """
    Return a cause in few characters.

    >>> short('f16 or f17'), short('f1 or f2 or f3 or f4 or f5')
    ('f16/f17', 'f1/f2/f3 +2')
    """
    named = cause.split(' or ')
    more = f' +{len(named) - SHOWN}' if len(named) > SHOWN else ''
    return '/'.join(named[:SHOWN]) + more


def rows(table: Evaluation) -> list[list[str]]:
    """
    Return the table with its header: events, then false alarms per day and actuator, then sums.

    :param table: of `evaluate`.
    """
    by = {(o.event.item, o.detector): o for o in table.outcomes}
    items = sorted({o.event.item for o in table.outcomes})
    lines = [['event', *table.detectors]]
    for item in items:
        known = [by.get((item, name)) for name in table.detectors]
        first = next(o for o in known if o is not None)
        lines.append([event_name(first), *(cell(o) if o else 'refused' for o in known)])
    places = sorted({(q.day, q.actuator) for q in table.quiet})
    for day, actuator in places:
        lines.append(_quiet(table, day, actuator))
    lines.append(['found of those that count', *(_found(table, n) for n in table.detectors)])
    lines.append(
        [
            'false alarms in all',
            *(
                str(sum(len(q.alarms) for q in table.quiet if q.detector == name))
                for name in table.detectors
            ),
        ]
    )
    lines.append(['cause right, alone / among', *(_named(table, n) for n in table.detectors)])
    return lines


def _quiet(table: Evaluation, day: date, actuator: int) -> list[str]:
    by = {q.detector: q for q in table.quiet if (q.day, q.actuator) == (day, actuator)}
    hours = max(q.hours for q in by.values())
    cells = (str(len(by[n].alarms)) if n in by else 'refused' for n in table.detectors)
    return [f'false alarms {day} A{actuator}, {hours:.2f} h', *cells]


def _found(table: Evaluation, name: str) -> str:
    counted = [o for o in table.outcomes if o.detector == name and o.event.counts]
    return f'{sum(o.found for o in counted)}/{len(counted)}'


def _named(table: Evaluation, name: str) -> str:
    found = [o for o in table.outcomes if o.detector == name and o.event.counts and o.found]
    if not any(o.cause for o in found):
        return 'none named'
    alone = sum(o.cause == o.event.fault for o in found)
    among = sum(o.event.fault in o.cause.split(' or ') for o in found)
    return f'{alone} / {among} of {len(found)}'


def as_text(table: Evaluation) -> str:
    """
    Return the whole result as text for a terminal.

    :param table: of `evaluate`.
    """
    grid = rows(table)
    widths = [max(len(row[i]) for row in grid) for i in range(len(grid[0]))]
    lines = [
        '  '.join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip()
        for row in grid
    ]
    return '\n'.join([*lines, '', RULES, '', *notes(table)])


def notes(table: Evaluation) -> list[str]:
    """
    Return what the grid has no room for, one line each.

    :param table: of `evaluate`.
    :return: stretches learned on, false alarms, events not told apart, refusals, absent events.
    """
    lines = []
    for (day, actuator), s in sorted(table.learned.items()):
        lines.append(f'learned on {day} A{actuator}: {s.start:.0f}-{s.end:.0f} s')
    for quiet in table.quiet:
        if quiet.alarms:
            named = (f' ({short(a.cause)})' if a.cause else '' for a in quiet.alarms)
            at = ', '.join(f'{a.start:.0f}{n}' for a, n in zip(quiet.alarms, named, strict=True))
            lines.append(
                f'false alarms of {quiet.detector} on {quiet.day} A{quiet.actuator}: {at}'
            )
    lines += [
        f'not told apart: event {o.event.item} by {o.detector}: {o.note}'
        for o in table.outcomes
        if o.note
    ]
    lines += [f'refused: {text}' for text in table.refused]
    if table.absent:
        names = ', '.join(
            f'{e.item} (A{e.actuator} {e.fault} {e.day} {e.start:.0f})' for e in table.absent
        )
        lines.append(f'absent from these files, {len(table.absent)} of 19: {names}')
    return lines


def write_json(table: Evaluation, file: Path) -> None:
    """
    Write the table for the report of a campaign.

    :param table: of `evaluate`.
    :param file: lublin.json in the campaign's directory.
    """
    content = {'rules': RULES, 'grid': rows(table), 'notes': notes(table)}
    file.write_text(json.dumps(content), encoding='utf-8')


def write_csv(table: Evaluation, file: Path) -> None:
    """
    Write one line per event and detector, then one per day, actuator and detector.

    :param table: of `evaluate`.
    :param file: CSV.
    """
    header = ('kind', 'item', 'day', 'actuator', 'fault', 'start', 'end', 'detector', 't_dt')
    with file.open('w', newline='', encoding='utf-8') as stream:
        writer = csv.writer(stream)
        writer.writerow((*header, 'cause', 'note'))
        for o in table.outcomes:
            e = o.event
            end = f'{e.end:g}' if math.isfinite(e.end) else ''
            t_dt = f'{o.t_dt:g}' if o.found else ''
            writer.writerow(
                ('event' if e.counts else 'uncounted', e.item, e.day, e.actuator, e.fault)
                + (f'{e.start:g}', end, o.detector, t_dt, o.cause, o.note)
            )
        for q in table.quiet:
            for a in q.alarms:
                writer.writerow(
                    ('false alarm', '', q.day, q.actuator, '', f'{a.start:g}', f'{a.end:g}')
                    + (q.detector, '', a.cause, '')
                )
        for e in table.absent:
            end = f'{e.end:g}' if math.isfinite(e.end) else ''
            writer.writerow(
                ('absent', e.item, e.day, e.actuator, e.fault, f'{e.start:g}', end, '', '', '', '')
            )
