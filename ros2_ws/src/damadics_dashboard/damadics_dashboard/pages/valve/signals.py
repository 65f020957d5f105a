# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The plots of a valve's signals and its signature."""

import math

from nicegui import ui

from damadics_dashboard.live.valve import Valve
from damadics_dashboard.pages.charts import Options, signature_plot, time_plot
from damadics_dashboard.pages.elements import box, markup, redraw
from damadics_dashboard.pages.frame import card
from damadics_dashboard.pages.plots import HALF, SLOW, Curve, Notes, Plot
from damadics_dashboard.words.texts import Texts

BAR = 1e-5  # bar per Pa
GROUP = 'signals'
VALUES = (  # column, factor, unit
    ('cv', 100.0, '%'),
    ('x1', 100.0, '%'),
    ('p1', BAR, 'bar'),
    ('p2', BAR, 'bar'),
    ('ps', BAR, 'bar'),
    ('flow', 1.0, 'kg/s'),
    ('t1', 1.0, '°C'),
)


class Signals:
    """
    The plots over time, the process values and the signature, in two columns.

    :param valve: the valve.
    :param t: the words.
    :param recent: what the signature counts as now [s].
    """

    def __init__(self, valve: Valve, t: Texts, recent: float) -> None:
        self._valve = valve
        self._t = t
        empty = t('no_data_yet') if valve.fleet is None else t('no_samples_of_fleet')
        self._notes = Notes(t('loading'), empty, t('not_measured'))
        self.curves: dict[int, list[Curve]] = {}
        with box('div', 'stack'):
            self._position()
            self.residual = self._residual()
            self._velocity()
            self._flow()
        with box('div', 'stack'):
            self.signature = self._signature(recent)
            self._process()

    def show_values(self) -> None:
        """Show the newest process values as numbers."""
        t = self._t
        rows = self._valve.traces['measurement'].rows
        cells = []
        for column, factor, unit in VALUES:
            value = float(rows[column][-1]) * factor if len(rows) else math.nan
            cells.append((t(f'signal_{column}'), t.number(value, unit)))
        redraw(self._values, 'values.html', cells=cells)

    @property
    def every(self) -> dict[int, int]:
        """Turns between two of a plot: process values change slowly."""
        return {self._velocities.id: HALF, self._pressures.id: SLOW, self._flows.id: SLOW}

    def _plot(self, curves: list[Curve], options: Options, colors: list[str], label: str) -> Plot:
        plot = Plot(options, colors, label, group=GROUP, notes=self._notes)
        self.curves[plot.id] = curves
        return plot

    def _position(self) -> None:
        t, trace = self._t, self._valve.traces['measurement']
        with card(t('position_title'), t('position_remark')):
            names = [t('signal_cv'), t('signal_x1')]
            self._plot(
                [Curve(trace, 'cv', scale=100.0), Curve(trace, 'x1', scale=100.0)],
                time_plot(names, '%', low=0.0, high=100.0, dashed=(names[0],)),
                ['--cv', '--x1'],
                t('position_label'),
            )

    def _residual(self) -> Plot:
        t, traces = self._t, self._valve.traces
        with card(t('residual_title'), t('residual_remark')) as head:
            with head:
                scale = ui.switch(t('logarithmic'), value=False).props('dense').classes('scale')
            names = [t('residual'), t('limit')]
            plot = self._plot(
                [
                    Curve(traces['estimate'], 'residual', largest=True),
                    Curve(traces['threshold'], 'rho', largest=True),
                ],
                time_plot(names, '1/s', dashed=(names[1],)),
                ['--residual', '--rho'],
                t('residual_label'),
            )

        def rescale() -> None:
            kind = 'log' if scale.value else 'value'
            plot.chart.options['yAxis']['type'] = kind
            plot.chart.run_chart_method('setOption', {'yAxis': {'type': kind}})

        scale.on_value_change(rescale)
        return plot

    def _velocity(self) -> None:
        t = self._t
        with card(t('velocity_title'), t('velocity_remark')):
            self._velocities = self._plot(
                [Curve(self._valve.traces['estimate'], 'x2')],
                time_plot([t('velocity')], '1/s'),
                ['--velocity'],
                t('velocity_label'),
            )

    def _signature(self, recent: float) -> Plot:
        t = self._t
        with card(t('signature_title'), t('signature_remark')):
            names = (t('fault_free'), t('last_time', time=t.duration(recent)))
            return Plot(
                signature_plot(names, t('signature_x'), t('signature_y')),
                ['--before', '--now'],
                t('signature_label'),
                'plot tall',
                notes=self._notes,
            )

    def _process(self) -> None:
        t, trace = self._t, self._valve.traces['measurement']
        with card(t('process_title'), t('process_remark')):
            self._values = markup('values.html', cells=[])
            columns = ('p1', 'p2', 'ps')  # the air of the actuator is another order of magnitude
            p1, p2, ps = (t(f'signal_{column}').split(',')[0] for column in columns)
            ps = t('right_axis', name=ps)
            self._pressures = self._plot(
                [Curve(trace, column, scale=BAR) for column in columns],
                time_plot([p1, p2, ps], 'bar', right=(ps,)),
                ['--cv', '--x1', '--velocity'],
                t('process_label'),
            )

    def _flow(self) -> None:
        t = self._t
        with card(t('signal_flow')):
            self._flows = self._plot(
                [Curve(self._valve.traces['measurement'], 'flow')],
                time_plot([t('signal_flow')], 'kg/s'),
                ['--residual'],
                t('flow_label'),
            )
