# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a run amounts to, and many of them."""

from typing import NotRequired, TypedDict

import numpy as np
from damadics_fd.core.approximator.estimator import Estimator
from damadics_fd.core.modes import PHASE_MONITOR
from damadics_fd.core.result import Result

from damadics_evaluate.plain import Told


def seconds(result: Result) -> list[float]:
    return [round(event.stamp * 1e-9, 4) for event in result.detections]


def approximator(result: Result) -> Estimator:
    if not isinstance(result.estimator, Estimator):
        raise TypeError('these studies are of mode monitor')
    return result.estimator


class Summary(TypedDict):
    """What one run amounts to."""

    alarms: list[float]  # s
    refusals: int  # to arm
    armed: float | None  # s, since when it monitors
    phi: float
    ratio: float  # largest residual / threshold
    strength_at_alarm: NotRequired[float | None]
    stays_flagged: NotRequired[bool]


def summary(result: Result) -> Summary:
    phase = result.estimates['phase']
    armed = np.flatnonzero(phase == PHASE_MONITOR)
    decisions = result.decisions
    counts = (decisions['threshold'] > 0) & (phase == PHASE_MONITOR)
    x = result.estimates['x1']
    counts &= (x > 0.02) & (x < 0.965)
    return {
        'alarms': seconds(result),
        'refusals': int(approximator(result).state[0].unsettled),
        'armed': float(result.estimates['stamp'][armed[0]] * 1e-9) if len(armed) else None,
        'phi': float(result.estimates['phi'][-1]),
        'ratio': float(decisions['ratio'][counts].max()) if counts.any() else 0.0,
    }


def told(row: Summary) -> Told:
    """Return the summary of a run with an incipient fault for JSON."""
    return {
        'alarms': row['alarms'],
        'refusals': row['refusals'],
        'armed': row['armed'],
        'phi': row['phi'],
        'ratio': row['ratio'],
        'strength_at_alarm': row.get('strength_at_alarm'),
        'stays_flagged': row.get('stays_flagged'),
    }


def delays(rows: list[Summary], start: float = 70.0) -> Told:
    """Sum up runs with a fault: false alarms before it, misses, time of the first alarm."""
    early = sum(any(t < start for t in row['alarms']) for row in rows)
    first = [min((t for t in row['alarms'] if t >= start), default=np.inf) for row in rows]
    found = [t for t in first if np.isfinite(t)]
    low, median, high = np.percentile(found, [10, 50, 90]) if found else (np.nan,) * 3
    return {
        'runs': len(rows),
        'false_alarms': early,
        'missed': len(rows) - len(found),
        'p10': round(float(low), 3),
        'median': round(float(median), 3),
        'p90': round(float(high), 3),
        'worst': max(found, default=None),
        'not_armed_at_60s': sum(row['armed'] is None or row['armed'] > 60.1 for row in rows),
    }


def quiet(rows: list[Summary]) -> Told:
    """Sum up runs without a fault."""
    ratio = [row['ratio'] for row in rows]
    return {
        'runs': len(rows),
        'false_alarms': sum(bool(row['alarms']) for row in rows),
        'refused_to_arm': sum(row['refusals'] > 0 for row in rows),
        'not_armed_at_60s': sum(row['armed'] is None or row['armed'] > 60.1 for row in rows),
        'largest_ratio_median': round(float(np.median(ratio)), 3),
        'largest_ratio_max': round(float(np.max(ratio)), 3),
    }
