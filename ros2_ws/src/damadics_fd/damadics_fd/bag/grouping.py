# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Rows by the number they belong to, without a look at all rows for each number."""

import numpy as np
from numpy.typing import NDArray


def grouped(numbers: NDArray[np.integer]) -> list[tuple[int, NDArray[np.int64]]]:
    """
    Return each number with the rows where it stands.

    >>> [(number, rows.tolist()) for number, rows in grouped(np.array([7, 3, 7]))]
    [(3, [1]), (7, [0, 2])]
    """
    if not len(numbers):
        return []
    if (numbers == numbers[0]).all():
        return [(int(numbers[0]), np.arange(len(numbers)))]
    order = np.argsort(numbers, kind='stable')
    firsts = np.flatnonzero(np.diff(numbers[order].astype(np.int64), prepend=-1))
    parts = np.split(order, firsts[1:])
    return [(int(numbers[rows[0]]), rows) for rows in parts]
