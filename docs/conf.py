# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""How Sphinx makes the documentation: the pages of this folder and the packages' docstrings."""

import sys
from pathlib import Path
from xml.etree import ElementTree

SOURCES = Path(__file__).parent.parent / 'ros2_ws' / 'src'
sys.path[:0] = [str(path) for path in sorted(SOURCES.glob('damadics_*'))]

project = 'DAMADICS FD'
author = 'DAMADICS FD maintainers'
release = ElementTree.parse(SOURCES / 'damadics_fd' / 'package.xml').findtext('version') or ''
extensions = ['myst_parser', 'sphinx.ext.apidoc', 'sphinx.ext.autodoc', 'sphinx.ext.mathjax']
exclude_patterns = ['_build', 'results/index.html']
html_theme = 'furo'
myst_enable_extensions = ['dollarmath']
myst_heading_anchors = 4
# pages link to files of the repository that are no pages
suppress_warnings = ['myst.xref_missing', 'myst.header', 'ref.python']
autodoc_typehints = 'description'
autodoc_default_options = {'members': True, 'show-inheritance': False}
apidoc_modules = [
    {
        'path': str(SOURCES / package / package),
        'destination': f'api/{package}',  # one each: what is not made again is removed
        'max_depth': 3,
        'separate_modules': True,
        'automodule_options': {'members'},
    }
    for package in ('damadics_fd', 'damadics_plant', 'damadics_evaluate', 'damadics_connect')
]


def _bars(app, what, name, thing, options, lines) -> None:
    """Let `|x|` in a docstring be the absolute value it is: Sphinx takes it for a substitution."""
    for number, line in enumerate(lines):
        if '``' not in line and not line.lstrip().startswith(('>>>', '...', '|', '+')):
            lines[number] = line.replace('|', '\\|')


def setup(app) -> None:
    """Register what docstrings go through."""
    app.connect('autodoc-process-docstring', _bars)
