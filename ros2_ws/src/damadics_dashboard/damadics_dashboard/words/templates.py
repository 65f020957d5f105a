# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Markup out of templates: every value is escaped by the template engine."""

from functools import cache
from pathlib import Path

from jinja2 import ChainableUndefined, Environment, FileSystemLoader, select_autoescape

TEMPLATES = Path(__file__).parents[1] / 'pages' / 'templates'


@cache
def _environment() -> Environment:
    return Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=select_autoescape(default=True),
        undefined=ChainableUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def render(template: str, **values: object) -> str:
    """
    Fill in a template; every value is escaped by the template engine.

    :param template: name of its file in `templates`.
    :param values: what it shows.
    :return: HTML.
    """
    return _environment().get_template(template).render(**values)
