# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""How a valve has changed over days to years, with its limits."""

import time

import numpy as np
from damadics_fd.store.intervals import TRENDED, Intervals, Series
from nicegui import ui

from damadics_dashboard.live.traces import Points
from damadics_dashboard.live.valve import Valve
from damadics_dashboard.pages.charts import time_plot
from damadics_dashboard.pages.elements import box, tell, with_values
from damadics_dashboard.pages.frame import card
from damadics_dashboard.pages.plots import Notes, Plot
from damadics_dashboard.words.outlook import factor_of, outlook_words, unit_of
from damadics_dashboard.words.texts import Texts

RANGES = (1, 30, 365, 3650)  # days
DAY = 86400.0
REFRESH = 60.0  # s
DASHES = 300  # in the width of a plot: three pixels each
COLORS = ['--before', '--now', '--before', '--rho', '--rho']


class TrendCard:
    """
    One quantity over time: mean, least and greatest of each interval, limits, time to limit.

    :param intervals: where the trends are kept.
    :param valve: the valve.
    :param t: the words.
    :param days: time shown at first, from the address.
    """

    def __init__(self, intervals: Intervals, valve: Valve, t: Texts, days: str) -> None:
        self._intervals = intervals
        self._valve = valve
        self._t = t
        self._next = 0.0
        chosen = int(days) if days.isdigit() and int(days) in RANGES else RANGES[1]
        with card(t('trend_title'), classes='w-full') as head:
            with head:
                box('span', 'spacer')
                names = {name: t(f'trend_{name}') for name in TRENDED}
                self._quantity = ui.select(names, value='friction', label=t('quantity'))
                self._quantity.props('dense outlined options-dense').classes('filter')
                ranges = {n: t(f'days_{n}') for n in RANGES}
                self._range = ui.toggle(ranges, value=chosen)
                self._range.props('no-caps dense unelevated padding="4px 12px"').classes('seg')
                with_values(self._range, role='group', aria_label=t('time_shown'))
            self._plots = box('div', 'w-full')
            self._words = ui.label('').classes('trend-words')
        self._draw_frame()
        self._quantity.on_value_change(self._changed)
        self._range.on_value_change(self._changed)

    def update(self) -> None:
        """Draw anew where a minute is over."""
        if time.monotonic() >= self._next:
            self._draw()

    def _changed(self) -> None:
        tell('remember', 'days', str(self._range.value))
        self._plots.clear()
        self._draw_frame()
        self._draw()

    def _draw_frame(self) -> None:
        t, quantity = self._t, str(self._quantity.value)
        curves = [t('least'), t('mean'), t('greatest')]
        limits = t.causes.limits.get(quantity, ())
        names = curves + [t('limit')] * len(limits)
        with self._plots:
            self._plot = Plot(
                time_plot(
                    names,
                    unit_of(quantity),
                    bands=(curves[0], curves[2]),
                    dashed=(t('limit'),),
                ),
                COLORS[: len(names)],
                t('trend_label'),
                notes=Notes(t('loading'), t('no_trend_yet')),
                group='trend',
            )

    def _draw(self) -> None:
        self._next = time.monotonic() + REFRESH
        now, quantity = time.time(), str(self._quantity.value)
        since = now - DAY * int(self._range.value)
        found = self._intervals.series(self._valve.name, quantity, since, now)
        limits = self._t.causes.limits.get(quantity, ())
        factor = factor_of(quantity)
        series: list[Points] = [
            points_of(found, values * factor, (now - since) / DASHES)
            for values in (found.least, found.mean, found.greatest)
        ]
        if len(found.start):
            span = [float(found.start[0]), float(found.start[-1])]
            series += [[[at, limit * factor] for at in span] for limit in limits]
        else:
            series += [[] for _ in limits]
        first = float(found.start[0]) if len(found.start) else since
        shown = [max(since, first - found.length), now]
        tell('push', {self._plot.id: {'all': True, 'series': series, 'from': [], 'range': shown}})
        words = outlook_words(quantity, found, limits, now, self._t) if len(found.start) else ''
        self._words.set_text(words)  # without a trend the plot itself says so


def points_of(found: Series, values: np.ndarray, dash: float = 0.0) -> Points:
    """
    Return a trend as a curve that is broken where nothing is known.

    :param found: the trend.
    :param values: of each of its intervals.
    :param dash: least length that is seen [s]: an interval that stands alone is drawn so long.
    :return: points (time [s], value).
    """
    points: Points = []
    middle = found.start + 0.5 * found.length
    gaps = np.flatnonzero(np.diff(found.start) > 4.0 * found.length) + 1
    for run in np.split(np.arange(len(middle)), gaps):
        at, shown = middle[run].tolist(), [float(f'{value:.5g}') for value in values[run]]
        if len(run) == 1:
            half = 0.5 * max(found.length, dash)
            at, shown = [at[0] - half, at[0] + half], shown * 2
        if points and at:
            points.append([at[0], None])
        points += [[time, value] for time, value in zip(at, shown, strict=True)]
    return points
