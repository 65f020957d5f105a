# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The valve signature of a report: force over position, fault-free and at the end."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from damadics_fd.store.intervals import Series

Line = tuple[tuple[float, float], tuple[float, float]]  # both ends, in the unit square
PAD = 0.08  # of the height, above and below


@dataclass(frozen=True)
class SignatureLines:
    """Both branches, closing and opening, as straight lines over the stroke."""

    before: tuple[Line, Line]
    now: tuple[Line, Line]


def signature_lines(trends: Sequence[tuple[str, Series]]) -> SignatureLines | None:
    """
    Draw what was learned as fault-free and what friction and stiffness are at the end.

    :param trends: quantity and curve.
    :return: the lines; None where the trend does not tell what it was measured against.
    """
    series = dict(trends)
    if not {'friction', 'spring'} <= series.keys():
        return None
    parts = series['friction'].reference[-1].split(',')
    theta = [_number(part) for part in parts]  # stiffness, preload, viscous, dry, / (K L)
    friction, spring = (float(series[name].mean[-1]) for name in ('friction', 'spring'))
    if len(theta) != 4 or not all(map(math.isfinite, (*theta, friction, spring))):
        return None
    stiffness, preload, _, dry = theta
    before = _branches(stiffness, preload, dry)
    now = _branches(stiffness * (1.0 + spring), preload, dry * (1.0 + friction))
    heights = [height for ends in (*before, *now) for height in ends]
    low, high = min(heights), max(heights)
    span = max(high - low, 1e-9)

    def placed(branches: list[tuple[float, float]]) -> tuple[Line, Line]:
        shares = [
            [PAD + (1.0 - 2.0 * PAD) * (height - low) / span for height in ends]
            for ends in branches
        ]
        up, down = (((0.0, left), (1.0, right)) for left, right in shares)
        return up, down

    return SignatureLines(placed(before), placed(now))


def _branches(stiffness: float, preload: float, dry: float) -> list[tuple[float, float]]:
    return [(preload + f, stiffness + preload + f) for f in (dry, -dry)]


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
