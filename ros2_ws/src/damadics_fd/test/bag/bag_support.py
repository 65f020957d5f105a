# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the tests of recordings share."""

import json
from pathlib import Path

import numpy as np
import pytest
from damadics_fd.bag import BagError
from damadics_fd.bag.cdr.definition import type_hash
from damadics_fd.commands.replay.replay import main

MEASUREMENT = 'damadics_msgs/msg/Measurement'
FAULT_STATE = 'damadics_msgs/msg/FaultState'
SIGNALS = ('cv', 'x1', 'p1', 'p2', 't1', 'flow')


def built() -> bool:
    """Tell whether the messages are installed."""
    try:
        return bool(type_hash(MEASUREMENT))
    except BagError:
        return False


needs_messages = pytest.mark.skipif(
    not built(), reason='damadics_msgs is not built: run make build and source env.sh'
)


def simulated(n: int = 4000) -> dict[str, np.ndarray]:
    """Return columns like those of the simulator, all values different."""
    t = np.arange(n) * 2_500_000
    rng = np.random.default_rng(1)
    return {
        'stamp': t + 5_999_999_999,
        **{name: rng.random(n) for name in SIGNALS},
        'fault': np.where(t > 3_000_000_000, 4, 0),
        'strength': rng.random(n),
    }


def stroke(n: int = 12_000, rate: float = 400.0) -> dict[str, np.ndarray]:
    """A stem that sticks and jumps at 20 s."""
    t = np.arange(1, n + 1) / rate
    x1 = np.clip((t - 2.0) * 0.05, 0.0, 1.0)
    x1[t >= 20.0] += 0.01
    columns = {
        name: np.full(n, value)
        for name, value in {'p1': 3.5e6, 'p2': 2.6e6, 't1': 20.0, 'flow': 8.0, 'ps': 1e5}.items()
    }
    return columns | {
        'stamp': np.round(t * 1e9).astype(np.int64),
        'cv': np.ones(n),
        'x1': x1,
        'fault': np.where(t >= 20.0, 4, 0),
        'strength': np.where(t >= 20.0, 1.0, 0.0),
    }


def as_csv(columns: dict[str, np.ndarray], path: Path, header: str = '') -> Path:
    names = ['cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps', 'fault', 'strength']
    with path.open('w') as file:
        file.write((header or ','.join(['t', *names])) + '\n')
        for row in zip(columns['stamp'] / 1e9, *(columns[n] for n in names), strict=True):
            file.write(','.join(map(repr, map(float, row))) + '\n')
    return path


def replayed(*args: object, code: int = 0) -> list[dict]:
    out = Path(str(args[0])).parent / 'result.json'
    assert main([*map(str, args), '--mode', 'paper', '--out', str(out), '--jobs', '1']) == code
    return json.loads(out.read_text())
