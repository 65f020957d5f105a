# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The list of present alarms, on the overview and on a valve's page."""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from damadics_fd.core.text import SENTENCE, plain
from nicegui import ui

from damadics_dashboard.live.valve import Alarm, Valve
from damadics_dashboard.live.watcher import Watcher
from damadics_dashboard.pages.actions import alarm_buttons
from damadics_dashboard.pages.elements import box, markup, redraw, tell
from damadics_dashboard.pages.frame import may_operate
from damadics_dashboard.words.texts import Texts
from damadics_dashboard.words.valve_words import AlarmWords, alarm_kind, alarm_words

MOST = 50  # alarms that are listed; the tiles show all
Key = tuple[str, int]


@dataclass
class Row:
    """One alarm on the page."""

    box: ui.element
    head: ui.html
    evidence: ui.html
    acknowledge: ui.button | None


class AlarmList:
    """
    Present alarms, worst first: what is wrong, what to do, buttons, and the numbers behind it.

    :param watcher: the ROS side.
    :param valves: returns the valves that are listed.
    :param t: the words.
    :param name: whether to name the valve of each alarm.
    """

    def __init__(
        self,
        watcher: Watcher,
        valves: Callable[[], Iterable[Valve]],
        t: Texts,
        *,
        name: bool,
    ) -> None:
        self._watcher = watcher
        self._valves = valves
        self._t = t
        self._name = name
        self._rows: dict[Key, Row] = {}
        self._order: list[Key] = []
        self._acts = may_operate()
        self._empty = ui.label(t('no_alarms')).classes('empty')
        self._box = box('div', 'stack', role='list', aria_label=t('present_alarms'))

    def update(self) -> int:
        """
        Show what is present now.

        :return: the number of alarms.
        """
        found: dict[Key, tuple[Valve, Alarm]] = {}
        for valve in self._valves():
            alarm = valve.alarm()
            if alarm is not None:
                found[valve.name, alarm.occurrence] = valve, alarm
        order = sorted(found, key=lambda k: (found[k][1].acknowledged, -found[k][1].level, k))[
            :MOST
        ]
        for gone in set(self._rows) - set(order):
            self._rows.pop(gone).box.delete()
        for key in order:
            self._show(key, *found[key])
        if order != self._order:
            for place, key in enumerate(order):
                self._rows[key].box.move(target_index=place)
            self._order = order
        self._empty.set_visibility(not found)
        return len(found)

    def _show(self, key: Key, valve: Valve, alarm: Alarm) -> None:
        words = alarm_words(valve, alarm, self._t, name=self._name)
        if key not in self._rows:
            self._rows[key] = self._row(valve, alarm, words)
            said = plain(f'{valve.title}: {words.headline} {words.advice}', SENTENCE)
            old = time.monotonic() - valve.flag_at > 2.0 or alarm.acknowledged
            tell('alarm', said, old)
        row = self._rows[key]
        if row.acknowledge is not None:
            row.acknowledge.set_visibility(not alarm.acknowledged)
        kind = alarm_kind(alarm)
        fresh = 'fresh' if not alarm.acknowledged and alarm.state == 'active' else ''
        row.box.classes(replace=f'alarm {kind} {fresh}')
        redraw(
            row.head,
            'alarm.html',
            kind=kind,
            headline=words.headline,
            advice=words.advice,
            level=words.level,
            state=words.state,
            acknowledged=alarm.acknowledged,
            seen=words.seen,
            since=words.since,
        )
        redraw(
            row.evidence, 'evidence.html', cells=words.cells, found=words.found, text=words.text
        )

    def _row(self, valve: Valve, alarm: Alarm, words: AlarmWords) -> Row:
        with self._box, box('div', role='listitem', data_occurrence=alarm.occurrence) as row:
            with box('div', 'body'):
                head = ui.html('', sanitize=False)
                with box('details', 'behind'):
                    with box('summary'):
                        ui.label(self._t('behind'))
                    evidence = markup('evidence.html', cells=[], found='', text='')
            acknowledge = None
            if self._acts:
                acknowledge = alarm_buttons(self._watcher, valve, alarm.occurrence, self._t)
        return Row(row, head, evidence, acknowledge)
