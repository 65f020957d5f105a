# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Figures of the evaluation report, each as an SVG text."""

import io
import math
import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from damadics_fd.figures.panels import BLUE, GREY, ORANGE, STYLE

from damadics_evaluate.baselines.scada import SIGNATURE
from damadics_evaluate.benchmark.results import Result
from damadics_evaluate.benchmark.tables import (
    delays,
    operating_curve,
    scenario_results,
    unobservable,
)
from damadics_evaluate.detectors.find import title_of
from damadics_evaluate.scenarios.cases import SCENARIOS, case

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STEPS = 40  # of a delay curve; more would not be seen
STRENGTHS = {'S': 0.25, 'M': 0.5, 'B': 0.75}
OTHERS = ('#e07b00', '#2e8b57', '#8a4fa8', '#c8102e', '#5a6068', '#00838f', '#b58900', '#6b8e23')


def _draw(size: tuple[float, float], draw: 'Callable[[Figure, Axes], None]') -> str:
    """Return what `draw(axis)` makes of an empty axis, as SVG."""
    try:
        from markupsafe import Markup
        from matplotlib import rc_context
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ImportError('the report needs matplotlib: pip install matplotlib') from error
    with rc_context({**STYLE, 'svg.hashsalt': 'damadics_fd', 'svg.fonttype': 'none'}):
        figure = Figure(figsize=size, layout='constrained')
        draw(figure, figure.add_subplot())
        stream = io.StringIO()
        figure.savefig(stream, format='svg', metadata={'Date': None})
    text = stream.getvalue()
    return Markup(shrunk(text[text.index('<svg') :]))


def shrunk(svg: str) -> str:
    r"""
    Return an SVG without what no reader sees: names of groups, spaces, the third digit.

    >>> shrunk('<g id="a"><path d="M 1.23456 7.000001 \nL 2 3"/></g>')
    '<g><path d="M 1.2 7 L 2 3"/></g>'
    """

    def short(match: re.Match[str]) -> str:
        return f'{float(match[0]):.1f}'.removesuffix('.0')

    def tight(match: re.Match[str]) -> str:
        style = match[0].replace('; ', ';').replace(': ', ':')
        return style.replace("font-family:'DejaVu Sans'", 'font-family:sans-serif')

    svg = re.sub(r'<g id="[^"]*">', '<g>', svg)
    svg = re.sub(r'style="[^"]*"', tight, svg)
    svg = re.sub(r'\d+\.\d{2,}', short, svg)
    return re.sub(r'>\s+<', '><', re.sub(r'\s+', ' ', svg)).replace(' "', '"')


def _colours(names: Sequence[str]) -> dict[str, tuple[str, float, str]]:
    """Return colour, width and dash per detector; ours stands out."""
    styles = {}
    for i, name in enumerate(n for n in names if n != 'scada'):
        styles[name] = (OTHERS[i % len(OTHERS)], 1.2, '-' if i < len(OTHERS) else '--')
    styles['scada'] = (BLUE, 2.6, '-')
    return styles


def delay_curves(results: Sequence[Result], detectors: Sequence[str]) -> str:
    """Return the share of observable runs detected within a delay, per detector."""
    grouped = scenario_results(results)

    def draw(_: 'Figure', axis: 'Axes') -> None:
        for name, (colour, width, dash) in _colours(detectors).items():
            values = sorted(
                t
                for (scenario, detector), group in grouped.items()
                if detector == name and not unobservable(scenario)
                for t in delays(group)
            )
            if not values:
                continue
            share = np.arange(1, len(values) + 1) / len(values)
            x = [max(t, 0.7) for t in values if math.isfinite(t)]
            kept = np.unique(np.linspace(0, max(len(x) - 1, 0), STEPS).astype(int))[: len(x)]
            x, share = [x[i] for i in kept], share[kept]
            axis.step(
                [0.5, *x, 1e5],
                [0.0, *share, share[-1] if x else 0.0],
                where='post',
                color=colour,
                lw=width,
                ls=dash,
                label=title_of(name),
                zorder=5 if name == 'scada' else 2,
            )
        axis.set(
            xscale='log',
            xlim=(0.5, 1e5),
            ylim=(0, 1.02),
            xlabel='detection delay t_dt (s)',
            ylabel='share of runs detected',
        )
        axis.legend(loc='upper left', bbox_to_anchor=(1.0, 1.0))

    return _draw((9.0, 4.6), draw)


def operating_curves(results: Sequence[Result], limits: dict[str, float], first_seed: int) -> str:
    """Return missed runs against hours with a false exceedance per day, over the limit."""

    def draw(_: 'Figure', axis: 'Axes') -> None:
        for name, (colour, width, dash) in _colours(list(limits)).items():
            if name not in limits:
                continue
            curve = operating_curve(results, name, limits[name], first_seed)
            rate = np.maximum(np.array(curve['false_per_day']), 0.02)
            axis.plot(
                rate,
                curve['missed'],
                color=colour,
                lw=width,
                ls=dash,
                label=title_of(name),
                zorder=5 if name == 'scada' else 2,
            )
            at = int(np.argmin(np.abs(np.log(curve['factor']))))
            axis.plot(rate[at], curve['missed'][at], 'o', color=colour, ms=6)
        axis.set(
            xscale='log',
            xlabel='hours per fault-free day with an exceedance (0: left edge)',
            ylabel='share of observable runs missed',
            ylim=(-0.02, 1.02),
        )
        axis.legend(loc='upper left', bbox_to_anchor=(1.0, 1.0))

    return _draw((9.0, 4.6), draw)


def _strength(scenario: str) -> float | None:
    """Return the strength of an abrupt fault of the benchmark, None for other scenarios."""
    free = re.fullmatch(r'f\d+@(-?[\d.]+)', scenario)
    if free:
        return abs(float(free[1]))
    return STRENGTHS.get(scenario[-1]) if scenario in SCENARIOS else None


def detectability(results: Sequence[Result], detector: str = 'scada') -> str:
    """Return the delay over the strength of abrupt faults, one curve per fault."""
    points: dict[int, list[tuple[float, float]]] = {}
    for (scenario, name), group in scenario_results(results).items():
        strength = _strength(scenario)
        if name != detector or strength is None:
            continue
        found = sorted(delays(group))
        points.setdefault(case(scenario).fault, []).append((strength, found[len(found) // 2]))

    def draw(_: 'Figure', axis: 'Axes') -> None:
        missed = 1400.0
        for i, (fault, pairs) in enumerate(sorted(points.items())):
            pairs.sort()
            x = np.array([p[0] for p in pairs])
            y = np.array([max(p[1], 0.7) if math.isfinite(p[1]) else missed for p in pairs])
            colour = OTHERS[i % len(OTHERS)]
            axis.plot(
                x,
                y,
                '-' if i < len(OTHERS) else '--',
                color=colour,
                label=f'f{fault}',
                marker='o',
                ms=3.5,
            )
        axis.axhline(missed, color=GREY, lw=0.8, ls=':')
        axis.text(1.0, missed, ' not in 600 s', va='center', color=GREY, fontsize=8)
        axis.set(
            xscale='log',
            yscale='log',
            xlabel='strength of the abrupt fault',
            ylabel='median delay (s)',
        )
        if points:
            axis.legend(ncol=2, loc='upper left', bbox_to_anchor=(1.02, 1.0))

    return _draw((8.6, 4.4), draw)


def heat_map(results: Sequence[Result]) -> str:
    """Return the signatures of the faults: what moves in the last 600 s, on a log scale."""
    rows: dict[str, list[float]] = {}
    for r in results:
        if r['kind'] == 'scenario' and 'signature' in r and r['scenario'] in SCENARIOS:
            rows.setdefault(r['scenario'], [r['signature'][name] for name in SIGNATURE])
    names = [name for name in SCENARIOS if name in rows]
    floor = 3e-4

    def draw(figure: 'Figure', axis: 'Axes') -> None:
        values = np.array([rows[name] for name in names])
        size = np.log10(np.maximum(np.abs(values), floor) / floor)
        image = axis.imshow(
            np.sign(values) * size, cmap='RdBu_r', aspect='auto', vmin=-3.4, vmax=3.4
        )
        axis.set_xticks(range(len(SIGNATURE)), SIGNATURE)
        axis.set_yticks(range(len(names)), names, fontsize=7)
        axis.grid(False)
        axis.tick_params(length=0, top=True, labeltop=True, bottom=False, labelbottom=False)
        bar = figure.colorbar(image, ax=axis, shrink=0.5)
        ticks = [-3, -2, -1, 0, 1, 2, 3]
        bar.set_ticks(
            ticks,
            labels=[
                '0' if not k else f'{"-" if k < 0 else "+"}{floor * 10.0 ** abs(k):.2g}'
                for k in ticks
            ],
        )

    return _draw((7.0, 8.4), draw) if names else ''


def delay_bars(rows: Sequence[Result]) -> str:
    """Return the median delay of the monitor against the best baseline, per scenario."""
    ours = {r['scenario']: r['t_dt_median'] for r in rows if r['detector'] == 'scada'}
    best: dict[str, float] = {}
    for r in rows:
        if r['detector'] not in ('scada', 'fixed_r1', 'fixed_r2'):
            best[r['scenario']] = min(best.get(r['scenario'], math.inf), r['t_dt_median'])
    names = [name for name in SCENARIOS if name in ours]

    def draw(_: 'Figure', axis: 'Axes') -> None:
        for values, colour, shift, label in (
            (ours, BLUE, -0.2, title_of('scada')),
            (best, ORANGE, 0.2, "best baseline without the monitor's model"),
        ):
            y = [values.get(name, math.inf) for name in names]
            x = np.arange(len(names)) + shift
            seen = [i for i, v in enumerate(y) if math.isfinite(v)]
            axis.bar(x[seen], [max(y[i], 0.7) for i in seen], 0.4, color=colour, label=label)
            gone = [i for i in range(len(y)) if i not in seen]
            axis.plot(x[gone], np.full(len(gone), 0.62), 'x', color=colour, ms=4)
        axis.set_yscale('log')
        axis.set_ylim(0.5, 1e6)  # room for the legend
        axis.set_xlim(-0.7, len(names) - 0.3)
        axis.grid(False, axis='x')
        axis.set_xticks(range(len(names)), names, rotation=90, fontsize=7)
        axis.set_ylabel('median t_dt (s); x: not detected')
        axis.legend(loc='upper left', ncol=2)

    return _draw((11.0, 3.8), draw)
