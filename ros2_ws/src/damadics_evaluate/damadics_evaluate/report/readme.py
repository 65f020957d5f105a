# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The report's short form for a repository page."""

from collections.abc import Sequence

from damadics_evaluate.benchmark.results import Result
from damadics_evaluate.detectors.find import title_of
from damadics_evaluate.report.cells import cell, share
from damadics_evaluate.report.headlines import NO_SHORTFALL


def _markdown(grid: Sequence[Sequence[str]]) -> list[str]:
    """Return a table whose first row is its header."""
    lines = ['| ' + ' | '.join(row) + ' |' for row in grid]
    return [lines[0], '|---' * len(grid[0]) + '|', *lines[1:]]


def readme_of(content: Result) -> str:
    """Return the report's short form for a repository page."""
    lines = [
        '# Results',
        '',
        f'{content["scenarios"]}, {len(content["detectors"])} detectors, {content["seeds"]}; '
        f'settings {content["settings_hash"]}. `evaluate report` builds the page with curves, '
        'forms and figures, index.html, beside this one; every figure of its tables: '
        '[summary.csv](summary.csv).',
        *(f'\nRefused: {reason}' for reason in content['refused']),
        '',
        *(f'- **{figure}** {text}' for figure, text in content['cards']),
        '',
        '## What is not detected or not isolated, and why',
        '',
        *(f'- {line}' for line in content['shortfalls'] or [NO_SHORTFALL]),
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
            f'| {r["scenario"]} | {r["runs"]} | {cell(r["t_dt_median"])} | '
            f'{share(r["group_right"])} | {share(r["first_right"])} |'
            for r in content['free']
        ]
    if content['over_time']:
        lines += [
            '',
            '## Isolation over time',
            '',
            'The fault named first, judged at times after the alarm; "same law": faults that act '
            'alike on the signals (f6 and f18 add flow; f2, f3, f5, f19 scale it; f9 and f10 lose '
            'air; f4 and f8 widen the play).',
            '',
            '| detector | after the alarm | runs | right | same law | wrong |',
            '|---|---|---|---|---|---|',
        ]
        lines += [
            f'| {title_of(r["detector"])} | {r["after"]} | {r["runs"]} | {share(r["right"])} | '
            f'{share(r["same_law"])} | {share(r["wrong"])} |'
            for r in content['over_time']
        ]
    if content['lublin']:
        lines += [
            '',
            '## The faults induced in the real plant',
            '',
            content['lublin']['rules'],
            '',
        ]
        lines += _markdown(content['lublin']['grid'])
        lines += ['', *(f'- {note}' for note in content['lublin']['notes'])]
    lines += ['', 'Made by `evaluate report`; edit nothing here.', '']
    return '\n'.join(lines)
