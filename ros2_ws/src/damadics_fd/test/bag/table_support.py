# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A recording as text, and what is read of it."""

from datetime import UTC, datetime

import numpy as np
import pytest
from damadics_fd.bag.mapping import parse_maps
from damadics_fd.bag.recording import find_recordings

PLAIN = 't,cv,x1,ps'
N = 50
CV = np.linspace(0.0, 1.0, N)
START = int(datetime(2026, 11, 25, 14, tzinfo=UTC).timestamp()) * 10**9
STAMP = START + np.arange(N) * 5_000_000
VALUES = {'cv': CV, 'x1': CV / 2, 'ps': 1e5 + 1e5 * CV}


def cell(value: float, decimal: str = '.') -> str:
    return repr(float(value)).replace('.', decimal)


def iso(stamp: int, zone: str = '', mark: str = 'T', ahead: int = 0) -> str:
    seconds, rest = divmod(int(stamp) + ahead * 3600 * 10**9, 10**9)
    text = datetime.fromtimestamp(seconds, UTC).strftime(f'%Y-%m-%d{mark}%H:%M:%S')
    return f'{text}.{rest // 1000:06d}{zone}'


def rows(head: str, time, delimiter: str = ',', decimal: str = '.', scales=(1.0, 1.0, 1.0)) -> str:
    lines = [head]
    for i in range(N):
        values = [cell(VALUES[n][i] * s, decimal) for n, s in zip(VALUES, scales, strict=True)]
        lines.append(delimiter.join([time(i), *values]))
    return '\n'.join(lines) + '\n'


def columns_of(path, *maps: str, problems: list | None = None) -> dict[str, np.ndarray]:
    (recording,) = find_recordings([path], maps=parse_maps(maps))
    tell = pytest.fail if problems is None else problems.append
    parts = list(recording.chunks(tell))
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
