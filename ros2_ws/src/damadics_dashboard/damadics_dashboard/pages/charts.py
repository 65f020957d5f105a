# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""How the charts of a valve look: options of Apache ECharts."""

from typing import TypedDict

from damadics_fd.core.record import Saved


class Options(TypedDict, total=False):
    """Options of a chart, as ECharts names them."""

    animation: bool
    grid: Saved
    legend: Saved
    tooltip: Saved
    axisPointer: Saved
    dataZoom: list[Saved]
    xAxis: Saved
    yAxis: Saved | list[Saved]
    series: list[Saved]


# margins hold all labels: to look for room at each drawing costs a fifth of it
FIXED: Saved = {'outerBoundsMode': 'none'}
STAYS: Saved = {'nameMoveOverlap': False}


def time_plot(
    names: list[str],
    unit: str,
    *,
    log: bool = False,
    low: float | None = None,
    high: float | None = None,
    dashed: tuple[str, ...] = (),
    bands: tuple[str, ...] = (),
    right: tuple[str, ...] = (),
) -> Options:
    """
    Return the options of a plot over time that can be zoomed and moved.

    :param names: of the curves.
    :param unit: of the ordinate.
    :param log: logarithmic ordinate.
    :param low: lower end of the ordinate, free if None.
    :param high: upper end.
    :param dashed: curves drawn dashed.
    :param bands: curves drawn thin, as the edges of a band; the legend leaves them out.
    :param right: curves with an ordinate of their own, on the right.
    :return: ECharts options.
    """
    axis: Saved = {
        **STAYS,
        'type': 'log' if log else 'value',
        'name': unit,
        'nameTextStyle': {'align': 'left'},
        'nameGap': 10,
        'scale': True,
        'splitNumber': 4,
        'axisPointer': {'show': False},
    }
    if low is not None:
        axis['min'] = low
    if high is not None:
        axis['max'] = high
        if low is not None:
            axis['interval'] = (high - low) / 4.0
    second: Saved = {**axis, 'nameTextStyle': {'align': 'right'}, 'splitLine': {'show': False}}
    return {
        'animation': False,
        'grid': {
            **FIXED,
            'left': 54,
            'right': 46 if right else 30,
            'top': 46 if right else 34,
            'bottom': 40,
        },
        'legend': {
            'top': 0,
            'right': 6,
            'itemWidth': 16,
            'itemHeight': 8,
            'icon': 'roundRect',
            'data': list(dict.fromkeys(name for name in names if name not in bands)),
        },
        'tooltip': {
            'trigger': 'axis',
            'axisPointer': {'type': 'line', 'label': {'show': True}},
            'confine': True,
        },
        'axisPointer': {'show': True, 'type': 'line'},
        'dataZoom': [
            {
                'type': 'inside',
                'filterMode': 'none',
                'zoomOnMouseWheel': 'ctrl',
                'moveOnMouseWheel': False,
                'preventDefaultMouseMove': False,
            }
        ],
        'xAxis': {
            **STAYS,
            'type': 'value',
            'min': 0,
            'max': 60,
            'nameLocation': 'end',
            'nameTextStyle': {'align': 'right', 'verticalAlign': 'top', 'padding': [24, 0, 0, 0]},
            'nameGap': 0,
            'axisLine': {'onZero': False},
            'splitLine': {'show': False},
        },
        'yAxis': [axis, second] if right else axis,
        'series': [
            {
                'type': 'line',
                'name': name,
                'data': [],
                'yAxisIndex': int(name in right),
                'showSymbol': False,
                'emphasis': {'disabled': True},
                'lineStyle': {
                    'width': 1.0 if name in bands else 1.8,
                    'opacity': 0.5 if name in bands else 1.0,
                    'type': 'dashed' if name in dashed else 'solid',
                    'cap': 'butt' if name in dashed else 'round',
                },
            }
            for name in names
        ],
    }


def signature_plot(names: tuple[str, ...], x: str, y: str) -> Options:
    """
    Return the options of the valve signature: force over position.

    :param names: of the clouds, the fainter ones first.
    :param x: name of the abscissa.
    :param y: name of the ordinate.
    :return: ECharts options.
    """
    return {
        'animation': False,
        'grid': {**FIXED, 'left': 54, 'right': 16, 'top': 50, 'bottom': 40},
        'legend': {'top': 0, 'right': 6, 'itemWidth': 10, 'itemHeight': 10, 'icon': 'circle'},
        'tooltip': {'trigger': 'item', 'confine': True},
        'xAxis': {
            **STAYS,
            'type': 'value',
            'name': x,
            'nameLocation': 'middle',
            'nameGap': 24,
            'scale': True,
            'splitNumber': 5,
        },
        'yAxis': {
            **STAYS,
            'type': 'value',
            'name': y,
            'nameTextStyle': {'align': 'left'},
            'nameGap': 10,
            'scale': True,
            'splitNumber': 5,
        },
        'series': [
            {
                'type': 'scatter',
                'name': name,
                'data': [],
                'symbolSize': 4,
                'large': True,
                'largeThreshold': 1,  # one path for all, not an element for each
                'emphasis': {'disabled': True},
                'itemStyle': {'opacity': opacity},
            }
            for name, opacity in zip(names, (0.55, 0.9)[-len(names) :], strict=True)
        ],
    }
