# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Keep of a long run what a picture can show."""

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.arrays import Columns
from damadics_fd.core.result import Result

MOST_ROWS = 60_000  # kept, before they are thinned further
KEPT = 11  # rows of a block at most: its first, and the extremes of five signals
STEP = 8  # by which blocks grow
DRAWN = ('cv', 'x1', 'fault', 'strength')


class Thinner:
    """
    Collect the rows of a run; where they become too many, keep the extremes of each block.

    The rows with the extremes of every drawn signal are kept, and all changes of the flag, so that
    no spike and no detection is lost.
    """

    def __init__(self) -> None:
        self._pieces: list[tuple[Result, Columns]] = []
        self._rows = 0
        self._block = 0  # rows of the run in a block, 0 while all are kept

    def add(self, columns: Columns, result: Result) -> None:
        """Take the next piece of the run."""
        kept = {name: columns[name] for name in ('stamp', *DRAWN) if name in columns}
        self._append(result, kept, self._block)
        if self._rows > MOST_ROWS:
            self._block = self._block * STEP or KEPT * STEP
            whole = self.thinned()
            self._pieces, self._rows = [], 0
            self._append(*whole, KEPT * STEP)

    def _append(self, result: Result, columns: Columns, block: int) -> None:
        if block:
            rows = _extremes(columns, result, block)
            columns = {name: values[rows] for name, values in columns.items()}
            result = Result(
                result.reason[rows],
                result.estimates[rows],
                result.decisions[rows],
                result.estimator,
                result.detector,
            )
        self._pieces.append((result, columns))
        self._rows += len(result.reason)

    def thinned(self) -> tuple[Result, Columns]:
        """Return the rows kept, as a result and its columns."""
        results = [result for result, _ in self._pieces]
        names = self._pieces[0][1].keys()
        joined = Result(
            np.concatenate([result.reason for result in results]),
            np.concatenate([result.estimates for result in results]),
            np.concatenate([result.decisions for result in results]),
            results[-1].estimator,
            results[-1].detector,
        )
        return joined, {
            name: np.concatenate([columns[name] for _, columns in self._pieces]) for name in names
        }


def _extremes(columns: Columns, result: Result, block: int) -> NDArray[np.intp]:
    """Return the rows to keep, in order; what is left behind whole blocks is a block, too."""
    count = len(columns['stamp'])
    whole = count // block * block
    first = np.arange(0, whole, block)
    keep = [first, np.arange(whole, min(whole + 1, count))]
    for signal in (
        result.estimates['xi1'],
        result.estimates['xi2'],
        result.decisions['residual'],
        columns['x1'],
        columns['cv'],
    ):
        values = np.nan_to_num(signal)
        blocks = values[:whole].reshape(len(first), min(block, count))
        keep += [first + blocks.argmin(1), first + blocks.argmax(1)]
        if whole < count:
            keep.append(whole + np.array([values[whole:].argmin(), values[whole:].argmax()]))
    changes = np.flatnonzero(np.diff(result.decisions['fault'].astype(np.int8)))
    keep += [changes, changes + 1, np.flatnonzero(result.decisions['transitions'])]
    return np.unique(np.concatenate(keep))
