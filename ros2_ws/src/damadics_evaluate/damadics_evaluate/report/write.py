# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Write the report of a campaign: a page, its short form, tables as CSV and LaTeX."""

import json
from collections.abc import Sequence
from pathlib import Path

from damadics_evaluate.benchmark import tables
from damadics_evaluate.benchmark.campaign import CALIBRATION_SEED, NOMINAL_SEED, Campaign
from damadics_evaluate.benchmark.results import Result
from damadics_evaluate.benchmark.runner import MANIFEST, read_results
from damadics_evaluate.benchmark.units import limits
from damadics_evaluate.detectors.find import title_of
from damadics_evaluate.report import figures
from damadics_evaluate.report.cells import cell, share
from damadics_evaluate.report.headlines import NO_SHORTFALL, cards, shortfalls
from damadics_evaluate.report.latex import latex_table
from damadics_evaluate.report.readme import readme_of
from damadics_evaluate.report.tables import (
    TIMES,
    confusion,
    forms_of,
    grid_of,
    isolation_over_time,
    named_over_time,
)
from damadics_evaluate.scenarios.cases import SCENARIOS

PAPER, LUBLIN = 'paper.json', 'lublin.json'


def write_report(source: Path, target: Path) -> list[Path]:
    """
    Write the report of a campaign.

    :param source: directory of the campaign.
    :param target: directory of the report.
    :return: files written: index.html, summary.csv, README.md, detection.tex, isolation.csv.
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
    content = _content(Campaign.of_manifest(manifest['campaign']), results)
    content['refused'] = list(
        dict.fromkeys(
            (
                *manifest.get('refused', ()),
                *(r['reason'] for r in results if r['kind'] == 'refused'),
            )
        )
    )
    for key, name in (('paper', PAPER), ('lublin', LUBLIN)):
        file = source / name
        content[key] = json.loads(file.read_text(encoding='utf-8')) if file.exists() else None
    template = Path(__file__).with_name('report.html.j2').read_text(encoding='utf-8')
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, autoescape=True)
    environment.filters |= {'cell': cell, 'share': share}
    page = environment.from_string(template).render(**content, versions=manifest['versions'])
    target.mkdir(parents=True, exist_ok=True)
    names = ('index.html', 'summary.csv', 'README.md', 'detection.tex', 'isolation.csv')
    files = [target / name for name in names]
    files[0].write_text(page, encoding='utf-8')
    tables.write_csv(content['summary'], files[1])
    files[2].write_text(readme_of(content), encoding='utf-8')
    files[3].write_text(latex_table(content), encoding='utf-8')
    if not content['over_time']:
        return files[:4]
    tables.write_csv(content['over_time'], files[4])
    return files


def _content(campaign: Campaign, results: Sequence[Result]) -> Result:
    """Return everything the template shows."""
    rows = tables.summary(results)
    present = {r['detector'] for r in rows}
    detectors = [d for d in campaign.detectors if d in present]
    limit = limits(campaign, [r for r in results if r['kind'] == 'nominal'])
    limit = {name: value for name, value in limit.items() if name in present}
    first_seed = NOMINAL_SEED if campaign.nominal_days else CALIBRATION_SEED
    standard = [r for r in rows if r['scenario'] in SCENARIOS]
    free = [r for r in rows if '@' in r['scenario'] and r['detector'] == 'scada']
    own = [r for r in rows if r['scenario'] not in SCENARIOS and '@' not in r['scenario']]
    false_alarms = tables.false_alarms(results, limit, first_seed)
    return {
        'scenarios': _counted(
            len({r['scenario'] for r in standard}), len({r['scenario'] for r in own})
        ),
        'detectors': detectors,
        'titles': {d: title_of(d) for d in detectors},
        'seeds': _range(campaign.seeds),
        'calibration_days': campaign.calibration_days,
        'nominal_days': max((r['days'] for r in false_alarms), default=0),
        'settings_hash': campaign.settings_hash('scada') if 'scada' in present else '',
        'summary': rows,
        'whole': all(r['detected'] in (0, r['runs']) for r in standard),
        'cards': cards(standard, false_alarms),
        'no_shortfall': NO_SHORTFALL,
        'shortfalls': shortfalls([*standard, *free]),
        'grid': grid_of([*standard, *own], detectors),
        'free': free,
        'times': TIMES,
        'over_time': isolation_over_time(results),
        'named': named_over_time(results, 'scada'),
        'confusion': confusion(results, 'scada'),
        'false_alarms': false_alarms,
        'forms': forms_of(results),
        'figures': {
            'bars': figures.delay_bars([*standard, *own]),
            'delays': figures.delay_curves(results, detectors),
            'operating': figures.operating_curves(results, limit, first_seed),
            'detectability': figures.detectability(results),
            'heat': figures.heat_map(results),
        },
    }


def _counted(standard: int, own: int) -> str:
    parts = []
    if standard or not own:
        parts.append(f'{standard} scenario{"s" * (standard != 1)} of the benchmark')
    if own:
        parts.append(f'{own} of your own')
    return ' and '.join(parts)


def _range(seeds: Sequence[int]) -> str:
    first, last = min(seeds), max(seeds)
    return f'seed {first}' if first == last else f'seeds {first} to {last}'
