# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Labels: which stretch of which recording is fault-free, which holds which fault."""

import csv
import math
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

LEARN, FREE, FAULT = 'learn', 'free', 'fault'
COLUMNS = ('recording', 'kind', 'start', 'end', 'fault')
EXAMPLE = (
    'recording,kind,start,end,fault\nmonday.mcap,learn,0,900,\nmonday.mcap,fault,3600,3900,f16\n'
)


@dataclass(frozen=True)
class Label:
    """
    One line of a file of labels.

    :param recording: file name as given on the command line, or its last part.
    :param kind: LEARN, FREE or FAULT.
    :param start: s since the recording's first sample, or Unix time in s.
    :param end: the same; infinite for the end of the recording.
    :param fault: such as f16; empty for LEARN and FREE.
    """

    recording: str
    kind: str
    start: float
    end: float
    fault: str = ''


def read_labels(file: Path) -> list[Label]:
    """
    Read a file of labels.

    :param file: CSV with the header recording,kind,start,end,fault; times in s since the first
        sample of the recording, or as dates such as 2001-11-17T15:58:00Z.
    :return: labels in the order of the file.
    :raises ValueError: naming every wrong line.
    """
    try:
        with file.open(newline='', encoding='utf-8') as stream:
            reader = csv.DictReader(stream)
            header = tuple(reader.fieldnames or ())
            lines = list(reader)
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f'{file} cannot be read: {error}') from error
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        raise ValueError(f'{file}: no column {", ".join(missing)}; such a file begins\n{EXAMPLE}')
    labels, wrong = [], []
    for number, line in enumerate(lines, 2):
        try:
            labels.append(_label(line))
        except ValueError as error:
            wrong.append(f'{file}, line {number}: {error}')
    if wrong:
        raise ValueError('; '.join(wrong))
    if not any(label.kind == LEARN for label in labels):
        raise ValueError(
            f'{file}: no stretch to learn from; add a line of kind {LEARN}, fault-free and 300 s '
            'or longer'
        )
    return labels


def _label(line: dict[str, str | None]) -> Label:
    name, kind = (line['recording'] or '').strip(), (line['kind'] or '').strip()
    start, end = _time(line['start'], 0.0), _time(line['end'], math.inf)
    fault = (line['fault'] or '').strip()
    if kind not in (LEARN, FREE, FAULT):
        raise ValueError(f'kind {kind!r} is not one of {LEARN}, {FREE}, {FAULT}')
    if not name:
        raise ValueError('names no recording')
    if not start < end:
        raise ValueError(f'ends at {end:g}, before it starts at {start:g}')
    if kind == FAULT and not fault:
        raise ValueError('names no fault')
    return Label(name, kind, start, end, fault)


def _time(text: str | None, absent: float) -> float:
    text = (text or '').strip()
    if not text:
        return absent
    try:
        return float(text)
    except ValueError:
        pass  # a date
    try:
        return datetime.fromisoformat(text).timestamp()
    except ValueError as error:
        raise ValueError(
            f'{text!r} is neither seconds nor a date such as 2001-11-17T15:58:00Z'
        ) from error
