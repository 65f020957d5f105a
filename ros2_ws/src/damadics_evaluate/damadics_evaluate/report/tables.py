# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tables of the report: detection times, forms S1-FF, isolation over time, confusion."""

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from statistics import median

from damadics_fd.core.scada.naming.isolation import NAMES

from damadics_evaluate.benchmark.isolation import END, LABELS, PAIR, RIGHT, WRONG
from damadics_evaluate.benchmark.results import Result
from damadics_evaluate.benchmark.tables import scenario_results
from damadics_evaluate.report.cells import cell
from damadics_evaluate.scenarios.cases import SCENARIOS, STANDARD

FORM = ('t_dt', 'r_fd', 'r_td', 'f_sd', 't_it', 'r_fi', 'r_ti', 'r_mi', 'f_si', 'dacc_tm', 'dacc')
ISOLATION_INDICES = ('t_it', 'r_fi', 'r_ti', 'r_mi', 'f_si', 'dacc_tm', 'dacc')
OTHER_NAMES = {8: 'twisted piston rod', 14: 'chamber pressure sensor'}
TIMES = (*LABELS.values(), END)
CONFUSIONS = 30  # the most frequent ones


def grid_of(rows: Sequence[Result], detectors: Sequence[str]) -> list[Result]:
    """Return the median detection times, one row per scenario."""
    by = {(r['scenario'], r['detector']): r for r in rows}
    grid = []
    own = dict.fromkeys(r['scenario'] for r in rows if r['scenario'] not in SCENARIOS)
    for scenario in (*SCENARIOS, *own):
        present = [by[scenario, d]['t_dt_median'] for d in detectors if (scenario, d) in by]
        if not present:
            continue
        cells = []
        for d in detectors:
            r = by.get((scenario, d))
            if r is None:
                cells.append(('', ''))
                continue
            text = cell(r['t_dt_median'])
            if 0 < r['detected'] < r['runs']:
                text += f' ({r["detected"]}/{r["runs"]})'
            finite = math.isfinite(r['t_dt_median'])
            cells.append(
                (
                    text,
                    'best'
                    if finite and r['t_dt_median'] <= min(present)
                    else ''
                    if finite
                    else 'miss',
                )
            )
        runs = max(by[scenario, d]['runs'] for d in detectors if (scenario, d) in by)
        grid.append({'scenario': Path(scenario).name, 'runs': runs, 'cells': cells})
    return grid


def forms_of(results: Sequence[Result]) -> list[Result]:
    """Return form S1-FF of every fault with the medians of the monitor's indices."""
    grouped = scenario_results(results)
    forms = []
    for fault, modes in STANDARD.items():
        names = [f'f{fault}_{mode}' for mode in modes if (f'f{fault}_{mode}', 'scada') in grouped]
        if not names:
            continue
        rows = []
        for index in FORM:
            cells = []
            for name in names:
                values = [_index(r, index) for r in grouped[name, 'scada']]
                known = [v for v in values if v is not None]
                cells.append(cell(median(known)) if 2 * len(known) > len(values) else '-')
            rows.append([index, *cells])
        title = NAMES.get(fault) or OTHER_NAMES[fault]
        forms.append({'fault': fault, 'name': title, 'scenarios': names, 'rows': rows})
    return forms


def _index(result: Result, name: str) -> float | None:
    if name not in ISOLATION_INDICES:
        value: float | None = result['indices'][name]
        return value
    return result['isolation']['indices'].get(name) if result.get('isolation') else None


def isolation_over_time(results: Sequence[Result]) -> list[Result]:
    """
    Return per detector and time after the alarm how the fault named first was judged.

    :param results: of one campaign.
    :return: rows with detector, after, runs, right, same_law, wrong (shares).
    """
    rows = []
    counts: dict[tuple[str, str], Counter[str]] = {}
    for r in _isolated(results):
        for after, d in r['isolation']['over_time'].items():
            counts.setdefault((r['detector'], after), Counter())[d['verdict']] += 1
    for (detector, after), found in sorted(
        counts.items(), key=lambda item: (item[0][0], TIMES.index(item[0][1]))
    ):
        runs = sum(found.values())
        rows.append(
            {
                'detector': detector,
                'after': after,
                'runs': runs,
                'right': found[RIGHT] / runs,
                'same_law': found[PAIR] / runs,
                'wrong': found[WRONG] / runs,
            }
        )
    return rows


def named_over_time(results: Sequence[Result], detector: str) -> list[Result]:
    """
    Return per scenario what one detector names first over time, most frequent first.

    :return: rows with scenario and one cell per time; empty where nothing was isolated then.
    """
    rows: dict[str, dict[str, Counter[str]]] = {}
    for r in _isolated(results):
        if r['detector'] == detector:
            for after, d in r['isolation']['over_time'].items():
                at = rows.setdefault(r['scenario'], {}).setdefault(after, Counter())
                at[f'f{d["named"]}'] += 1
    order = {name: i for i, name in enumerate(SCENARIOS)}
    return [
        {
            'scenario': name,
            'cells': [
                ', '.join(
                    f'{fault} {n}/{sum(at[t].values())}' for fault, n in at[t].most_common(3)
                )
                if t in at
                else ''
                for t in TIMES
            ],
        }
        for name, at in sorted(rows.items(), key=lambda item: (order.get(item[0], 99), item[0]))
    ]


def confusion(results: Sequence[Result], detector: str) -> list[Result]:
    """
    Return which faults one detector takes for which at the end of the runs.

    :return: rows with fault, named, verdict and count, the most frequent first.
    """
    counts: Counter[tuple[int, int, str]] = Counter()
    for r in _isolated(results):
        if r['detector'] == detector:
            last = r['isolation']['over_time'][END]
            if last['verdict'] != RIGHT:
                counts[r['fault'], last['named'], last['verdict']] += 1
    return [
        {'fault': f'f{fault}', 'named': f'f{named}', 'verdict': judged, 'count': n}
        for (fault, named, judged), n in counts.most_common(CONFUSIONS)
    ]


def _isolated(results: Sequence[Result]) -> list[Result]:
    return [r for r in results if r.get('isolation') and 'over_time' in r['isolation']]
