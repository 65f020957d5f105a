# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Summaries of a campaign: medians per scenario, forms per fault, false alarms, comparison."""

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import median

import numpy as np

from damadics_evaluate.benchmark.results import Result
from damadics_evaluate.benchmark.units import FACTORS
from damadics_evaluate.indices import T_FROM, T_ON
from damadics_evaluate.scenarios.cases import SCENARIOS, case

NOT_OBSERVABLE = {
    'f8': 'scales a play of 1 % by at most 1.4: below the sensor noise',
    'f14': 'touches the chamber pressure only, which is not among the signals',
    'f16_S': 'the supply stays above what the strokes of this feed need; it shows with fast, '
    'commanded strokes or with the chamber pressure',
}


def unobservable(scenario: str) -> str:
    """Return why a scenario cannot be seen in CV, X, P1, P2, T1, F; empty if it can."""
    return NOT_OBSERVABLE.get(scenario) or NOT_OBSERVABLE.get(scenario.split('_')[0], '')


def quantile(values: Iterable[float], q: float) -> float:
    """Return the q quantile of values among which infinity means "not detected"."""
    ordered = sorted(values)
    if not ordered:
        return math.nan
    return ordered[min(math.ceil(q * len(ordered)), len(ordered)) - 1 if q > 0 else 0]


def scenario_results(results: Sequence[Result]) -> dict[tuple[str, str], list[Result]]:
    """Return the scenario results grouped by scenario and detector."""
    grouped: dict[tuple[str, str], list[Result]] = {}
    for r in results:
        if r['kind'] == 'scenario':
            grouped.setdefault((r['scenario'], r['detector']), []).append(r)
    return grouped


def delays(group: Sequence[Result]) -> list[float]:
    """Return t_dt of every run; infinity where the fault was not found."""
    return [math.inf if r['indices']['t_dt'] is None else r['indices']['t_dt'] for r in group]


def summary(results: Sequence[Result]) -> list[Result]:
    """
    Return one row per scenario and detector.

    :param results: of one campaign.
    :return: rows with detected/runs, median and 90 % quantile of t_dt, r_fd (largest), r_td and
        f_sd (medians), first test, isolation shares.
    """
    rows = []
    order = {name: i for i, name in enumerate(SCENARIOS)}
    for (scenario, detector), group in sorted(
        scenario_results(results).items(),
        key=lambda item: (order.get(item[0][0], len(order)), item[0]),
    ):
        t_dt = delays(group)
        found = [r['indices'] for r in group if r['indices']['t_dt'] is not None]
        tests = [r['test'] for r in group if r.get('test')]
        isolated = [r['isolation'] for r in group if r.get('isolation')]
        rows.append(
            {
                'scenario': scenario,
                'detector': detector,
                'runs': len(group),
                'detected': len(found),
                't_dt_median': quantile(t_dt, 0.5),
                't_dt_p90': quantile(t_dt, 0.9),
                'f_sd': median(i['f_sd'] for i in found) if found else math.nan,
                'r_fd_max': max(r['indices']['r_fd'] for r in group),
                'r_td': median(r['indices']['r_td'] for r in group),
                'first_test': max(set(tests), key=tests.count) if tests else '',
                'group_right': _share(i['right_group'] for i in isolated),
                'first_right': _share(i['right_first'] for i in isolated),
                't_it': quantile(
                    (
                        i['indices']['t_it'] if i['indices']['t_it'] is not None else math.inf
                        for i in isolated
                    ),
                    0.5,
                ),
                'why_not': unobservable(scenario),
            }
        )
    return rows


def _share(values: Iterable[bool]) -> float:
    listed = list(values)
    return sum(listed) / len(listed) if listed else math.nan


def write_csv(rows: Sequence[Result], file: Path) -> None:
    """Write rows of one shape as CSV; empty cells for what is undefined."""
    with file.open('w', newline='', encoding='utf-8') as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        for row in rows:
            writer.writerow(
                {
                    key: '' if isinstance(value, float) and not math.isfinite(value) else value
                    for key, value in row.items()
                }
            )


def false_alarms(
    results: Sequence[Result], limit: dict[str, float], first_seed: int
) -> list[Result]:
    """
    Return per detector the fault-free days and on how many of them it alarmed.

    :param limit: limit by detector.
    :param first_seed: first seed of the days to count.
    """
    rows = []
    for detector, bound in limit.items():
        days = [
            max(r['hourly_max']) / bound
            for r in results
            if r['kind'] == 'nominal' and r['detector'] == detector and r['seed'] >= first_seed
        ]
        if days:
            rows.append(
                {
                    'detector': detector,
                    'days': len(days),
                    'days_with_alarm': sum(d >= 1.0 for d in days),
                    'largest_ratio': max(days),
                    'median_ratio': median(days),
                }
            )
    return rows


def operating_curve(
    results: Sequence[Result], detector: str, limit: float, first_seed: int
) -> dict[str, list[float]]:
    """
    Return false alarms against missed scenarios and delay over factors of the limit.

    :return: `factor`, `false_per_day` (hours with an exceedance, per day, on fault-free days),
        `missed` (share of runs not detected in the horizon), `delay` (median over detected runs).
    """
    hours = np.array(
        [
            r['hourly_max']
            for r in results
            if r['kind'] == 'nominal' and r['detector'] == detector and r['seed'] >= first_seed
        ]
    )
    runs = [
        r
        for r in results
        if r['kind'] == 'scenario'
        and r['detector'] == detector
        and not unobservable(r['scenario'])
    ]
    curve: dict[str, list[float]] = {
        name: [] for name in ('factor', 'false_per_day', 'missed', 'delay', 'false_before')
    }
    for i, factor in enumerate(FACTORS):
        crossing = [r['crossings'][i] for r in runs]
        late = [
            t - T_FROM
            for t, r in zip(crossing, runs, strict=True)
            if t is not None and T_FROM <= t <= case(r['scenario']).zones.t_hor
        ]
        early = sum(t is not None and T_ON <= t < T_FROM for t in crossing)
        curve['factor'].append(float(factor))
        curve['false_per_day'].append(
            float((hours >= factor * limit).sum() / len(hours)) if len(hours) else math.nan
        )
        curve['missed'].append(1.0 - len(late) / max(len(runs), 1))
        curve['false_before'].append(early / max(len(runs), 1))
        curve['delay'].append(median(late) if late else math.nan)
    return curve
