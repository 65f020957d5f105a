# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What happened, and what people did: filter, search, export, comments."""

import csv
import io
import time

from damadics_fd.core.text import COMMENT, NAME, plain
from nicegui import ui

from damadics_dashboard.live.watcher import Watcher
from damadics_dashboard.pages.elements import box, button, markup, redraw, with_values
from damadics_dashboard.pages.frame import card, frame, grant, keep_user, may_operate, user_name
from damadics_dashboard.store.export import cell
from damadics_dashboard.store.history import ACTION_COLUMNS, COLUMNS, Wanted
from damadics_dashboard.store.rows import ActionRow
from damadics_dashboard.words.answers import result_words
from damadics_dashboard.words.texts import Texts
from damadics_dashboard.words.valve_words import TRANSITIONS, address, history_rows

DAYS = {0: 'all_time', 1: 'last_day', 7: 'last_week', 30: 'last_month', 365: 'last_year'}
PAGE = 100  # rows
EXPORTED = 100_000  # rows of a file


def history_page(watcher: Watcher, text: str = '', valve: str = '') -> None:
    """
    Draw the page.

    :param watcher: the ROS side.
    :param text: words to look for, from the address.
    :param valve: only this valve, from the address.
    """
    with frame('history', '/history', watcher) as t:
        with box('div', 'row w-full'):
            markup('title.html', text=t('history'))
            box('span', 'spacer')
            button(t('export_csv'), lambda: _export(watcher, view.wanted, t), icon='download')
        view = _View(watcher, t, text, valve)


class _View:
    """The filters and the two tables."""

    def __init__(self, watcher: Watcher, t: Texts, text: str, valve: str) -> None:
        self._watcher = watcher
        self._t = t
        self._rows = PAGE
        with box('div', 'row w-full filters'):
            self._text = ui.input(t('search'), value=text).props('dense outlined clearable')
            names = {'': t('all_valves')} | {v: v or 'valve' for v in watcher.history.valves()}
            chosen = valve if valve in names else ''
            self._valve = ui.select(names, value=chosen, label=t('valve'))
            kinds = {-1: t('all_kinds')} | {k: t(key) for k, key in TRANSITIONS.items()}
            self._kind = ui.select(kinds, value=-1, label=t('what'))
            self._days = ui.select(
                {n: t(key) for n, key in DAYS.items()}, value=0, label=t('period')
            )
            for select in (self._valve, self._kind, self._days):
                select.props('dense outlined options-dense').classes('filter')
            for element in (self._text, self._valve, self._kind, self._days):
                element.on_value_change(self._draw)
        with card(t('alarms'), classes='w-full'):
            self._events = markup('history.html', rows=[], empty='', heads=[], named=True)
            self._events.classes('w-full')
            self._more = button(t('show_more'), self._longer)
        with card(t('operator_actions'), t('operator_actions_text'), 'w-full'):
            self._actions = markup('actions.html', rows=[], empty='', heads=[])
            self._actions.classes('w-full')
            if may_operate():
                self._comment_row()
        self._draw()
        ui.timer(1.0, self._draw)

    @property
    def wanted(self) -> Wanted:
        """What the filters ask for."""
        days = int(self._days.value)
        kind = int(self._kind.value)
        return Wanted(
            plain(self._text.value or '', NAME),
            self._valve.value or None,
            () if kind < 0 else (kind,),
            time.time() - 86400.0 * days if days else 0.0,
        )

    def _longer(self) -> None:
        self._rows += PAGE
        self._draw()

    def _draw(self) -> None:
        t, wanted = self._t, self.wanted
        rows = self._watcher.history.find(wanted, self._rows + 1)
        redraw(
            self._events,
            'history.html',
            rows=history_rows(rows[: self._rows], t),
            empty=t('nothing_found'),
            caption=t('alarm_history'),
            heads=[t(k) for k in ('time', 'valve', 'class', 'what', 'alarm', 'peak', 'text')],
            named=True,
        )
        self._more.set_visibility(len(rows) > self._rows)
        actions = self._watcher.history.actions(wanted, PAGE)
        redraw(
            self._actions,
            'actions.html',
            rows=[_action(row, t) for row in actions],
            empty=t('nothing_found'),
            caption=t('operator_actions'),
            heads=[t(k) for k in ('time', 'valve', 'action', 'who', 'comment', 'result')],
        )

    def _comment_row(self) -> None:
        t = self._t
        with box('div', 'row comment'):
            text = ui.input(t('comment_on')).props('dense outlined')
            with_values(text.classes('comment-text'), maxlength=COMMENT)
            who = ui.input(t('your_name'), value=user_name())
            with_values(who.props('dense outlined'), maxlength=NAME)
            who.set_enabled(not grant().name)

            def add() -> None:
                said = plain(text.value or '', COMMENT)
                if not said:
                    ui.notify(t('comment_empty'), type='warning')
                    return
                name = plain(who.value or '', NAME)
                keep_user(name)
                self._watcher.note_action(
                    self._valve.value or '',
                    'comment',
                    user=name,
                    role=str(grant().role),
                    comment=said,
                    done=True,
                    result='',
                )
                text.set_value('')
                self._draw()

            with_values(button(t('add_comment'), add, 'main'), aria_label=t('add_comment'))


def _action(row: ActionRow, t: Texts) -> dict[str, str]:
    key = f'action_{row["action"]}'
    role = row['role'] and t.entries.get(f'role_{row["role"]}', row['role'])
    return {
        'moment': t.moment(int(row['seen'] * 1e9)),
        'valve': row['valve'] or '–',
        'address': address(row['valve']) if row['valve'] else '',
        'what': t.entries.get(key, row['action']),
        'who': f'{row["user"] or t("nobody")}' + (f' ({role})' if role else ''),
        'comment': row['comment'] or '',
        'result': result_words(row, t),
    }


def _export(watcher: Watcher, wanted: Wanted, t: Texts) -> None:
    """Send what the filters find as a file for a spreadsheet."""
    stream = io.StringIO()
    table = csv.writer(stream)
    table.writerow(('kind', *COLUMNS, *(c for c in ACTION_COLUMNS if c not in COLUMNS)))
    for row in watcher.history.find(wanted, EXPORTED):
        table.writerow(('event', *(cell(row.get(name)) for name in COLUMNS)))
    for done in watcher.history.actions(wanted, EXPORTED):
        common = (cell(done.get(name, '')) for name in COLUMNS)
        rest = (cell(done.get(name)) for name in ACTION_COLUMNS if name not in COLUMNS)
        table.writerow(('action', *common, *rest))
    ui.download.content(stream.getvalue().encode('utf-8-sig'), 'history.csv', 'text/csv')
