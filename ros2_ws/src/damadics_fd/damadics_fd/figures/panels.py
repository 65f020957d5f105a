# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The six panels of the paper's Figures 5 and 6 for any recording."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.modes import PHASE_MONITOR, PHASE_PAPER
from damadics_fd.core.result import Result
from damadics_fd.core.stamps import origin

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS = 3000  # per curve: more than a page can show
BLUE, ORANGE, RED, GREEN, GREY = '#1f6fb4', '#e07b00', '#c8102e', '#2e8b57', '#8a8f98'
INK = '#22262b'
STYLE: Any = {
    'font.size': 9.5,
    'font.family': 'DejaVu Sans',
    'mathtext.fontset': 'dejavusans',
    'text.color': INK,
    'axes.labelcolor': INK,
    'axes.edgecolor': '#b9bec6',
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.linewidth': 0.8,
    'axes.grid': True,
    'grid.color': '#e8eaee',
    'grid.linewidth': 0.8,
    'xtick.color': '#5a6068',
    'ytick.color': '#5a6068',
    'axes.formatter.limits': (-3, 4),
    'axes.formatter.use_mathtext': True,
    'lines.linewidth': 1.1,
    'legend.frameon': False,
    'legend.fontsize': 9,
    'axes.axisbelow': True,
}
NAMES = {
    0: 'no fault',
    1: 'valve clogging',
    2: 'sedimentation',
    3: 'erosion',
    4: 'friction',
    5: 'external leakage',
    6: 'internal leakage',
    7: 'evaporation',
    8: 'twisted rod',
    9: 'housing tightness',
    10: 'diaphragm perforation',
    11: 'spring',
    12: 'E/P transducer',
    13: 'position sensor',
    14: 'pressure sensor',
    15: 'positioner feedback',
    16: 'supply pressure drop',
    17: 'pressure change',
    18: 'bypass opened',
    19: 'flow sensor',
}


def envelope(t: np.ndarray, y: np.ndarray, points: int = POINTS) -> tuple[np.ndarray, np.ndarray]:
    """
    Thin out a curve without losing its spikes: keep the extremes of each interval.

    :param t: abscissa, n values.
    :param y: ordinate, n values; NaN are gaps.
    :param points: number of points to keep at most.
    :return: abscissa and ordinate of the points kept.

    >>> t, y = envelope(np.arange(100.0), np.eye(100)[42], points=10)
    >>> len(t), float(y.max())
    (10, 1.0)
    """
    width = -(-2 * len(y) // points)
    if width < 3:
        return t, y
    whole = len(y) // width * width
    block = y[:whole].reshape(-1, width)
    filled = np.where(np.isnan(block), np.nanmean(y) if np.isfinite(y).any() else 0.0, block)
    first = np.arange(0, whole, width)
    rows = np.stack([filled.argmin(1), filled.argmax(1)], axis=1)
    keep = (np.sort(rows, axis=1) + first[:, None]).ravel()
    return t[keep], y[keep]


def six_panels(
    result: Result,
    columns: Mapping[str, np.ndarray],
    path: str | Path,
    title: str = '',
) -> Path:
    """
    Draw xi1; xi2; |xi2| and rho; fault strength; decision; CV and X (Figs. 5 and 6).

    :param result: what estimator and detector made of the recording.
    :param columns: the recording: `stamp`, `cv`, `x1`, and `fault`, `strength` where known.
    :param path: picture to write; its suffix chooses the format (`.png`, `.svg`, `.pdf`).
    :param title: title above the panels.
    :return: `path`.
    :raises RuntimeError: where matplotlib is not installed.
    """
    try:
        from matplotlib import rc_context
        from matplotlib.figure import Figure
        from matplotlib.layout_engine import ConstrainedLayoutEngine
    except ImportError as error:
        raise RuntimeError('figures need matplotlib: pip install matplotlib') from error
    stamp = np.asarray(columns['stamp'])
    zero = origin(int(stamp[0])) if len(stamp) else 0
    t = (stamp - zero) * 1e-9
    with rc_context(STYLE):
        layout = ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.07, hspace=0.04, wspace=0.03)
        figure = Figure(figsize=(11.5, 8.6), layout=layout)
        axes = figure.subplots(3, 2, sharex=True)
        armed = np.isin(result.estimates['phase'], (PHASE_MONITOR, PHASE_PAPER))
        _error(axes[0, 0], t, result.estimates['xi1'], armed, r'position error  $\xi_1$', 'stroke')
        _error(
            axes[0, 1], t, result.estimates['xi2'], armed, r'velocity error  $\xi_2$', 'stroke/s'
        )
        _residual(axes[1, 0], t, result.decisions)
        for axis, text in ((axes[1, 0], ''), (axes[2, 0], 'no decision yet')):
            _learning(axis, t, armed, text)
        onset = _strength(axes[1, 1], t, columns)
        _decision(axes[2, 0], t, result, zero, onset)
        _valve(axes[2, 1], t, columns)
        for letter, axis in zip('abcdef', axes.flat, strict=True):
            axis.set_title(f'({letter})  {axis.get_title()}', loc='left', fontsize=10.5, pad=7)
            axis.set_title('', loc='center')
            if len(t) > 1:
                axis.set_xlim(t[0], t[-1] + (t[-1] - t[-2]))
            if onset is not None:
                axis.axvline(onset, color=GREY, linewidth=1.0, linestyle=(0, (4, 3)), zorder=1)
        for axis in axes[2]:
            axis.set_xlabel('time [s]')
        if title:
            figure.suptitle(title, fontsize=13, fontweight='bold', x=0.012, ha='left')
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=150, facecolor='white')
    return path


def _error(
    axis: 'Axes',
    t: np.ndarray,
    error: np.ndarray,
    armed: NDArray[np.bool_],
    title: str,
    unit: str,
) -> None:
    """Draw an error, scaled so that its ticks are short; what precedes the decision may leave."""
    known = np.isfinite(error)
    judged = error[armed & known] if armed.any() else error[known]
    largest = float(np.abs(judged).max(initial=0.0))
    exponent = int(np.floor(np.log10(largest))) if largest > 0.0 else 0
    if -2 < exponent < 3:
        exponent = 0
    else:
        unit = f'$10^{{{exponent}}}$ {unit}'
    axis.axhline(0.0, color='#c9ced6', linewidth=0.8)
    axis.plot(*envelope(t, error / 10.0**exponent), color=BLUE)
    if len(judged) < len(error) and largest > 0.0:
        reach = 1.6 * largest / 10.0**exponent
        low, high = axis.get_ylim()
        axis.set_ylim(max(low, -reach), min(high, reach))
    axis.set_title(f'{title}  [{unit}]')


def _learning(axis: 'Axes', t: np.ndarray, armed: NDArray[np.bool_], text: str) -> None:
    """Shade the time before the first decision."""
    first = int(armed.argmax()) if armed.any() else len(t) - 1
    if first > 0:
        axis.axvspan(t[0], t[first], color='#f1f2f5', linewidth=0, zorder=0)
        axis.text(0.5 * (t[0] + t[first]), 0.35, text, color=GREY, ha='center', clip_on=True)


def _residual(axis: 'Axes', t: np.ndarray, decisions: np.ndarray) -> None:
    residual, rho = decisions['residual'], decisions['threshold']
    axis.plot(*envelope(t, residual), color=BLUE, label=r'residual $|\xi_2|$')
    axis.plot(*envelope(t, rho), color=ORANGE, linewidth=1.8, label=r'threshold $\rho$')
    positive = rho[np.isfinite(rho) & (rho > 0.0)]
    if len(positive):
        axis.set_yscale('log')
        top = np.nanmax([np.nanmax(residual), positive.max()])
        axis.set_ylim(float(np.median(positive)) * 1e-3, float(top) * 3.0)
    axis.legend(loc='upper left', ncols=2, borderaxespad=0.1)
    axis.set_title(r'residual $|\xi_2|$ and threshold $\rho$  [stroke/s]')


def _strength(axis: 'Axes', t: np.ndarray, columns: Mapping[str, np.ndarray]) -> float | None:
    """Draw the truth; return the onset of the fault [s], None where there is none."""
    axis.set_title('fault strength (truth)')
    axis.set_ylim(-0.05, 1.1)
    if 'strength' not in columns:
        axis.set_title('fault strength')
        axis.text(
            0.5,
            0.5,
            'not known for this recording',
            color=GREY,
            ha='center',
            va='center',
            transform=axis.transAxes,
        )
        return None
    strength = np.asarray(columns['strength'], float)
    axis.fill_between(*envelope(t, strength), color=GREEN, alpha=0.15, linewidth=0)
    axis.plot(*envelope(t, strength), color=GREEN, linewidth=1.8)
    axis.set_ylim(min(-0.05, float(strength.min()) * 1.1), max(1.1, float(strength.max()) * 1.1))
    active = np.flatnonzero(strength)
    if not len(active):
        axis.text(0.5, 0.5, 'no fault', color=GREY, ha='center', transform=axis.transAxes)
        return None
    # a ramp is still zero at its onset, a step is not
    ramp = abs(strength[active[0]]) < 0.01
    onset = float(t[max(active[0] - ramp, 0)])
    number = int(columns['fault'][active[-1]]) if 'fault' in columns else 0
    name = f'f{number} {NAMES.get(number, "")}, ' if number else ''
    axis.annotate(
        f'{name}from {onset:g} s',
        (onset, 0.5),
        xytext=(-6, 0),
        ha='right',
        textcoords='offset points',
        color=GREEN,
    )
    return onset


def _decision(axis: 'Axes', t: np.ndarray, result: Result, zero: int, onset: float | None) -> None:
    fault = result.decisions['fault'].astype(float)
    when, flag = envelope(t, fault)
    counts = when >= (t[0] if onset is None else onset)
    for color, part in ((GREY, ~counts), (RED if fault.any() else GREY, counts)):
        axis.fill_between(when[part], flag[part], color=color, alpha=0.25, linewidth=0)
        axis.plot(when[part], flag[part], color=color, linewidth=1.3)
    axis.set_title('decision')
    axis.set_ylim(-0.05, 1.45)
    axis.set_yticks([0, 1], ['no', 'fault'])
    times = np.array([(event.stamp - zero) * 1e-9 for event in result.detections])
    early = times[times < onset] if onset is not None else times[:0]
    after = times[times >= onset] if onset is not None else times
    if len(early):
        axis.plot(early, np.full(len(early), 1.1), 'v', color=GREY, markersize=5, clip_on=False)
        axis.text(float(early[0]), 1.19, f'before the fault: {len(early)}', color=GREY, fontsize=9)
    if len(after):
        first = float(after[0])
        axis.plot(first, 1.1, 'v', color=RED, markersize=7, clip_on=False)
        right = first > 0.6 * t[-1] + 0.4 * t[0]
        axis.annotate(
            f'detected {first:.4f} s',
            (first, 1.1),
            xytext=(0, 7),
            color=RED,
            textcoords='offset points',
            ha='right' if right else 'left',
            fontweight='bold',
            bbox={'color': 'white', 'pad': 1.0},
        )
    if not len(times):
        axis.text(0.5, 0.6, 'no fault flagged', color=GREY, ha='center', transform=axis.transAxes)


def _valve(axis: 'Axes', t: np.ndarray, columns: Mapping[str, np.ndarray]) -> None:
    axis.plot(*envelope(t, columns['cv']), color=GREY, linewidth=1.2, label='CV')
    axis.plot(*envelope(t, columns['x1']), color=BLUE, linewidth=1.5, label='X')
    axis.set_ylim(-0.05, 1.3)
    axis.legend(
        loc='upper right',
        ncols=2,
        borderaxespad=0.1,
        frameon=True,
        framealpha=1.0,
        edgecolor='none',
        facecolor='white',
    )
    axis.set_title('control value CV and stem position X  [stroke]')
