# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Two campaigns side by side, paired over the seeds that both have."""

import math
from collections.abc import Sequence

from damadics_evaluate.benchmark.results import Result
from damadics_evaluate.benchmark.tables import delays, quantile, scenario_results
from damadics_evaluate.recordings.intervals import median_interval


def compare(first: Sequence[Result], second: Sequence[Result]) -> list[Result]:
    """
    Return the scenario-detector pairs of two campaigns side by side.

    :return: rows with detected shares, median delays, their difference, a sign test over the
        seeds both campaigns share (`p`, two-sided; 1 where no seed differs) and `p_holm`, which
        allows for the number of rows.
    """
    left, right = scenario_results(first), scenario_results(second)
    rows: list[Result] = []
    for key in sorted(left.keys() & right.keys()):
        a = {r['seed']: t for r, t in zip(left[key], delays(left[key]), strict=True)}
        b = {r['seed']: t for r, t in zip(right[key], delays(right[key]), strict=True)}
        shared = sorted(a.keys() & b.keys())
        later = sum(b[s] > a[s] for s in shared)
        earlier = sum(b[s] < a[s] for s in shared)
        ma, mb = quantile(a.values(), 0.5), quantile(b.values(), 0.5)
        rows.append(
            {
                'scenario': key[0],
                'detector': key[1],
                'detected_a': sum(map(math.isfinite, a.values())) / len(a),
                'detected_b': sum(map(math.isfinite, b.values())) / len(b),
                't_dt_a': ma,
                't_dt_b': mb,
                'difference': mb - ma if math.isfinite(ma) and math.isfinite(mb) else math.nan,
                'earlier_in_b': earlier,
                'later_in_b': later,
                'p': sign_test(earlier, later),
            }
        )
    for row, p in zip(rows, holm([row['p'] for row in rows]), strict=True):
        row['p_holm'] = p
    return rows


def overall(first: Sequence[Result], second: Sequence[Result]) -> list[Result]:
    """
    Return per detector what a change did over all scenarios and seeds.

    :return: rows with detector, pairs, earlier and later in b, found only in a, found only in b,
        median of the paired differences of the delay with its 95 % interval, sign test.
    """
    left, right = scenario_results(first), scenario_results(second)
    rows: list[Result] = []
    for detector in sorted({name for _, name in left.keys() & right.keys()}):
        pairs = []
        for key in left.keys() & right.keys():
            if key[1] == detector:
                a = {r['seed']: t for r, t in zip(left[key], delays(left[key]), strict=True)}
                b = {r['seed']: t for r, t in zip(right[key], delays(right[key]), strict=True)}
                pairs += [(a[s], b[s]) for s in a.keys() & b.keys()]
        both = [b - a for a, b in pairs if math.isfinite(a) and math.isfinite(b)]
        earlier, later = sum(b < a for a, b in pairs), sum(b > a for a, b in pairs)
        low, high = median_interval(both)
        rows.append(
            {
                'detector': detector,
                'pairs': len(pairs),
                'earlier_in_b': earlier,
                'later_in_b': later,
                'only_in_a': sum(math.isfinite(a) and math.isinf(b) for a, b in pairs),
                'only_in_b': sum(math.isinf(a) and math.isfinite(b) for a, b in pairs),
                'difference': quantile(both, 0.5),
                'low': low,
                'high': high,
                'p': sign_test(earlier, later),
            }
        )
    return rows


def holm(values: Sequence[float]) -> list[float]:
    """
    Return p values that allow for their number (Holm 1979).

    >>> holm([0.01, 0.04, 0.03])
    [0.03, 0.06, 0.06]
    """
    out = [0.0] * len(values)
    largest = 0.0
    for rank, i in enumerate(sorted(range(len(values)), key=lambda k: values[k])):
        largest = max(largest, min(1.0, (len(values) - rank) * values[i]))
        out[i] = largest
    return out


def sign_test(wins: int, losses: int) -> float:
    """
    Return the two-sided p value of a sign test.

    >>> sign_test(0, 5)
    0.0625
    """
    n, k = wins + losses, min(wins, losses)
    tail = sum(math.comb(n, i) for i in range(k + 1)) / 2**n
    return float(min(1.0, 2.0 * tail))
