# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page of one valve: state, alarms, signals, signature, trends, history, simulator."""

import time
from typing import TypedDict
from urllib.parse import unquote

from damadics_fd.core.stamps import SECOND as NANO
from damadics_fd.core.text import NAME, plain
from nicegui import ui

from damadics_dashboard.live.traces import Points
from damadics_dashboard.live.valve import Condition, Valve
from damadics_dashboard.live.watcher import Watcher
from damadics_dashboard.pages.actions import valve_buttons
from damadics_dashboard.pages.alarms import AlarmList
from damadics_dashboard.pages.elements import box, markup, redraw, tell, with_values
from damadics_dashboard.pages.frame import card, frame, may_operate
from damadics_dashboard.pages.plots import Area, Feed, signature
from damadics_dashboard.pages.report_button import report_button
from damadics_dashboard.pages.valve.partial_stroke import StrokeItem
from damadics_dashboard.pages.valve.signals import Signals
from damadics_dashboard.pages.valve.simulator import simulator_panel
from damadics_dashboard.pages.valve.trend_card import TrendCard
from damadics_dashboard.words.commission import commission_words
from damadics_dashboard.words.findings import headline, of_limit
from damadics_dashboard.words.texts import DASH, Texts
from damadics_dashboard.words.valve_words import history_rows, reason_of

PERIOD = 0.2  # s
SIGNATURE_NOW = 30.0  # s
WINDOWS = (10.0, 60.0, 600.0)  # s
HISTORY = 30  # rows
ARRIVES = 5.0  # s, within which samples come where there are any


class Figure(TypedDict):
    """One number of the banner."""

    name: str
    value: str
    unit: str
    aging: bool
    share: float | None


class Banner(TypedDict):
    """What the banner shows."""

    kind: str
    title: str
    detail: str
    alarm: str
    figures: list[Figure]


def valve_page(watcher: Watcher, address: str, window: float = 60.0, days: str = '') -> None:
    """
    Draw the page.

    :param watcher: the ROS side.
    :param address: last part of the page's address.
    :param window: time that the plots show [s], from the address.
    :param days: time that the trends show, from the address.
    """
    name = unquote(address)
    name = '' if name == '~root' else name
    valve = watcher.valves.get(name)
    if valve is None:
        with frame('unknown_valve', '', watcher) as t:
            markup(
                'message.html',
                role='alert',
                title=t('no_such_valve', name=plain(name, NAME)),
                lines=[t('not_seen')],
                address='/',
                link=t('all_valves'),
            )
            ui.timer(0.5, lambda: ui.navigate.reload() if name in watcher.valves else None)
        return
    watcher.want(name)
    tagged = valve.tag and valve.tag != valve.title
    with frame(f'{valve.title} {valve.tag}' if tagged else valve.title, '', watcher) as t:
        _Page(watcher, valve, t, window if window in WINDOWS else WINDOWS[1], days)


class _Page:
    """The content, and what keeps it up to date."""

    def __init__(self, watcher: Watcher, valve: Valve, t: Texts, window: float, days: str) -> None:
        self._watcher = watcher
        self._valve = valve
        self._t = t
        self._second = 0
        self._paused = False
        self._opened = time.monotonic()
        self._missing = (False, False)  # the valve is silent; what comes would have come
        self._clouds: tuple[Points, Points] | None = None  # goes with the curves: one drawing
        self._head(window)
        self._banner = markup('banner.html', kind='off', title='', detail='', figures=[])
        self._banner.classes('w-full')
        self._commission = markup('commission.html', words=commission_words({}, t))
        self._commission.classes('w-full')
        self._alarm_box = box('div', 'w-full', id='alarms')
        with self._alarm_box, card(t('alarms'), classes='w-full'):
            self._alarms = AlarmList(watcher, lambda: (valve,), t, name=False)
        self._grid = box('div', 'grid')
        with self._grid:
            self._signals = Signals(valve, t, SIGNATURE_NOW)
        self._feed = Feed(self._signals.curves, window, self._signals.every)
        self._trends = TrendCard(watcher.trends.intervals, valve, t, days)
        with card(t('history'), classes='w-full'):
            self._history = markup('history.html', rows=[], empty='', heads=[], named=False)
            self._history.classes('w-full')
        self._simulator = box('div', 'w-full')
        self._simulated = False
        self._slow()
        ui.timer(PERIOD, self._fast)
        ui.timer(0.25, self._slow)

    def _head(self, window: float) -> None:
        t, valve = self._t, self._valve
        with box('div', 'row w-full'):
            self._title = markup('title.html', text='')
            self._draw_title()
            box('span', 'spacer')
            shown = {seconds: t.duration(seconds).removesuffix(' 0 s') for seconds in WINDOWS}
            choice = ui.toggle(shown, value=window, on_change=lambda e: self._show(e.value))
            choice.props('no-caps dense unelevated padding="4px 12px"').classes('seg')
            with_values(choice, role='group', aria_label=t('time_shown'))
            self._hold = ui.button(icon='pause', on_click=self._pause, color=None)
            with_values(
                self._hold.props('flat round dense').classes('quiet'), aria_label=t('pause')
            )
            whole = ui.button(icon='zoom_out_map', color=None).props('flat round dense')
            whole.classes('quiet whole').on('click', js_handler='() => damadics.whole()')
            with_values(whole, aria_label=t('whole'), title=t('whole'))
            report_button(valve.name, t)
            self._strokes: StrokeItem | None = None
            if may_operate():
                with valve_buttons(self._watcher, valve, t):
                    self._strokes = StrokeItem(self._watcher, valve, t)

    def _draw_title(self) -> None:
        valve = self._valve
        redraw(
            self._title,
            'title.html',
            back=f'{self._t("fleet")} /',
            text=valve.title,
            tag=valve.tag if valve.tag != valve.title else '',
        )

    def _show(self, window: float) -> None:
        self._feed.window = float(window)
        self._feed.restart()
        tell('whole')
        tell('remember', 'window', f'{window:g}')

    def _pause(self) -> None:
        self._paused = not self._paused
        words = self._t('resume' if self._paused else 'pause')
        icon = 'play_arrow' if self._paused else 'pause'
        with_values(self._hold, icon=icon, aria_label=words)

    def _fast(self) -> None:
        if self._paused:
            return
        news = self._feed.news() or {}
        if residual := news.get(self._signals.residual.id):
            residual['areas'] = self._areas()
        if self._clouds is not None:
            plot = self._signals.signature.id
            news[plot] = {'all': True, 'from': [0, 0], 'series': self._clouds}
            self._clouds = None
        if news:
            tell('push', news)

    def _areas(self) -> list[Area]:
        """Mark the time of the present alarm."""
        alarm = self._valve.alarm()
        if alarm is None or not alarm.onset:
            return []
        end = alarm.onset * 1e-9 + (alarm.evidence.get('duration') or 0.0)
        if alarm.state == 'active':
            end = self._valve.traces['threshold'].newest / NANO
        return [[{'xAxis': alarm.onset * 1e-9}, {'xAxis': end}]]

    def _slow(self) -> None:
        now, clock = time.monotonic(), self._watcher.clock
        valve = self._valve
        self._watcher.want(valve.name)
        condition = valve.condition(now, clock)
        redraw(self._banner, 'banner.html', **self._banner_values(condition, now, clock))
        old = valve.age(now, clock)
        tell('age', None if old is None else round(old, 1))
        stale = condition.kind == 'off'
        self._grid.classes(add='stale' if stale else '', remove='' if stale else 'stale')
        waited = now - self._opened > ARRIVES
        bare = (stale or waited) and all(trace.newest < 0 for trace in valve.traces.values())
        if (stale, waited) > self._missing:  # until then what has not come is on its way
            tell('push', self._feed.nothing())
        self._missing = (stale, waited)
        self._grid.classes(add='bare' if bare else '', remove='' if bare else 'bare')
        self._alarm_box.set_visibility(self._alarms.update() > 0)
        if self._watcher.offers(self._valve.name, 'inject_fault') != self._simulated:
            self._simulated = not self._simulated
            self._simulator.clear()
            if self._simulated and may_operate():
                with self._simulator:
                    simulator_panel(self._watcher, self._valve, self._t)
        self._second += 1
        if self._second % 4 == 1:
            self._draw_title()
            self._draw_history()
            self._signals.show_values()
            self._trends.update()
            told = valve.diagnostics.get('detector', {})
            redraw(self._commission, 'commission.html', words=commission_words(told, self._t))
            if self._strokes is not None:
                self._strokes.update()
            if not self._paused and (stale or waited or valve.traces['estimate'].newest >= 0):
                self._clouds = signature(valve.traces['estimate'], SIGNATURE_NOW)

    def _banner_values(self, condition: Condition, now: float, clock: int) -> Banner:
        t, valve = self._t, self._valve
        alarm = valve.alarm()
        told = ''
        if alarm is not None:
            what, _, _ = headline(alarm.evidence, t)
            told = t('alarm_is', what=t('state_lost') if alarm.state == 'unknown' else what)
        ratio, monitored = max(valve.ratio, 0.0), condition.kind != 'off'
        learns = condition.kind == 'learn'
        judged = monitored and not learns  # a limit that is still learned means nothing
        heard = monitored or valve.period > 0.0
        learned = heard and (valve.progress > 0.0 or learns)  # else not told yet
        rate = f'{1.0 / valve.period:.0f}' if valve.period > 0.0 else DASH
        return {
            'kind': condition.kind,
            'title': t(condition.title),
            'detail': reason_of(valve, condition, t, now),
            'alarm': told,
            'figures': [
                _figure(
                    t('residual'),
                    of_limit(ratio, t) if judged else DASH,
                    share=ratio if judged else None,
                ),
                _figure(t('last_sample'), '–', t('ago'), aging=True),
                _figure(t('samples'), rate, 'Hz' if valve.period > 0.0 else ''),
                _figure(t('learned'), t.percent(valve.progress) if learned else DASH),
                _figure(t('lost_samples'), str(valve.lost) if heard else DASH),
            ],
        }

    def _draw_history(self) -> None:
        t = self._t
        rows = self._watcher.history.latest(self._valve.name, HISTORY)
        redraw(
            self._history,
            'history.html',
            rows=history_rows(rows, t),
            empty=t('nothing_happened'),
            caption=t('alarm_history'),
            heads=[t(k) for k in ('time', 'class', 'what', 'alarm', 'peak', 'text')],
            named=False,
        )


def _figure(
    name: str,
    value: str,
    unit: str = '',
    *,
    aging: bool = False,
    share: float | None = None,
) -> Figure:
    return {'name': name, 'value': value, 'unit': unit, 'aging': aging, 'share': share}
