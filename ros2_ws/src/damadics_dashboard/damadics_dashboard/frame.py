# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What every page has around its content."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape

from nicegui import ui

from damadics_dashboard.watcher import Watcher

VALVE = (
    '<svg viewBox="0 0 28 28" fill="none" stroke="currentColor" stroke-width="2.2" '
    'stroke-linejoin="round" stroke-linecap="round" aria-hidden="true">'
    '<path d="M3 13v11l11-5.5L25 24V13l-11 5.5z"/><path d="M14 18V9"/>'
    '<path d="M7 9a7 6 0 0 1 14 0z" fill="currentColor" fill-opacity=".18"/></svg>'
)
FAVICON = VALVE.replace('<svg ', '<svg xmlns="http://www.w3.org/2000/svg" ', 1).replace(
    'currentColor', '#0a64bd'
)
VERSION = 2  # of the static files, for the caches of browsers
PAGES = (('/', 'Fleet'), ('/history', 'History'), ('/replay', 'Replay'))
NEXT_THEME = {None: True, True: False, False: None}
THEME = {
    None: ('brightness_auto', 'follow the system'),
    True: ('dark_mode', 'dark'),
    False: ('light_mode', 'light'),
}


@contextmanager
def frame(title: str, here: str, watcher: Watcher) -> Iterator[None]:
    """
    Draw head and navigation; the content goes inside.

    :param title: of the page.
    :param here: address of the page in the navigation.
    :param watcher: the ROS side.
    """
    ui.page_title(f'{title} · DAMADICS FD')
    ui.add_head_html(
        f'<link rel="stylesheet" href="/assets/style.css?{VERSION}">'
        f'<script src="/assets/live.js?{VERSION}"></script>'
    )
    ui.colors(
        primary='#0a64bd',
        positive='#1d8650',
        negative='#c3262e',
        dark='#151c23',
        dark_page='#0d1217',
    )
    dark = ui.dark_mode(_stored_theme())
    ui.html(
        '<a class="skip" href="#content">Skip to content</a>'
        '<div id="announcer" class="unseen" aria-live="assertive"></div>',
        sanitize=False,
    )
    with ui.element('header').classes('bar'):
        ui.html(
            f'<a class="brand" href="/" aria-label="DAMADICS FD, start page">{VALVE}'
            '<span>DAMADICS FD<small>control valve condition</small></span></a>',
            sanitize=False,
        )
        links = ''.join(
            f'<a href="{path}"{" aria-current=page" if path == here else ""}>{name}</a>'
            for path, name in PAGES
        )
        ui.html(f'<nav aria-label="pages">{links}</nav>', sanitize=False)
        ui.element('span').classes('spacer')
        link = ui.html('', sanitize=False)

        def show_link() -> None:
            good = watcher.alive
            words = 'ROS 2 connected' if good else 'ROS 2 connection lost: restart the dashboard'
            link.set_content(
                f'<span class="link {"on" if good else ""}" role="status">'
                f'<i></i><span>{words}</span></span>'
            )

        show_link()
        ui.timer(1.0, show_link)

        def change() -> None:
            dark.value = NEXT_THEME[dark.value]
            icon, words = THEME[dark.value]
            button.props(f'icon={icon} aria-label="colours: {words}"')
            ui.run_javascript(
                f"document.cookie='theme={json.dumps(dark.value)}; path=/; "
                "max-age=31536000; samesite=strict'"
            )

        icon, words = THEME[dark.value]
        button = (
            ui.button(icon=icon, on_click=change, color=None)
            .props(f'flat round dense aria-label="colours: {words}"')
            .style('color: var(--muted)')
        )
    with ui.element('main').classes('page').props('id=content'):
        yield


@contextmanager
def card(title: str, remark: str = '') -> Iterator[ui.element]:
    """
    Draw a card with a head; the content goes inside.

    :param title: of the card.
    :param remark: at the right of the head; left out on a phone.
    :yield: the head, to put more into it.
    """
    with ui.element('section').classes('card'):
        with ui.element('div').classes('head') as head:
            ui.html(f'<h2>{escape(title)}</h2>', sanitize=False)
            ui.html(escape(remark), sanitize=False).classes('sub')
        yield head


def _stored_theme() -> bool | None:
    request = ui.context.client.request
    return {'true': True, 'false': False}.get(request.cookies.get('theme', ''))
