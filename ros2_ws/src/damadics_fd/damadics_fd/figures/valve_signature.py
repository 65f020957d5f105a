# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The valve signature as a picture: force over position, both branches, reference and now."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from damadics_fd.causes import CauseTable, load_causes
from damadics_fd.core.signature.signature import Signature, SignatureView
from damadics_fd.core.signature.state import (
    N_TABLE,
    ONE,
    SIGN,
    STATE_ALARM,
    STATE_VERIFY,
    TABLE,
    X1,
    V,
)
from damadics_fd.core.valve.plug import recoveries
from damadics_fd.figures.panels import BLUE, GREY, INK, ORANGE, STYLE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
MIN_SHARE = 0.75  # of the samples of a block
POINTS = 4000  # blocks of each kind in a picture
MOST_BLOCKS = 100_000  # kept; beyond, every second piece of the older half is left out


class ForceMap:
    """
    Collect the block means of a recording, piece by piece.

    The blocks are those of the signature up to their phase: force from measured pressures and
    raw position, 0.1 s each, only where the stem moves steadily.

    :param signature: of the actuator; its settings give the geometry.
    """

    def __init__(self, signature: Signature) -> None:
        self._signature = signature
        self._rest: np.ndarray | None = None
        self._blocks: list[Array] = []
        self._count = 0

    def add(self, estimates: np.ndarray) -> None:
        """
        Take the next accepted rows.

        :param estimates: structured, with `stamp`, `x1`, `ps`, `dp`.
        """
        c = self._signature.settings
        rows = estimates[['stamp', 'x1', 'ps', 'dp']]
        if self._rest is not None:
            rows = np.concatenate([self._rest, rows])
        if not len(rows):
            return
        block = rows['stamp'] // round(c.block * 1e9)
        complete = block < block[-1]
        self._rest = rows[~complete]
        rows, block = rows[complete], block[complete]
        if not len(rows):
            return
        _, first, count = np.unique(block, return_index=True, return_counts=True)
        km = recoveries(c.plug_km, rows['x1'])
        force = c.weight + c.diaphragm_area * rows['ps'] - rows['dp'] * c.plug_area / km
        columns = np.column_stack([rows['stamp'] * 1e-9, rows['x1'], force, rows['dp']])
        means = np.add.reduceat(columns, first) / count[:, None]
        whole = count >= MIN_SHARE * c.block / c.sample_period
        self._blocks.append(means[whole & np.isfinite(means).all(axis=1)])
        self._count += len(self._blocks[-1])
        if self._count > MOST_BLOCKS:
            half = len(self._blocks) // 2
            self._blocks = [*self._blocks[:half:2], *self._blocks[half:]]
            self._count = sum(map(len, self._blocks))

    def moving(self) -> tuple[Array, Array, Array, Array, Array]:
        """
        Return the blocks in which the stem moves steadily.

        :return: time [s], position, force [N], P1 - P2 [Pa], speed [1/s].
        """
        c = self._signature.settings
        rows = np.concatenate(self._blocks) if self._blocks else np.empty((0, 4))
        if len(rows) < 3:
            return tuple(np.empty(0) for _ in range(5))  # type: ignore[return-value]
        t, x, force, dp = rows.T
        v = (x[2:] - x[:-2]) / (t[2:] - t[:-2])
        d1, d2 = x[1:-1] - x[:-2], x[2:] - x[1:-1]
        near = t[2:] - t[:-2] < 3.0 * c.block
        steady = (d1 * d2 > 0) & (np.minimum(abs(d1), abs(d2)) >= 0.5 * c.v_min * c.block)
        inside = (x[1:-1] > c.range_gate) & (x[1:-1] < 1.0 - c.range_gate)
        keep = np.flatnonzero(near & steady & inside & (abs(v) >= 2.0 * c.v_min))
        return t[1:-1][keep], x[1:-1][keep], force[1:-1][keep], dp[1:-1][keep], v[keep]


def force_over_position(
    force_map: ForceMap,
    signature: Signature,
    path: Path | str,
    tag: str = 'valve',
    causes: CauseTable | None = None,
) -> Path:
    """
    Draw force over position and, enlarged, its distance from the learned spring line.

    :param force_map: blocks of the recording.
    :param signature: state at its end.
    :param path: picture to write; its suffix chooses the format.
    :param tag: of the actuator.
    :param causes: texts; those of the package where it is None.
    :return: `path`.
    :raises RuntimeError: where matplotlib is not installed or nothing has been learned.
    """
    try:
        from matplotlib import rc_context
        from matplotlib.figure import Figure
    except ImportError as error:
        raise RuntimeError('figures need matplotlib: pip install matplotlib') from error
    s = signature.state[0]
    if s.state < STATE_VERIFY:
        raise RuntimeError(f'{tag}: no signature has been learned from this recording')
    t, x, force, dp, v = force_map.moving()
    alarm = s.alarm_t * 1e-9 if s.state == STATE_ALARM else np.inf
    then, now = t < alarm, t >= alarm
    line = _spring_line(signature, x, dp)
    view = signature.view()
    table = causes or load_causes()
    title, _ = table[view.cause].describe(tag, view.value, view.std, view.confidence, view.second)
    with rc_context(STYLE):
        figure = Figure(figsize=(11.5, 5.4), layout='constrained')
        whole, close = figure.subplots(1, 2)
        for axis, y in ((whole, force), (close, force - line)):
            _branches(axis, x, y, v, then, BLUE, 'before the alarm')
            _branches(axis, x, y, v, now, ORANGE, 'since the alarm')
            axis.set_xlabel('stem position X  [stroke]')
            axis.set_xlim(0.0, 1.0)
        grid = np.linspace(0.03, 0.97, 200)
        mean_dp = float(np.mean(dp)) if len(dp) else 0.0
        whole.plot(
            grid,
            _spring_line(signature, grid, np.full(200, mean_dp)),
            color=INK,
            linewidth=1.0,
            label='learned spring line',
        )
        speed = float(np.mean(abs(v))) if len(v) else 0.1
        band = (s.theta[SIGN] + s.theta[V] * speed) * signature.settings.force_scale
        _friction_lines(close, grid, np.zeros(200), band, BLUE, 'learned')
        if np.any(now):
            shift, friction = _changed(signature, view, grid, band)
            _friction_lines(close, grid, shift, friction, ORANGE, 'now')
        whole.set_title('force on the stem  [N]', loc='left')
        close.set_title('distance from the learned spring line  [N]', loc='left')
        close.axhline(0.0, color=GREY, linewidth=0.8)
        lines, names = close.get_legend_handles_labels()
        keep = [k for k, name in enumerate(names) if 'friction' in name]
        close.legend(
            [lines[k] for k in keep],
            [names[k] for k in keep],
            frameon=True,
            edgecolor='none',
            framealpha=0.85,
        )
        handles, _ = whole.get_legend_handles_labels()
        if handles:
            whole.legend(loc='upper left', markerscale=2.0)
        figure.suptitle(
            title.replace('+-', '±'), fontsize=12, fontweight='bold', x=0.012, ha='left'
        )
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=150, facecolor='white')
    return path


def _changed(
    signature: Signature, view: SignatureView, x: Array, band: float
) -> tuple[Array, float]:
    """Return what the named cause makes of the spring line and of the friction [N]."""
    s, c = signature.state[0], signature.settings
    shift = np.zeros(len(x))
    if view.cause.startswith('friction'):
        band *= 1.0 + view.value
    elif view.cause.startswith('spring'):
        shift = view.value * s.unit[X1] * (x + c.preload) * c.force_scale
    elif view.cause == 'preload':
        shift += view.value
    else:
        band = np.nan  # no line to draw
    return shift, band


def _friction_lines(
    axis: 'Axes', x: Array, middle: Array, band: float, color: str, label: str
) -> None:
    """Draw the branches of a valve with this friction around its spring line."""
    if not np.isfinite(band):
        return
    for side, name in ((-1.0, None), (1.0, f'{label}: friction {band:.0f} N')):
        axis.plot(
            x, middle + side * band, color=color, linewidth=1.2, linestyle=(0, (5, 3)), label=name
        )


def _spring_line(signature: Signature, x: Array, dp: Array) -> Array:
    """Return the learned force without friction [N]."""
    s, c = signature.state[0], signature.settings
    nodes = np.linspace(0.0, 1.0, N_TABLE)
    error = np.interp(x, nodes, np.asarray(s.theta)[TABLE : TABLE + N_TABLE])
    plug = dp * c.plug_area / recoveries(c.plug_km, x)
    line: Array = (s.theta[X1] * (x + c.preload) + s.theta[ONE]) * c.force_scale + error * plug
    return line


def _branches(
    axis: 'Axes', x: Array, y: Array, v: Array, part: NDArray[np.bool_], color: str, label: str
) -> None:
    for rising, marker, name in ((True, '^', 'closing'), (False, 'v', 'opening')):
        keep = np.flatnonzero(part & ((v > 0.0) == rising))
        keep = keep[:: max(1, len(keep) // POINTS)]
        if len(keep):
            axis.plot(
                x[keep],
                y[keep],
                marker,
                color=color,
                markersize=2.6,
                alpha=0.6,
                markeredgewidth=0.0,
                label=f'{label}, {name}',
            )
