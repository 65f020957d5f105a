# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Leave single wrong samples of a recording out: nothing that is identified may rest on them."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from damadics_fd.commands.commission.signals import NEEDED
from damadics_fd.core.record import Floats
from damadics_fd.core.settings.identified import FaultFree

FAR = 10.0  # times the median turn from one sample to the next
LEAST = 0.01  # of the spread of the signal, beyond which a sample may be wrong
OF_CV = 0.02  # of the stroke: CV knows no noise
SPREAD = 2.0  # share of the samples on either side that its spread leaves out, %


def wrong_samples(values: Floats, least: float = 0.0) -> NDArray[np.bool_]:
    """
    Find samples that were another, far off, and that the next has come back from.

    :param values: a signal, NaN where it was not measured, shape (n,).
    :param least: distance that counts at least, in its unit.
    :return: mask, shape (n,).

    >>> wrong_samples(np.array([0.5] * 6 + [0.9] + [0.5] * 4 + [0.6] * 4)).nonzero()[0].tolist()
    [6]
    """
    wrong = np.zeros(len(values), bool)
    measured = np.flatnonzero(np.isfinite(values))
    v = values[measured]
    if len(v) < 3:
        return wrong
    low, high = np.percentile(v, [SPREAD, 100.0 - SPREAD])
    left, right = v[1:-1] - v[:-2], v[1:-1] - v[2:]
    turn = float(np.median(np.abs(left + right)))
    far = max(FAR * turn, LEAST * float(high - low), least)
    out = np.minimum(np.abs(left), np.abs(right))
    wrong[measured[1:-1]] = (left * right > 0.0) & (out > far) & (np.abs(right - left) < 0.5 * out)
    return wrong


def without_wrong_samples(
    recordings: Sequence[FaultFree],
) -> tuple[list[FaultFree], dict[str, int]]:
    """
    Return recordings in which wrong samples are not measured.

    :param recordings: of a valve.
    :return: the same where there are none; how many were found, by signal.
    """
    left: list[FaultFree] = []
    found: dict[str, int] = {}
    for recording in recordings:
        columns = dict(recording.columns)
        for name in NEEDED:
            values = np.asarray(columns[name], float)
            wrong = wrong_samples(values, OF_CV if name == 'cv' else 0.0)
            if wrong.any():
                columns[name] = np.where(wrong, np.nan, values)
                found[name] = found.get(name, 0) + int(wrong.sum())
        left.append(FaultFree(recording.name, columns))
    return left, found


def told(found: Mapping[str, int]) -> list[str]:
    """
    Say what was left out.

    :param found: number of wrong samples by signal.
    :return: a remark, or none.
    """
    if not found:
        return []
    numbers = ', '.join(f'{name} {number}' for name, number in found.items())
    return [f'single wrong samples were left out: {numbers}; check wiring, screen and earth']
