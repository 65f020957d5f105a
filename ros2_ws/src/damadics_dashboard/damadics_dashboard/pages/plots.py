# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The plots of a valve, live and in replay: Apache ECharts fed with what is new."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias, TypedDict

import numpy as np
from damadics_fd.core.stamps import SECOND as NANO
from nicegui import ui

from damadics_dashboard.live.traces import Points, Trace, block_means, envelope
from damadics_dashboard.pages.charts import Options
from damadics_dashboard.pages.elements import box, tell, with_values

BUCKETS = 240  # intervals across a plot: two points each at most, three pixels wide
BLOCK = NANO // 10  # of the signature: means over 0.1 s cancel 50 and 60 Hz hum
HALF, SLOW = 2, 5  # turns between two of a plot that nobody watches closely, of a slow one
SMALLEST = 1e-5  # 1/s; a logarithmic axis has no zero

Area: TypeAlias = list[dict[str, float]]  # {'xAxis': begin}, {'xAxis': end} [s]


News = TypedDict(  # what `damadics.push` takes for one chart; `from` is a word of Python
    'News',
    {
        'all': bool,
        'from': Sequence[float],
        'series': Sequence[Points],
        'range': Sequence[float],
        'areas': list[Area],
        'absent': bool,  # samples have come, but not one value of these curves
    },
    total=False,
)


class Notes(NamedTuple):
    """What stands in place of curves."""

    loading: str  # until the server has told of them
    empty: str  # there are none yet
    absent: str = ''  # there will be none: nobody measures this


class Plot:
    """
    One chart on a page.

    :param options: ECharts options.
    :param colors: CSS variable of the colour of each curve.
    :param label: what a screen reader says.
    :param style: CSS classes.
    :param group: charts of one name share zoom and cursor.
    :param notes: shown where there is nothing to plot.
    """

    def __init__(
        self,
        options: Options,
        colors: list[str],
        label: str,
        style: str = 'plot',
        *,
        group: str = '',
        notes: Notes | None = None,
    ) -> None:
        xy = options['series'][0]['type'] == 'scatter'
        with box('div', 'plot-box'):
            self.chart = ui.echart(dict(options)).classes(style)
            with_values(self.chart, role='img', aria_label=label)
            if notes:
                place = ui.label(notes.loading).classes('plot-note')
                with_values(
                    place,
                    data_plot=self.chart.id,
                    data_empty=notes.empty,
                    data_absent=notes.absent or notes.empty,
                )
        tell('register', self.chart.id, {'colors': colors, 'xy': xy, 'group': group})

    @property
    def id(self) -> int:
        """Element id on the page."""
        return self.chart.id


@dataclass
class Curve:
    """
    One curve of a plot over time and what of it the browser has already.

    :param trace: where its samples are.
    :param column: of the trace.
    :param largest: draw the largest value of each interval only, no smaller than `SMALLEST`.
    :param scale: factor from the unit of the samples to that of the plot.
    """

    trace: Trace
    column: str
    largest: bool = False
    scale: float = 1.0
    sent: int = -1  # start of the last interval sent [ns]

    def points(self, rows: np.ndarray, width: int) -> Points:
        """Thin out the samples given."""
        if self.largest:
            values = np.maximum(rows[self.column], SMALLEST)
            return envelope(rows['stamp'], values, width, largest=True)
        return envelope(rows['stamp'], rows[self.column] * self.scale, width)


@dataclass
class Feed:
    """
    Keeps the plots over time of one page up to date.

    :param curves: the curves of each plot.
    :param window: time shown [s].
    :param every: turns between two of a plot, where not every turn feeds it.
    """

    curves: dict[int, list[Curve]]
    window: float = 60.0
    every: dict[int, int] = field(default_factory=dict)
    _turn: int = field(default=0, init=False)
    _end: int = field(default=-1, init=False)

    def restart(self) -> None:
        """Send everything anew."""
        for curve in (c for curves in self.curves.values() for c in curves):
            curve.sent = -1
        self._end = -1

    def news(self) -> dict[int, News] | None:
        """
        Return what `damadics.push` needs.

        :return: None where nothing is new.
        """
        end = max(c.trace.newest for curves in self.curves.values() for c in curves)
        if end == self._end or end < 0:
            return None
        if end < self._end:
            self.restart()
        self._end = end
        self._turn += 1
        width = int(self.window * NANO / BUCKETS)
        first = min(
            int(c.trace.rows['stamp'][0])
            for curves in self.curves.values()
            for c in curves
            if c.trace.newest >= 0
        )
        begin = max(end - int(self.window * NANO), first)
        message: dict[int, News] = {}
        for plot, curves in self.curves.items():
            if not _told(curves):
                continue
            everything = any(c.sent < begin for c in curves)
            if self._turn % self.every.get(plot, 1) and not everything:
                continue
            series, starts = [], []
            for curve in curves:
                start = begin if everything else curve.sent
                rows = curve.trace.since(start - start % width)
                points = curve.points(rows, width)
                if len(rows):
                    newest = int(rows['stamp'][-1])
                    curve.sent = newest - newest % width
                series.append(_rounded(points))
                starts.append((start - start % width) * 1e-9 - 1e-6)
            message[plot] = {
                'all': everything,
                'from': starts,
                'series': series,
                'range': [begin * 1e-9, begin * 1e-9 + self.window],
                'absent': all(c.trace.newest >= 0 for c in curves) and not any(series),
            }
        return message

    def nothing(self) -> dict[int, News]:
        """Return what `damadics.push` needs for plots of which no sample is to be expected."""
        return {
            plot: {'all': True, 'from': [], 'series': [[] for _ in curves]}
            for plot, curves in self.curves.items()
            if not _told(curves)
        }


def _told(curves: Sequence[Curve]) -> bool:
    """Whether any sample of a plot has come."""
    return any(curve.trace.newest >= 0 for curve in curves)


def signature(trace: Trace, seconds: float) -> tuple[Points, Points]:
    """
    Return the signature before and now.

    :param trace: of the estimates, with `x`, `u` and `phase`.
    :param seconds: what counts as now.
    :return: fault-free reference (the time of learning, or the first that is kept), the latest.
    """
    rows = trace.rows
    if not len(rows):
        return [], []
    split = int(np.searchsorted(rows['stamp'], rows['stamp'][-1] - int(seconds * NANO)))
    before = rows[:split]
    learning = before[(before['phase'] == 1) | (before['phase'] == 2)]
    reference = learning if len(learning) else before
    keep = int(60.0 * NANO)
    if len(reference):
        reference = reference[
            : int(np.searchsorted(reference['stamp'], reference['stamp'][0] + keep))
        ]
    return (block_means(reference, 'x', 'u', BLOCK), block_means(rows[split:], 'x', 'u', BLOCK))


def _rounded(points: Points) -> Points:
    return [
        [None if t is None else round(t, 4), None if v is None else float(f'{v:.5g}')]
        for t, v in points
    ]
