# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The report of a campaign: index.html (self-contained), README.md, summary.csv."""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

from damadics_fd.core.scada.isolation import NAMES

from damadics_evaluate.benchmark import tables
from damadics_evaluate.benchmark.campaign import CALIBRATION_SEED, NOMINAL_SEED, Campaign
from damadics_evaluate.benchmark.runner import MANIFEST, read_results
from damadics_evaluate.benchmark.units import limits
from damadics_evaluate.detectors.find import title_of
from damadics_evaluate.report import figures as plots
from damadics_evaluate.scenarios.cases import SCENARIOS, STANDARD, case

PAPER = 'paper.json'
MODEL_BASED = ('scada', 'fixed_r1', 'fixed_r2')
FORM = ('t_dt', 'r_fd', 'r_td', 'f_sd', 't_it', 'r_fi', 'r_ti', 'r_mi', 'f_si', 'dacc_tm', 'dacc')
ISOLATION_INDICES = ('t_it', 'r_fi', 'r_ti', 'r_mi', 'f_si', 'dacc_tm', 'dacc')
OTHER_NAMES = {8: 'twisted piston rod', 14: 'chamber pressure sensor'}
Result = dict[str, Any]


def write_report(source: Path, target: Path) -> list[Path]:
    """
    Write the report of a campaign.

    :param source: directory of the campaign.
    :param target: directory of the report.
    :return: files written.
    :raises FileNotFoundError: where there are no results.
    """
    try:
        import jinja2
    except ImportError as error:
        raise ImportError('the report needs jinja2: pip install jinja2') from error
    results = read_results(source)
    if not any(r['kind'] == 'scenario' for r in results):
        raise ValueError(f'{source} holds no scenario: run evaluate run --out {source}')
    manifest = json.loads((source / MANIFEST).read_text(encoding='utf-8'))
    stated: dict[str, Any] = manifest['campaign']
    plain = {k: tuple(v) if isinstance(v, list) else v for k, v in stated.items()}
    campaign = Campaign(**plain)  # type: ignore[arg-type]
    content = _content(campaign, results)
    paper = source / PAPER
    content['paper'] = json.loads(paper.read_text(encoding='utf-8')) if paper.exists() else None
    template = Path(__file__).with_name('report.html.j2').read_text(encoding='utf-8')
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined)
    environment.filters |= {'cell': _cell, 'share': _share}
    html = environment.from_string(template)
    target.mkdir(parents=True, exist_ok=True)
    files = [target / name for name in ('index.html', 'summary.csv', 'README.md')]
    files[0].write_text(html.render(**content, versions=manifest['versions']), encoding='utf-8')
    tables.write_csv(content['summary'], files[1])
    files[2].write_text(_readme(content), encoding='utf-8')
    return files


def _content(campaign: Campaign, results: Sequence[Result]) -> dict[str, Any]:
    """Return everything the template shows."""
    rows = tables.summary(results)
    present = {r['detector'] for r in rows}
    detectors = [d for d in campaign.detectors if d in present]
    limit = limits(campaign, [r for r in results if r['kind'] == 'nominal'])
    limit = {name: value for name, value in limit.items() if name in present}
    first_seed = NOMINAL_SEED if campaign.nominal_days else CALIBRATION_SEED
    standard = [r for r in rows if r['scenario'] in SCENARIOS]
    false_alarms = tables.false_alarms(results, limit, first_seed)
    return {
        'scenarios': len({r['scenario'] for r in standard}),
        'detectors': detectors,
        'titles': {d: title_of(d) for d in detectors},
        'seeds': f'{min(campaign.seeds)} to {max(campaign.seeds)}',
        'calibration_days': campaign.calibration_days,
        'nominal_days': max((r['days'] for r in false_alarms), default=0),
        'settings_hash': campaign.settings_hash('scada') if 'scada' in present else '',
        'summary': rows,
        'whole': all(r['detected'] in (0, r['runs']) for r in standard),
        'cards': cards(standard, false_alarms),
        'shortfalls': shortfalls(rows),
        'grid': _grid(standard, detectors),
        'free': [r for r in rows if r['scenario'] not in SCENARIOS and r['detector'] == 'scada'],
        'false_alarms': false_alarms,
        'forms': _forms(results),
        'figures': {
            'bars': plots.delay_bars(standard),
            'delays': plots.delay_curves(results, detectors),
            'operating': plots.operating_curves(results, limit, first_seed),
            'detectability': plots.detectability(results),
            'heat': plots.heat_map(results),
        },
    }


def cards(
    rows: Sequence[dict[str, Any]], false_alarms: Sequence[dict[str, Any]]
) -> list[tuple[str, str]]:
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


def versus_baselines(rows: Sequence[dict[str, Any]], without: Sequence[str]) -> tuple[int, int]:
    """Return in how many of the detected scenarios the monitor is no later than any baseline."""
    ours = {r['scenario']: r['t_dt_median'] for r in rows if r['detector'] == 'scada'}
    best: dict[str, float] = {}
    for r in rows:
        if r['detector'] not in without:
            best[r['scenario']] = min(best.get(r['scenario'], math.inf), r['t_dt_median'])
    detected = [s for s, t in ours.items() if math.isfinite(min(t, best.get(s, math.inf)))]
    return sum(ours[s] <= best.get(s, math.inf) for s in detected), len(detected)


def shortfalls(rows: Sequence[dict[str, Any]]) -> list[str]:
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
                f'{name}: found after {_cell(r["t_dt_median"])} s, by the {rival[1]} '
                f'after {_cell(rival[0])} s.'
            )
        if r['detected'] and r['first_right'] < 1.0:
            early = (
                ''
                if case(name).abrupt
                else (
                    ', judged 600 s after the alarm: a fault that has only just become visible has '  # noqa: E501
                    'little shape'
                )
            )
            lines.append(
                f'{name}: named right in {r["first_right"]:.0%} of the runs that alarm, '
                f'its group in {r["group_right"]:.0%}{early}.'
            )
    return lines


def _grid(rows: Sequence[dict[str, Any]], detectors: Sequence[str]) -> list[dict[str, Any]]:
    by = {(r['scenario'], r['detector']): r for r in rows}
    grid = []
    for scenario in SCENARIOS:
        present = [by[scenario, d]['t_dt_median'] for d in detectors if (scenario, d) in by]
        if not present:
            continue
        cells = []
        for d in detectors:
            r = by.get((scenario, d))
            if r is None:
                cells.append(('', ''))
                continue
            text = _cell(r['t_dt_median'])
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
        grid.append({'scenario': scenario, 'runs': runs, 'cells': cells})
    return grid


def _forms(results: Sequence[Result]) -> list[dict[str, Any]]:
    """Return form S1-FF of every fault with the medians of the monitor's indices."""
    grouped = tables.scenario_results(results)
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
                cells.append(_cell(median(known)) if 2 * len(known) > len(values) else '-')
            rows.append([index, *cells])
        title = NAMES.get(fault) or OTHER_NAMES[fault]
        forms.append({'fault': fault, 'name': title, 'scenarios': names, 'rows': rows})
    return forms


def _share(value: float) -> str:
    return '–' if math.isnan(value) else f'{value:.0%}'


def _index(result: Result, name: str) -> float | None:
    if name not in ISOLATION_INDICES:
        value: float | None = result['indices'][name]
        return value
    return result['isolation']['indices'].get(name) if result.get('isolation') else None


def _cell(value: float) -> str:
    if not math.isfinite(value):
        return '–'
    return f'{value:.0f}' if abs(value) >= 10 or value == int(value) else f'{value:.3g}'


def _readme(content: dict[str, Any]) -> str:
    """Return the report's short form for a repository page."""
    lines = [
        '# Results',
        '',
        f'{content["scenarios"]} scenarios, {len(content["detectors"])} detectors, seeds '
        f'{content["seeds"]}; settings {content["settings_hash"]}. The whole report with curves, '
        'forms and figures: [index.html](index.html); every figure: [summary.csv](summary.csv).',
        '',
        *(f'- **{figure}** {text}' for figure, text in content['cards']),
        '',
        '## What is not detected or not isolated, and why',
        '',
        *(f'- {line}' for line in content['shortfalls']),
        '',
        '## Detection time, median t_dt in s',
        '',
        '| scenario | runs | ' + ' | '.join(content['titles'].values()) + ' |',
        '|---|---|' + '---|' * len(content['titles']),
    ]
    for row in content['grid']:
        cells = (f'**{c[0]}**' if c[1] == 'best' else c[0] for c in row['cells'])
        lines.append(f'| {row["scenario"]} | {row["runs"]} | ' + ' | '.join(cells) + ' |')
    if content['paper']:
        lines += [
            '',
            "## The paper's experiments",
            '',
            content['paper']['text'],
            '',
            '| detector | ' + ' | '.join(content['paper']['columns']) + ' |',
            '|---|' + '---|' * len(content['paper']['columns']),
        ]
        lines += ['| ' + ' | '.join(map(str, row)) + ' |' for row in content['paper']['rows']]
    if content['free']:
        lines += [
            '',
            '## Isolation at other strengths',
            '',
            '| fault@strength | runs | median t_dt | group right | fault first |',
            '|---|---|---|---|---|',
        ]
        lines += [
            f'| {r["scenario"]} | {r["runs"]} | {_cell(r["t_dt_median"])} | '
            f'{_share(r["group_right"])} | {_share(r["first_right"])} |'
            for r in content['free']
        ]
    lines += ['', 'Made by `evaluate report`; edit nothing here.', '']
    return '\n'.join(lines)
