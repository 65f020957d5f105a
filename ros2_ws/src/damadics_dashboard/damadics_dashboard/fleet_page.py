# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The overview: one tile per valve, and every alarm."""

import time

from nicegui import ui

from damadics_dashboard import markup
from damadics_dashboard.alarms import AlarmList
from damadics_dashboard.frame import frame
from damadics_dashboard.watcher import Watcher

PERIOD = 0.2  # s
CLASSES = (
    ('F', 'failure'),
    ('S', 'out of specification'),
    ('M', 'maintenance'),
    ('C', 'function check'),
    ('off', 'not monitored'),
    ('learn', 'learning'),
    ('ok', 'healthy'),
)
START = 'ros2 run damadics_bringup run --simulate'


def fleet_page(watcher: Watcher) -> None:
    """
    Draw the page.

    :param watcher: the ROS side.
    """
    with frame('Fleet', '/', watcher):
        with ui.element('div').classes('row w-full'):
            ui.html('<h1>Fleet</h1>', sanitize=False)
            ui.element('span').classes('spacer')
            counts = ui.html('', sanitize=False).classes('counts')
        nothing = ui.html(
            '<div class="card"><h2>No valve on this ROS domain yet</h2><p class="sub" '
            'style="margin:6px 0 10px">A valve appears by itself as soon as its detector or its '
            'measurement is there. To try it with a simulated valve:</p>'
            f'<span class="code">{START}</span></div>',
            sanitize=False,
        ).classes('w-full')
        tiles = ui.element('div').classes('tiles').props('role="list" aria-label="valves"')
        with ui.element('section').classes('card w-full').props('aria-label="alarms"'):
            with ui.element('div').classes('head'):
                ui.html('<h2>Alarms</h2>', sanitize=False)
                number = ui.label('').classes('sub')
            alarms = AlarmList(watcher, lambda: tuple(watcher.valves.values()), name=True)
        shown: dict[str, ui.html] = {}

        def update() -> None:
            now = time.monotonic()
            valves = sorted(watcher.valves.values(), key=lambda v: v.title)
            kinds = [valve.condition(now).kind for valve in valves]
            for valve in valves:
                if valve.name not in shown:
                    with tiles:
                        shown[valve.name] = ui.html('', sanitize=False).props('role="listitem"')
                content = markup.tile(valve, now)
                if shown[valve.name].content != content:
                    shown[valve.name].set_content(content)
            nothing.set_visibility(not valves)
            summary = ''.join(
                f'<span class="count {"" if kinds.count(kind) else "none"}">'
                f'{markup.symbol(kind)}<b>{kinds.count(kind)}</b>{words}</span>'
                for kind, words in CLASSES
                if kinds.count(kind) or kind in ('F', 'off', 'ok')
            )
            if counts.content != summary:
                counts.set_content(summary)
            present = alarms.update()
            number.set_text(f'{present} present' if present else '')

        update()
        ui.timer(PERIOD, update)


def history_page(watcher: Watcher) -> None:
    """
    Draw the page with the history of all valves.

    :param watcher: the ROS side.
    """
    with frame('History', '/history', watcher):
        ui.html('<h1>History</h1>', sanitize=False)
        with ui.element('section').classes('card w-full'):
            table = ui.html('', sanitize=False).classes('w-full')

        def update() -> None:
            content = markup.history_table(watcher.history.latest(), name=True)
            if table.content != content:
                table.set_content(content)

        update()
        ui.timer(1.0, update)
