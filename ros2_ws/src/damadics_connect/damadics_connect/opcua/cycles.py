# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Count how often the stem of each valve begins to move, over restarts."""

import json
import os
import time
from collections.abc import Sequence
from pathlib import Path

from damadics_fd.core.sample import SIGNALS

from damadics_connect.publishing import Output, ValveName

X1 = SIGNALS.index('x1')
MOVES, RESTS = 0.005, 0.002  # of the stroke between two samples: above it moves, below it rests
SAVE = 60.0  # s between two writes


class Cycles:
    """
    An output that counts what it passes on.

    :param output: takes the samples.
    :param valves: in the order of their numbers.
    :param path: where the counts are kept.
    """

    def __init__(self, output: Output, valves: Sequence[ValveName], path: Path) -> None:
        self._output = output
        self._names = [valve.name for valve in valves]
        self._path = path
        self._due = time.monotonic() + SAVE
        self._last = [float('nan')] * len(valves)
        self._moves = [False] * len(valves)
        kept: dict[str, int] = {}
        if path.is_file():
            try:
                content = json.loads(path.read_text())
                kept = {str(k): int(v) for k, v in content.items()}
            except (ValueError, AttributeError, TypeError):
                kept = {}
        self.counts = {name: max(0, kept.get(name, 0)) for name in self._names}

    @property
    def samples(self) -> int:
        """Samples passed on."""
        return self._output.samples

    @property
    def zero(self) -> set[str]:
        """Valves whose pressures are all exactly 0."""
        return self._output.zero

    def send(self, valve: int, stamp: int, values: list[float]) -> None:
        """Count and pass on."""
        x1 = values[X1]
        step = abs(x1 - self._last[valve])
        self._last[valve] = x1
        if step > MOVES and not self._moves[valve]:
            self._moves[valve] = True
            self.counts[self._names[valve]] += 1
        elif step < RESTS:
            self._moves[valve] = False
        self._output.send(valve, stamp, values)

    def flush(self) -> None:
        """Pass on, and write the counts once a minute."""
        self._output.flush()
        if time.monotonic() >= self._due:
            self._due = time.monotonic() + SAVE
            self.save()

    def save(self) -> None:
        """Write the counts; a disk that is full does not stop the samples."""
        beside = self._path.with_suffix('.new')
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with beside.open('w') as file:
                json.dump(self.counts, file)
                file.flush()
                os.fsync(file.fileno())
            beside.replace(self._path)
        except OSError:
            self._due = time.monotonic() + SAVE
