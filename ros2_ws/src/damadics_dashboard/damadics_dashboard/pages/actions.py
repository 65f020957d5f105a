# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What an operator can do to a valve: buttons that call its services, and who pressed them."""

from collections.abc import Awaitable, Callable, Mapping
from typing import TypeAlias

from damadics_fd.core.text import COMMENT, NAME, plain
from damadics_msgs.srv import Acknowledge, Reference, Relearn, ResetAlarm, Shelve
from nicegui import ui

from damadics_dashboard.live.calls import Field, Service, ServiceError
from damadics_dashboard.live.valve import Valve
from damadics_dashboard.live.watcher import Watcher
from damadics_dashboard.pages.elements import box, button, with_values
from damadics_dashboard.pages.frame import grant, keep_user, user_name, words
from damadics_dashboard.words.answers import answer_words
from damadics_dashboard.words.texts import Texts

SHELVES = (600.0, 3600.0, 8 * 3600.0, 86400.0)
Act = Callable[..., Awaitable[bool]]
Asked: TypeAlias = ui.select | ui.number


async def call(
    watcher: Watcher, valve: str, service: str, kind: Service, **request: Field
) -> bool:
    """
    Call a service, keep who did what, and show the answer.

    :param watcher: the ROS side.
    :param valve: name of the valve.
    :param service: its name.
    :param kind: its type.
    :param request: its fields.
    :return: whether it was done.
    """
    who = grant()
    try:
        done, text = await watcher.call(valve, service, kind, request)
    except ServiceError as problem:
        done, text = False, str(problem)
    watcher.note_action(
        valve,
        service,
        user=str(request.get('user', '')) or user_name(),
        role=str(who.role),
        comment=str(request.get('comment', '')),
        done=done,
        result=text,
    )
    ui.notify(
        plain(answer_words(text, words().language)),
        type='positive' if done else 'negative',
        position='bottom-right',
        timeout=4000 if done else 9000,
        close_button='✕',
    )
    return done


class Dialog:
    """
    Ask for who and why, then act.

    :param t: the words.
    :param key: of the texts: `key`, `key_explained`, `key_do`.
    :param act: what is done; takes user, comment and what else is asked for.
    :param ask: draws what else is asked for; returns the fields by the name that `act` takes.
    """

    def __init__(
        self, t: Texts, key: str, act: Act, ask: Callable[[], Mapping[str, Asked]] = dict
    ) -> None:
        self._act = act
        with ui.dialog() as self._dialog, ui.card().classes('ask'):
            with_values(self._dialog, aria_label=t(key))
            ui.label(t(key)).classes('ask-title')
            ui.label(t(f'{key}_explained')).classes('sub')
            self._asked = ask()
            for field in self._asked.values():
                field.classes('w-full')
            self._user = ui.input(t('your_name'), value=user_name()).classes('w-full')
            with_values(self._user, maxlength=NAME)
            self._user.set_enabled(not grant().name)
            self._comment = ui.input(t('comment')).classes('w-full')
            with_values(self._comment, maxlength=COMMENT)
            with box('div', 'choice'):
                button(t('cancel'), self._dialog.close)
                button(t(f'{key}_do'), self._done, 'main')
        self._dialog.open()

    async def _done(self) -> None:
        self._dialog.close()
        keep_user(plain(self._user.value or '', NAME))
        await self._act(
            user=plain(self._user.value or '', NAME),
            comment=plain(self._comment.value or '', COMMENT),
            **{name: field.value for name, field in self._asked.items()},
        )
        self._dialog.delete()


def _for_time(t: Texts) -> dict[str, Asked]:
    """Ask for how long to shelve."""
    choices = {seconds: t.duration(seconds) for seconds in SHELVES}
    return {'duration': ui.select(choices, value=SHELVES[0], label=t('for_time'))}


def _caller(watcher: Watcher, name: str, service: str, kind: Service, **fixed: Field) -> Act:
    async def act(**given: Field) -> bool:
        return await call(watcher, name, service, kind, **fixed, **given)

    return act


def alarm_buttons(watcher: Watcher, valve: Valve, occurrence: int, t: Texts) -> ui.button:
    """
    Draw the buttons of an alarm.

    :param watcher: the ROS side.
    :param valve: the valve.
    :param occurrence: number of the alarm.
    :param t: the words.
    :return: the button that acknowledges.
    """
    name = valve.name
    acknowledge = _caller(watcher, name, 'acknowledge', Acknowledge, occurrence=occurrence)
    reset = _caller(watcher, name, 'reset', ResetAlarm)
    shelve = _caller(watcher, name, 'shelve', Shelve)

    async def seen() -> None:
        if user_name():
            await acknowledge(user=user_name())
        else:
            Dialog(t, 'acknowledge', acknowledge)

    with box('div', 'actions'):
        first = button(
            t('acknowledge'),
            seen,
            'main',
            label=t('acknowledge_of', valve=valve.title),
        )
        button(
            t('reset'), lambda: Dialog(t, 'reset', reset), label=t('reset_of', valve=valve.title)
        )
        button(
            t('shelve'),
            lambda: Dialog(t, 'shelve', shelve, lambda: _for_time(t)),
            label=t('shelve_of', valve=valve.title),
        )
    return first


def valve_buttons(watcher: Watcher, valve: Valve, t: Texts) -> ui.menu:
    """
    Draw what can be done to a valve at any time.

    :param watcher: the ROS side.
    :param valve: the valve.
    :param t: the words.
    :return: the menu, for what else can be done.
    """
    name = valve.name
    shelve = _caller(watcher, name, 'shelve', Shelve)
    relearn = _caller(watcher, name, 'relearn', Relearn)
    acknowledge = _caller(watcher, name, 'acknowledge', Acknowledge, occurrence=0)
    reset = _caller(watcher, name, 'reset', ResetAlarm)
    choices: tuple[tuple[str, Callable[[], object]], ...] = (
        ('acknowledge', lambda: Dialog(t, 'acknowledge', acknowledge)),
        ('reset', lambda: Dialog(t, 'reset', reset)),
        ('shelve', lambda: Dialog(t, 'shelve', shelve, lambda: _for_time(t))),
        ('end_shelf', _caller(watcher, name, 'shelve', Shelve, duration=0.0)),
        ('relearn', lambda: Dialog(t, 'relearn', relearn)),
        ('save_reference', _caller(watcher, name, 'save_reference', Reference)),
        ('load_reference', _caller(watcher, name, 'load_reference', Reference)),
    )
    with button(t('actions'), lambda: None) as opener:
        opener.props('icon-right=expand_more')
        with ui.menu() as menu:
            for key, act in choices:
                with_values(ui.menu_item(t(key), on_click=act), role='menuitem')
    return menu
