# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A report as HTML and CSV, and the curves of its trends."""

import csv
import io
import math
import re
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from damadics_fd.core.stamps import SECOND
from damadics_fd.store.intervals import STATISTICS, Series
from numpy.typing import NDArray

from damadics_dashboard.report.content import Report
from damadics_dashboard.store.export import cell
from damadics_dashboard.store.history import COLUMNS
from damadics_dashboard.words.outlook import factor_of, unit_of
from damadics_dashboard.words.templates import render
from damadics_dashboard.words.texts import Texts

MOST_POINTS = 700  # of a drawn curve: more than the paper shows
FLAT = 1e-3  # share of a value that is no change
SMALLEST = 1e-9
NUMBER = re.compile(r'([+-]?\d[\d.,]*( \S+){0,3}|–)?')  # with its unit
TREND_COLUMNS = ('quantity', 'unit', 'time', 'length_s', *STATISTICS, 'reference')
Pair = tuple[float, float]


@dataclass(frozen=True)
class Chart:
    """A trend in the unit square: band of least and greatest, mean, limits, ticks."""

    name: str
    unit: str
    mean: list[Pair]
    band: list[Pair]
    limits: list[float]
    ticks: list[Pair]  # share of the height, value
    first: str  # day
    last: str


def html(report: Report, t: Texts) -> str:
    """
    Return a report as one HTML file that needs nothing else.

    :param report: the report.
    :param t: the words.
    :return: HTML.
    """
    return render(
        'report.html',
        report=report,
        charts=charts_of(report),
        numeric=numeric_columns,
        t=t,
        language=t.language,
    )


def numeric_columns(heads: list[str], rows: list[list[str]]) -> list[bool]:
    """
    Tell which columns of a table hold numbers, which stand one under the other.

    :param heads: of its columns.
    :param rows: its texts.
    :return: a truth value for each column; the first one names the row.

    >>> numeric_columns(['Valve', 'Peak', 'Finding'], [['lv101', '140 %', 'Friction is high.']])
    [False, True, False]
    """
    return [
        n > 0 and all(NUMBER.fullmatch(row[n]) for row in rows) and any(row[n] for row in rows)
        for n in range(len(heads))
    ]


def text_csv(report: Report) -> str:
    """
    Return all events of a report for a spreadsheet.

    :param report: the report.
    :return: CSV with a line of names.
    """
    stream = io.StringIO()
    table = csv.writer(stream)
    table.writerow(COLUMNS)
    for event in report.events:
        table.writerow([cell(event.get(name)) for name in COLUMNS])
    return stream.getvalue()


def trends_csv(report: Report) -> str:
    """
    Return the trends of a report for a spreadsheet, a line for each interval.

    :param report: the report.
    :return: CSV with a line of names; times in UTC, values in the unit that is named.
    """
    stream = io.StringIO()
    table = csv.writer(stream)
    table.writerow(TREND_COLUMNS)
    for _, quantity, found, _ in report.trends:
        factor, unit = factor_of(quantity), unit_of(quantity)
        columns = [found.least, found.mean, found.greatest, found.std]
        rows = np.stack(columns, axis=1) * factor
        for start, row, reference in zip(
            found.start.tolist(), rows.tolist(), found.reference, strict=True
        ):
            values = ['' if math.isnan(value) else f'{value:.6g}' for value in row]
            when = datetime.fromtimestamp(start, UTC).strftime('%Y-%m-%dT%H:%M:%SZ')
            table.writerow([quantity, unit, when, f'{found.length:g}', *values, cell(reference)])
    return stream.getvalue()


def charts_of(report: Report) -> list[Chart]:
    """
    Draw the trends of a report.

    :param report: the report.
    :return: one chart each.
    """
    return [
        _chart(name, unit_of(quantity), series, factor_of(quantity), limits)
        for name, quantity, series, limits in report.trends
    ]


def _chart(
    name: str, unit: str, series: Series, factor: float, limits: tuple[float, ...]
) -> Chart:
    """Return a curve in the unit square, with ticks."""
    step = max(len(series.start) // MOST_POINTS, 1)
    starts = np.arange(0, len(series.start), step)
    start = series.start[starts]
    least = np.minimum.reduceat(series.least, starts) * factor
    greatest = np.maximum.reduceat(series.greatest, starts) * factor
    mean = np.add.reduceat(series.mean, starts) / np.diff(np.append(starts, len(series.mean)))
    mean = mean * factor
    near = [v * factor for v in limits]
    low, high = float(least.min()), float(greatest.max())
    pad = 0.08 * (high - low)
    if high - low < FLAT * max(abs(low), abs(high)):
        pad = 0.05 * max(abs(low), abs(high))  # what stands still is drawn as a straight line
    pad = max(pad, SMALLEST)
    near = [v for v in near if low - 3 * (high - low + pad) < v < high + 3 * (high - low + pad)]
    low, high = min([low, *near]) - pad, max([high, *near]) + pad
    span = max(float(start[-1] - start[0]), 1.0)
    x = ((start - start[0]) / span).tolist()

    def y(values: NDArray[np.float64]) -> list[float]:
        shares: list[float] = ((values - low) / (high - low)).tolist()
        return shares

    upper = list(zip(x, y(greatest), strict=True))
    lower = list(zip(x, y(least), strict=True))
    return Chart(
        name,
        unit,
        list(zip(x, y(mean), strict=True)),
        upper + lower[::-1],
        y(np.array(near)),
        [((value - low) / (high - low), value) for value in _ticks(low, high)],
        _day(start[0]),
        _day(start[-1]),
    )


def _ticks(low: float, high: float) -> list[float]:
    """
    Return two to six round numbers between two others.

    >>> _ticks(-0.43, 0.43), _ticks(0.97, 1.03), _ticks(-60.0, 310.0)
    ([-0.4, -0.2, 0.0, 0.2, 0.4], [0.98, 1.0, 1.02], [0.0, 100.0, 200.0, 300.0])
    """
    least = (high - low) / 5.0
    power = 10.0 ** math.floor(math.log10(least))
    step = next(power * n for n in (1.0, 2.0, 5.0, 10.0) if power * n >= least)
    first, last = math.ceil(low / step), math.floor(high / step)
    return [round(n * step, 12) + 0.0 for n in range(first, last + 1)]


def _day(seconds: float) -> str:
    return str(np.datetime64(int(seconds * SECOND), 'ns').astype('datetime64[D]'))
