# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A picture of what was identified: signals, force balance, residual, its largest values."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from damadics_fd.commands.commission.limit import BLOCK, DAY, watched
from damadics_fd.commands.commission.monitor import Proposal

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw(proposal: Proposal, path: Path) -> None:
    """
    Draw the sanity plot.

    :param proposal: of `identify`.
    :param path: of the PNG.
    """
    from matplotlib.figure import Figure  # slow to import, needed here only

    figure = Figure(figsize=(11.0, 8.0), layout='constrained')
    axes = figure.subplots(2, 2).ravel()
    result, settings, balance = proposal.result, proposal.settings, proposal.balance
    columns = proposal.columns
    t = (columns['stamp'] - columns['stamp'][0]) * 1e-9
    thin = slice(None, None, max(1, len(t) // 20000))
    axes[0].plot(t[thin], columns['cv'][thin], color='0.6', label='cv')
    axes[0].plot(t[thin], columns['x1'][thin], color='C0', lw=0.8, label='x1')
    axes[0].set(title='Signals', xlabel='time [s]', ylabel='fraction', ylim=(-0.05, 1.05))
    axes[0].legend(loc='best')
    few = slice(None, None, max(1, len(balance.x) // 5000))
    spring = settings.stiffness * settings.stroke * (balance.x + settings.spring_origin)
    for way, color, label in ((balance.v > 0, 'C0', 'closing'), (balance.v < 0, 'C1', 'opening')):
        left = (balance.force - spring)[way][few]
        axes[1].plot(balance.x[way][few], left, '.', ms=2, color=color, label=label)
    axes[1].set(
        title=f'Force balance: K = {settings.stiffness:.0f} N/m, '
        f'dry friction {balance.friction:.1f} N',
        xlabel='x1',
        ylabel='force - spring force [N]',
    )
    axes[1].legend(loc='best', markerscale=5)
    ratio = np.where(watched(result, settings), result.decisions['ratio'], np.nan)
    axes[2].plot(t, ratio, lw=0.5, color='C0')
    axes[2].axhline(settings.level_maintenance, color='C3', label='limit')
    axes[2].set(title='Residual / threshold while monitoring', xlabel='time [s]', ylim=(0, None))
    axes[2].legend(loc='upper left')
    _draw_maxima(axes[3], proposal)
    figure.savefig(path, dpi=110)


def _draw_maxima(axis: 'Axes', proposal: Proposal) -> None:
    limit = proposal.limit
    if limit is None:
        axis.text(0.5, 0.5, 'too little was monitored\nto propose a limit', ha='center')
        axis.set_axis_off()
        return
    ordered = np.sort(limit.maxima)
    share = 1.0 - np.arange(1, len(ordered) + 1) / (len(ordered) + 1.0)
    per_day = DAY / BLOCK
    axis.semilogy(ordered, share * per_day, '.', color='C0', label='recorded windows')
    grid = np.linspace(0.0, max(limit.ratio, limit.seen) * 1.1, 200)
    tail = -np.expm1(-np.exp(-(grid - limit.location) / limit.scale))
    axis.semilogy(grid, tail * per_day, color='C1', label='Gumbel fit')
    axis.axhline(1.0 / limit.days, color='0.5', ls=':', label=f'once in {limit.days:g} days')
    axis.axvspan(limit.low, limit.high, color='C1', alpha=0.2)
    axis.set(
        title=f'Largest ratio in {BLOCK:g} s: limit {limit.ratio:.2f}',
        xlabel='residual / threshold',
        ylabel='times per day',
        ylim=(0.1 / limit.days, 2.0 * per_day),
    )
    axis.legend(loc='best')
