# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The list of present alarms, on the overview and on a valve's page."""

import time
from collections.abc import Callable, Iterable

from nicegui import ui

from damadics_dashboard import markup
from damadics_dashboard.actions import alarm_buttons
from damadics_dashboard.valve import Alarm, Valve
from damadics_dashboard.watcher import Watcher


class AlarmList:
    """
    Present alarms, worst first, with evidence and buttons.

    :param watcher: the ROS side.
    :param valves: returns the valves that are listed.
    :param name: whether to name the valve of each alarm.
    """

    def __init__(
        self, watcher: Watcher, valves: Callable[[], Iterable[Valve]], *, name: bool
    ) -> None:
        self._watcher = watcher
        self._valves = valves
        self._name = name
        self._rows: dict[tuple[str, int], tuple[ui.element, ui.html, ui.button]] = {}
        self._order: list[tuple[str, int]] = []
        self._empty = ui.html('<p class="empty">No alarms.</p>', sanitize=False)
        self._box = (
            ui.element('div').classes('stack').props('role="list" aria-label="present alarms"')
        )

    def update(self) -> int:
        """
        Show what is present now.

        :return: the number of alarms.
        """
        present: dict[tuple[str, int], tuple[Valve, Alarm]] = {}
        for valve in self._valves():
            alarm = valve.alarm()
            if alarm is not None:
                present[valve.name, alarm.occurrence] = valve, alarm
        for gone in set(self._rows) - set(present):
            self._rows.pop(gone)[0].delete()
        for key, (valve, alarm) in present.items():
            if key not in self._rows:
                self._rows[key] = self._row(valve, alarm)
                if time.monotonic() - valve.flag_at < 2.0:
                    ui.run_javascript(f'damadics.say({_announcement(valve, alarm)!r})')
            row, body, acknowledge = self._rows[key]
            acknowledge.set_visibility(not alarm.acknowledged)
            kind = markup.alarm_kind(alarm)
            fresh = 'fresh' if not alarm.acknowledged and alarm.state == 'active' else ''
            row.classes(replace=f'alarm {kind} {fresh}')
            content = (
                f'<div class="row">'
                f'{markup.symbol(kind)}<div>'
                f'{markup.alarm_body(valve, alarm, name=self._name)}</div></div>'
            )
            if body.content != content:
                body.set_content(content)
        order = sorted(present, key=lambda k: (-present[k][1].level, k))
        if order != self._order:
            for place, key in enumerate(order):
                self._rows[key][0].move(target_index=place)
            self._order = order
        self._empty.set_visibility(not present)
        return len(present)

    def _row(self, valve: Valve, alarm: Alarm) -> tuple[ui.element, ui.html, ui.button]:
        with self._box, ui.element('div').props('role="listitem"') as row:
            row.props(f'data-occurrence={alarm.occurrence}')
            body = ui.html('', sanitize=False).classes('body')
            acknowledge = alarm_buttons(self._watcher, valve, alarm.occurrence)
        return row, body, acknowledge


def _announcement(valve: Valve, alarm: Alarm) -> str:
    text = f'Alarm {alarm.occurrence} at {valve.title}: {alarm.evidence.get("text", "")}'
    return ''.join(c for c in text if c.isprintable() and c not in '\\\'"<>')
