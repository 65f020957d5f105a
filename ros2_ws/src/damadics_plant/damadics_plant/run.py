# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A finished run in memory: named columns."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from damadics_plant.actuator.measure import OUTPUTS
from damadics_plant.scenarios.scenario import Scenario

COLUMNS = ('stamp', 'cv', *OUTPUTS)
"""Columns of a run."""

Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Run(Mapping[str, np.ndarray]):
    """
    A finished run: a mapping of names to columns, which are also attributes; `t` in s.

    `stamp` int64 [ns], `cv x1 p1 p2 t1 flow ps` float64 in SI, `fault` int64 (0 while none is
    active), `strength` float64; shape (n,) each.
    """

    scenario: Scenario
    columns: Columns

    def __getattr__(self, name: str) -> np.ndarray:
        """
        Return a column.

        :param name: of the column, or `t` for the time in s.
        :return: shape (n,).
        :raises AttributeError: if there is no such column.
        """
        if name == 't':
            return self.columns['stamp'] / 1e9
        if name == 'columns' or name not in self.columns:  # the former while unpickling
            raise AttributeError(f'a run has no column {name!r}; it has t, {", ".join(COLUMNS)}')
        return self.columns[name]

    def __getitem__(self, name: str) -> np.ndarray:
        """
        Return a column.

        :param name: one of `COLUMNS`.
        :return: shape (n,).
        """
        return self.columns[name]

    def __iter__(self) -> Iterator[str]:
        """
        Go through the names of the columns.

        :return: iterator of names.
        """
        return iter(self.columns)

    def __len__(self) -> int:
        """
        Count the columns.

        :return: number of columns.
        """
        return len(self.columns)

    def view(self, rate: float) -> 'Run':
        """
        Return what a slower recorder sees of this run, for instance SCADA at 1 Hz.

        :param rate: samples per second, a divisor of this run's.
        :return: the run with every n-th sample.
        :raises ValueError: if the rate does not divide, or there is but one sample.
        """
        if len(self.columns['stamp']) < 2:
            raise ValueError('rate: a run of one sample has none')
        own = 1e9 / (self.columns['stamp'][1] - self.columns['stamp'][0])
        every = round(own / rate)
        if every < 1 or not math.isclose(every * rate, own, rel_tol=1e-6):
            raise ValueError(f'rate: {rate:g} Hz does not divide the rate of the run, {own:g} Hz')
        return Run(self.scenario, {k: v[::every] for k, v in self.columns.items()})


def stamps(k: np.ndarray, rate: float) -> np.ndarray:
    """
    Evaluate k / rate in ns, exactly for whole rates.

    :param k: numbers of samples, int64.
    :param rate: samples per second.
    :return: int64 [ns].
    """
    if rate >= 1 and rate == int(rate):
        whole, rest = np.divmod(k, int(rate))
        fraction: np.ndarray = np.rint(rest * 1e9 / rate).astype(np.int64)
        exact: np.ndarray = whole * 1_000_000_000 + fraction
        return exact
    return np.rint(k * 1e9 / rate).astype(np.int64)
