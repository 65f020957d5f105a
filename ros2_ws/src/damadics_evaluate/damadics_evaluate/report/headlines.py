# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a reader wants first: the headline figures of the monitor, and what it does not reach."""

import math
from collections.abc import Sequence

from damadics_evaluate.benchmark.results import Result
from damadics_evaluate.detectors.find import title_of
from damadics_evaluate.report.cells import cell
from damadics_evaluate.scenarios.cases import SCENARIOS, case

MODEL_BASED = ('scada', 'fixed_r1', 'fixed_r2')
NO_SHORTFALL = 'Nothing: every benchmark scenario that was run is found first and named right.'
EARLY = (
    ', judged 600 s after the alarm: a fault that has only just become visible has little shape'
)


def cards(rows: Sequence[Result], false_alarms: Sequence[Result]) -> list[tuple[str, str]]:
    """Return the headline figures of the monitor."""
    ours = {r['scenario']: r for r in rows if r['detector'] == 'scada'}
    always = sum(r['detected'] == r['runs'] for r in ours.values())
    found = [
        (f'{always} of {len(ours)}', 'scenarios found in every run'),
        (
            f'{max((r["r_fd_max"] for r in ours.values()), default=math.nan):g}',
            'largest false detection rate',
        ),
    ]
    alarms = next((r for r in false_alarms if r['detector'] == 'scada'), None)
    if alarms:
        found.append(
            (f'{alarms["days_with_alarm"]} in {alarms["days"]}', 'fault-free days with an alarm')
        )
    first, of = versus_baselines(rows, without=MODEL_BASED)
    against_all, _ = versus_baselines(rows, without=('scada',))
    found.append(
        (
            f'{first} of {of}',
            'found no later than by the best baseline '
            f"({against_all} with thresholds on the monitor's own residuals counted as baselines)",
        )
    )
    abrupt = [
        r
        for r in ours.values()
        if r['detected'] and case(r['scenario']).abrupt and not math.isnan(r['first_right'])
    ]
    if abrupt:
        share = sum(r['first_right'] for r in abrupt) / len(abrupt)
        found.append((f'{share:.0%}', 'abrupt faults named right, first in the ranking'))
    return found


def versus_baselines(rows: Sequence[Result], without: Sequence[str]) -> tuple[int, int]:
    """Return in how many of the detected scenarios the monitor is no later than any baseline."""
    ours = {r['scenario']: r['t_dt_median'] for r in rows if r['detector'] == 'scada'}
    best: dict[str, float] = {}
    for r in rows:
        if r['detector'] not in without:
            best[r['scenario']] = min(best.get(r['scenario'], math.inf), r['t_dt_median'])
    detected = [s for s, t in ours.items() if math.isfinite(min(t, best.get(s, math.inf)))]
    return sum(ours[s] <= best.get(s, math.inf) for s in detected), len(detected)


def shortfalls(rows: Sequence[Result]) -> list[str]:
    """Return one sentence for everything the monitor does not find or names wrong."""
    lines = []
    best: dict[str, tuple[float, str]] = {}
    for r in rows:
        if r['detector'] != 'scada':
            rival = (r['t_dt_median'], title_of(r['detector']))
            best[r['scenario']] = min(best.get(r['scenario'], (math.inf, '')), rival)
    for r in rows:
        if r['detector'] != 'scada':
            continue
        name, runs = r['scenario'], r['runs']
        if r['detected'] < runs:
            why = f': {r["why_not"]}' if r['why_not'] else ''
            lines.append(f'{name}: detected in {r["detected"]} of {runs} runs{why}.')
        if r['r_fd_max'] > 0:
            lines.append(f'{name}: false detections, r_fd up to {r["r_fd_max"]:.3f}.')
        rival = best.get(name, (math.inf, ''))
        if rival[0] < r['t_dt_median']:
            lines.append(
                f'{name}: found after {cell(r["t_dt_median"])} s, by the {rival[1]} '
                f'after {cell(rival[0])} s.'
            )
        if r['detected'] and r['first_right'] < 1.0:
            early = '' if name in SCENARIOS and case(name).abrupt else EARLY
            lines.append(
                f'{name}: named right in {r["first_right"]:.0%} of the runs that alarm, '
                f'its group in {r["group_right"]:.0%}{early}.'
            )
    return lines
