# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The table of detection times for a paper."""

from damadics_evaluate.benchmark.results import Result

SPECIAL = {
    '&': r'\&',
    '%': r'\%',
    '$': r'\$',
    '#': r'\#',
    '_': r'\_',
    '{': r'\{',
    '}': r'\}',
    '~': r'\textasciitilde{}',
    '^': r'\textasciicircum{}',
    '\\': r'\textbackslash{}',
    '–': '--',
}


def escaped(text: str) -> str:
    r"""
    Return a text as LaTeX shows it.

    >>> escaped('f1_S 100%')
    'f1\\_S 100\\%'
    """
    return ''.join(SPECIAL.get(mark, mark) for mark in text)


def latex_table(content: Result) -> str:
    """
    Return the detection times as a booktabs table.

    :param content: of the report.
    """
    titles = [escaped(content['titles'][name]) for name in content['detectors']]
    head = ' & '.join(['scenario', *(rf'\rotatebox{{90}}{{{title}}}' for title in titles)])
    lines = [
        r'% needs \usepackage{booktabs,graphicx}',
        rf'% {content["seeds"]}, settings {content["settings_hash"]}',
        r'\begin{tabular}{l' + 'r' * len(titles) + '}',
        r'\toprule',
        head + r' \\',
        r'\midrule',
    ]
    for row in content['grid']:
        cells = [
            rf'\textbf{{{escaped(text)}}}' if kind == 'best' else escaped(text)
            for text, kind in row['cells']
        ]
        lines.append(' & '.join([escaped(row['scenario']), *cells]) + r' \\')
    return '\n'.join([*lines, r'\bottomrule', r'\end{tabular}', ''])
