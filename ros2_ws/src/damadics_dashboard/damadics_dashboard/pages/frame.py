# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What every page has around its content."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from urllib.parse import quote, unquote

from damadics_fd.core.text import NAME, plain
from damadics_fd.store.access import Grant, Role
from nicegui import ui

from damadics_dashboard.live.watcher import Watcher
from damadics_dashboard.pages.elements import box, markup, tell, with_values
from damadics_dashboard.server.access import GRANT, NOBODY
from damadics_dashboard.words.texts import LANGUAGES, Texts, preferred, texts

FAVICON = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 28 28" fill="none" stroke="#0a64bd" '
    'stroke-width="2.2" stroke-linejoin="round" stroke-linecap="round">'
    '<path d="M3 13v11l11-5.5L25 24V13l-11 5.5z"/><path d="M14 18V9"/>'
    '<path d="M7 9a7 6 0 0 1 14 0z" fill="#0a64bd" fill-opacity=".18"/></svg>'
)
VERSION = 14  # of the static files, for the caches of browsers
PAGES = (('/', 'fleet'), ('/history', 'history'), ('/replay', 'replay'))
BEAT = 0.25  # s between two signs of life
NEXT_THEME = {None: True, True: False, False: None}
THEME = {
    None: ('brightness_auto', 'theme_system'),
    True: ('dark_mode', 'theme_dark'),
    False: ('light_mode', 'theme_light'),
}
YEAR = 31_536_000  # s
_users: dict[str, str] = {}  # by client
HEAD = f'<link rel="stylesheet" href="/assets/style.css?{VERSION}">' + ''.join(
    f'<script src="/assets/{name}.js?{VERSION}"></script>' for name in ('live', 'fleet', 'plots')
)


def words() -> Texts:
    """
    Return the words for the browser that asks: its choice, or what it says that its user reads.

    :return: the words.
    """
    request = ui.context.client.request
    chosen = request.cookies.get('language', '')
    return texts(chosen or preferred(request.headers.get('accept-language', '')))


def grant() -> Grant:
    """
    Return what the person who asks may do.

    :return: the grant of the token that was shown.
    """
    found = ui.context.client.request.scope.get(GRANT, NOBODY)
    return found if isinstance(found, Grant) else NOBODY


def may_operate() -> bool:
    """
    Tell whether the person who asks may act.

    :return: False for one who may only see.
    """
    return grant().role is Role.OPERATOR


def user_name() -> str:
    """
    Return the name of the person who asks: of the token, or as given before in this browser.

    :return: name, '' where it is not known.
    """
    client = ui.context.client
    given = client.request.cookies.get('user', '')
    return grant().name or _users.get(client.id) or plain(unquote(given), NAME)


def keep_user(name: str) -> None:
    """
    Remember the name of the person, in this page and in the browser.

    :param name: as given.
    """
    _users[ui.context.client.id] = name
    _keep('user', quote(name, safe=''))


@contextmanager
def frame(title: str, here: str, watcher: Watcher) -> Iterator[Texts]:
    """
    Draw head and navigation; the content goes inside.

    :param title: of the page: the key of a text, or a name.
    :param here: address of the page in the navigation.
    :param watcher: the ROS side.
    :yield: the words of the browser's language.
    """
    t = words()
    ui.page_title(f'{t.entries.get(title, title)} · DAMADICS FD')
    ui.add_head_html(HEAD)
    ui.colors(
        primary='#0a64bd',
        positive='#1d8650',
        negative='#c3262e',
        dark='#151c23',
        dark_page='#0d1217',
    )
    dark = ui.dark_mode(_stored_theme())
    markup('symbols.html', t=t)
    with box('header', 'bar'):
        markup('brand.html', t=t, pages=PAGES, here=here).classes('row')
        box('span', 'spacer')
        with box('span', 'link', role='status'):
            box('i')
            ui.label(t('loading')).props('id=link')
        _alerts(t)
        _languages(t)
        _theme(t, dark)
    told = {name: t(name) for name in ('good', 'off', 'lost', 'recording_to_replay')}
    told |= {'short': t('no_connection'), 'language': t.language}
    tell('begin', told)

    def beat() -> None:
        tell('beat', watcher.alive)

    beat()
    ui.timer(BEAT, beat)
    client = ui.context.client
    client.on_delete(lambda: _users.pop(client.id, None))
    with box('div', 'page', id='content'):
        ui.label(t('lost')).classes('note lost')
        if not may_operate():
            markup('note.html', text=t('view_only'))
        yield t


def _alerts(t: Texts) -> None:
    switch = ui.button(icon='notifications', color=None).props('flat round dense')
    switch.classes('quiet bell').on('click', js_handler='() => damadics.alerts()')
    with_values(switch, aria_label=t('alerts'), title=t('alerts'))


def _languages(t: Texts) -> None:
    codes = list(LANGUAGES)
    following = codes[(codes.index(t.language) + 1) % len(codes)]

    def change() -> None:
        _keep('language', following)
        ui.run_javascript('location.reload()')

    switch = ui.button(t.language.upper(), on_click=change, color=None)
    switch.props('flat round dense no-caps').classes('quiet language')
    name = LANGUAGES[following]
    with_values(switch, aria_label=f'{t.language.upper()}: {name}', title=name)


def _theme(t: Texts, dark: ui.dark_mode) -> None:
    def show() -> None:
        icon, key = THEME[dark.value]
        with_values(switch, icon=icon, aria_label=t(key), title=t(key))

    def change() -> None:
        dark.value = NEXT_THEME[dark.value]
        show()
        _keep('theme', json.dumps(dark.value))

    switch = ui.button(on_click=change, color=None).props('flat round dense').classes('quiet')
    show()


def _keep(name: str, value: str) -> None:
    cookie = f'{name}={value}; path=/; max-age={YEAR}; samesite=strict'
    ui.run_javascript(f'document.cookie = {json.dumps(cookie)}')


@contextmanager
def card(title: str, remark: str = '', classes: str = '') -> Iterator[ui.element]:
    """
    Draw a card with a head; the content goes inside.

    :param title: of the card.
    :param remark: at the right of the head; left out on a phone.
    :param classes: further classes.
    :yield: the head, to put more into it.
    """
    with box('section', f'card {classes}'.strip(), aria_label=title):
        with box('div', 'head') as head:
            markup('heading.html', text=title)
            if remark:
                ui.label(remark).classes('sub')
        yield head


def _stored_theme() -> bool | None:
    request = ui.context.client.request
    return {'true': True, 'false': False}.get(request.cookies.get('theme', ''))
