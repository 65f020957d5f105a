# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Elements of a page whose texts are values: nothing from outside is ever parsed as markup."""

import json
from collections.abc import Callable
from typing import TypeVar

from nicegui import ui

from damadics_dashboard.words.templates import render

E = TypeVar('E', bound=ui.element)
Plain = str | int | float | bool | None


def markup(template: str, **values: object) -> ui.html:
    """
    Draw a template.

    :param template: name of its file in `templates`.
    :param values: what it shows.
    :return: the element.
    """
    return ui.html(render(template, **values), sanitize=False)


def redraw(element: ui.html, template: str, **values: object) -> None:
    """
    Draw a template again where its values have changed.

    :param element: as `markup` returned it.
    :param template: name of its file in `templates`.
    :param values: what it shows.
    """
    content = render(template, **values)
    if element.content != content:
        element.set_content(content)


def with_values(element: E, **values: Plain) -> E:
    """
    Set attributes as values.

    :param element: of the page.
    :param values: attributes; an underscore stands for a dash.
    :return: the element.
    """
    with element.props.suspend_updates():
        for name, value in values.items():
            element.props[name.replace('_', '-')] = value
    element.update()
    return element


def box(tag: str, classes: str = '', **values: Plain) -> ui.element:
    """
    Draw an element that holds others.

    :param tag: of HTML.
    :param classes: of the style sheet.
    :param values: attributes.
    :return: the element, to be used in `with`.
    """
    element = ui.element(tag)
    if classes:
        element.classes(classes)
    return with_values(element, **values)


def button(
    text: str,
    act: Callable[..., object],
    style: str = 'plain',
    *,
    label: str = '',
    icon: str | None = None,
) -> ui.button:
    """
    Draw a button.

    :param text: on it.
    :param act: what it does.
    :param style: `main` or `plain`.
    :param label: for screen readers, where the text alone does not say it.
    :param icon: name of a symbol.
    :return: the button.
    """
    element = ui.button(text, on_click=act, icon=icon, color=None)
    element.props('no-caps unelevated dense padding="4px 12px"').classes(style)
    return with_values(element, aria_label=label) if label else element


def tell(function: str, *values: object) -> None:
    """
    Call a function of the page's script.

    :param function: its name in `damadics`.
    :param values: passed as JSON.
    """
    words = ', '.join(json.dumps(v, separators=(',', ':'), allow_nan=False) for v in values)
    ui.run_javascript(f'damadics.{function}({words})')
