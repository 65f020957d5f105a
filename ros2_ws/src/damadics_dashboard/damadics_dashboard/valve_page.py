# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page of one valve: signals, residual, signature, alarms, history, simulator."""

import json
import time
from html import escape
from typing import Any
from urllib.parse import unquote

from nicegui import ui

from damadics_dashboard import markup
from damadics_dashboard.actions import simulator_panel, valve_buttons
from damadics_dashboard.alarms import AlarmList
from damadics_dashboard.frame import card, frame
from damadics_dashboard.plots import (
    Curve,
    Feed,
    Plot,
    signature,
    signature_plot,
    time_plot,
)
from damadics_dashboard.valve import NANO, Valve
from damadics_dashboard.watcher import Watcher

PERIOD = 1.0 / 12.0  # s: more than ten updates a second arrive although timers are late
SIGNATURE_NOW = 30.0  # s
WINDOWS = {10: '10 s', 60: '1 min', 600: '10 min'}


def valve_page(watcher: Watcher, address: str) -> None:
    """
    Draw the page.

    :param watcher: the ROS side.
    :param address: last part of the page's address.
    """
    name = unquote(address)
    name = '' if name == '~root' else name
    valve = watcher.valves.get(name)
    if valve is None:
        with frame('Unknown valve', '', watcher):
            ui.html(
                f'<div class="card"><h1>No valve {escape(name)}</h1><p class="sub">It has not '
                'been seen since the dashboard started. <a href="/"><u>All valves</u></a></p>'
                '</div>',
                sanitize=False,
            )
        return
    watcher.want(name)
    with frame(valve.title, '', watcher):
        _Page(watcher, valve)


class _Page:
    """The content, and what keeps it up to date."""

    def __init__(self, watcher: Watcher, valve: Valve) -> None:
        self._watcher = watcher
        self._valve = valve
        self._second = 0
        with ui.element('div').classes('row w-full'):
            ui.html(
                '<h1><a href="/" class="sub" aria-label="back to the fleet">Fleet&nbsp;/</a> '
                f'{escape(valve.title)}</h1>',
                sanitize=False,
            )
            ui.element('span').classes('spacer')
            window = (
                ui.toggle(WINDOWS, value=60, on_change=lambda e: self._show(e.value))
                .props('no-caps dense unelevated padding="4px 12px" aria-label="time shown"')
                .classes('seg')
            )
            self._hold = (
                ui.button(icon='pause', on_click=self._pause, color=None)
                .props('flat round dense aria-label="pause the plots"')
                .style('color: var(--muted)')
            )
            valve_buttons(watcher, valve)
        self._banner = ui.html('', sanitize=False).classes('w-full')
        self._grid = ui.element('div').classes('grid')
        with self._grid:
            with ui.element('div').classes('stack'):
                self._feed = Feed(self._time_plots(), float(window.value))
            with ui.element('div').classes('stack'):
                self._signature = self._signature_plot()
                with ui.element('section').classes('card').props('aria-label="alarms"'):
                    ui.html('<div class="head"><h2>Alarms</h2></div>', sanitize=False)
                    self._alarms = AlarmList(watcher, lambda: (valve,), name=False)
        self._simulator = ui.element('div').classes('w-full')
        self._simulated = False
        with ui.element('section').classes('card w-full').props('aria-label="history"'):
            ui.html('<div class="head"><h2>History</h2></div>', sanitize=False)
            self._history = ui.html('', sanitize=False).classes('w-full')
        self._paused = False
        self._slow()
        ui.timer(PERIOD, self._fast)
        ui.timer(0.25, self._slow)

    def _time_plots(self) -> dict[int, list[Curve]]:
        """Draw the plots over time and say what is in them."""
        traces = self._valve.traces
        curves: dict[int, list[Curve]] = {}
        with card('Control value and position', 'fractions of the stroke, 1 = closed'):
            plot = Plot(
                time_plot(['CV', 'X1'], '[1]', low=0.0, high=1.0, dashed=('CV',)),
                ['--cv', '--x1'],
                'control value and position over time',
            )
            curves[plot.id] = [
                Curve(traces['measurement'], 'cv'),
                Curve(traces['measurement'], 'x1'),
            ]
        with card('Residual against threshold', 'the largest of each interval') as head:
            with head:
                self._scale = (
                    ui.switch('logarithmic', value=True, on_change=self._rescale)
                    .props('dense')
                    .classes('scale')
                )
            self._residual = Plot(
                time_plot(['residual', 'threshold'], '[1/s]', log=True, dashed=('threshold',)),
                ['--residual', '--rho'],
                'velocity residual and threshold over time',
            )
            curves[self._residual.id] = [
                Curve(traces['estimate'], 'residual', largest=True),
                Curve(traces['threshold'], 'rho', largest=True),
            ]
        with card('Stem velocity', 'strokes per second'):
            plot = Plot(time_plot(['X2'], '[1/s]'), ['--velocity'], 'stem velocity over time')
            curves[plot.id] = [Curve(traces['estimate'], 'x2')]
        return curves

    def _signature_plot(self) -> Plot:
        with card('Valve signature', 'input over position, means of 0.1 s'):
            return Plot(
                signature_plot(('fault-free', f'last {SIGNATURE_NOW:.0f} s')),
                ['--before', '--now'],
                'valve signature: force over position',
                'plot tall',
            )

    def _show(self, window: float) -> None:
        self._feed.window = float(window)
        self._feed.restart()

    def _pause(self) -> None:
        self._paused = not self._paused
        words = 'resume the plots' if self._paused else 'pause the plots'
        self._hold.props(f'icon={"play_arrow" if self._paused else "pause"} aria-label="{words}"')

    def _rescale(self) -> None:
        kind = 'log' if self._scale.value else 'value'
        chart = self._residual.chart
        chart.options['yAxis']['type'] = kind
        chart.run_chart_method('setOption', {'yAxis': {'type': kind}})

    def _fast(self) -> None:
        if self._paused:
            return
        news = self._feed.news()
        if news is not None:
            news[self._residual.id]['areas'] = self._areas()
            ui.run_javascript(f'damadics.push({json.dumps(news, separators=(",", ":"))})')

    def _areas(self) -> list[Any]:
        """Mark the time of the present alarm."""
        alarm = self._valve.alarm()
        if alarm is None:
            return []
        end = alarm.onset * 1e-9 + (alarm.evidence.get('duration') or 0.0)
        if alarm.state == 'active':
            end = self._valve.traces['threshold'].newest / NANO
        return [[{'xAxis': alarm.onset * 1e-9}, {'xAxis': end}]]

    def _slow(self) -> None:
        now = time.monotonic()
        self._watcher.want(self._valve.name)
        condition = self._valve.condition(now)
        self._set(self._banner, markup.banner(self._valve, condition, now))
        stale = condition.kind == 'off'
        self._grid.classes(add='stale' if stale else '', remove='' if stale else 'stale')
        self._alarms.update()
        if self._watcher.offers(self._valve.name, 'inject_fault') != self._simulated:
            self._simulated = not self._simulated
            self._simulator.clear()
            if self._simulated:
                with self._simulator:
                    simulator_panel(self._watcher, self._valve)
        self._second += 1
        if self._second % 4 == 1:
            rows = self._watcher.history.latest(self._valve.name, 50)
            self._set(self._history, markup.history_table(rows, name=False))
            if not self._paused:
                self._draw_signature()

    def _draw_signature(self) -> None:
        clouds = signature(self._valve.traces['estimate'], SIGNATURE_NOW)
        message = {self._signature.id: {'all': True, 'from': [0, 0], 'series': clouds}}
        ui.run_javascript(f'damadics.push({json.dumps(message, separators=(",", ":"))})')

    @staticmethod
    def _set(element: ui.html, content: str) -> None:
        if element.content != content:
            element.set_content(content)
