# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command commission: settings for a valve from a fault-free recording of it."""

import argparse
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.recording import Recording, find_recordings, parse_maps
from damadics_fd.commands.commissioning import (
    BLOCK,
    CommissioningError,
    Proposal,
    propose,
    watched,
)
from damadics_fd.core.settings import Settings, SettingsError
from damadics_fd.store.references import Reference, save_reference

EXAMPLES = """examples:
  ros2 run damadics_fd commission bags/fault_free --out lv101.yaml --plot lv101.png
  ros2 run damadics_fd commission LV-101.csv --map x1=POS*0.01 --set mass=3.5 --set area=0.045 \\
      --days 90 --reference references/LV-101 --actuator LV-101"""


def arguments(args: list[str] | None = None) -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(
        prog='commission',
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description='Propose the settings of monitor mode from a fault-free recording in which '
        'the valve moves both ways for some minutes.',
    )
    parser.add_argument('bag', type=Path, metavar='BAG', help='MCAP file, bag directory or table')
    parser.add_argument('--out', type=Path, metavar='FILE', help='write the parameter file (YAML)')
    parser.add_argument('--plot', type=Path, metavar='FILE', help='draw the sanity plot (PNG)')
    parser.add_argument(
        '--reference',
        type=Path,
        metavar='PATH',
        help='write what was learned as the reference, PATH.a.json or .b.json',
    )
    parser.add_argument('--actuator', default='LC74_20', help='tag of the actuator in it')
    parser.add_argument(
        '--days',
        type=float,
        default=30.0,
        help='at most one false alarm in so many days (default 30)',
    )
    parser.add_argument(
        '--set',
        action='append',
        default=[],
        metavar='NAME=VALUE',
        help='a setting from the data sheet: mass, stroke, area, plug_diameter ..',
    )
    parser.add_argument('--topic', help='topic of the measurements')
    parser.add_argument(
        '--map',
        action='append',
        default=[],
        metavar='SIGNAL=SOURCE[*FACTOR]',
        help='where a signal is, as for replay',
    )
    options = parser.parse_args(args)
    if not options.days > 0.0:
        parser.error('--days must be positive')
    return options


def read(recording: Recording) -> dict[str, np.ndarray]:
    """Return the columns of a whole recording; damaged places are told and left out."""
    chunks = list(recording.chunks(lambda text: print(text, file=sys.stderr)))
    names = set.intersection(*(set(chunk) for chunk in chunks)) if chunks else set()
    return {name: np.concatenate([chunk[name] for chunk in chunks]) for name in names}


def data_sheet(texts: list[str]) -> Settings:
    """Return monitor settings with the values of the command line."""
    values: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition('=')
        if not equals:
            raise SettingsError([f'--set {text}: write NAME=VALUE'])
        values[name] = yaml.safe_load(value)
    return Settings.for_mode('monitor', **values)


def parameter_file(proposal: Proposal, source: str) -> str:
    """Return a parameter file for estimator and detector, with unit and meaning of each value."""
    balance, limit = proposal.balance, proposal.limit
    lines = [
        f'# proposed by commission from {source}',
        f'# force balance: K = {balance.stiffness:.0f} +- {2 * balance.stiffness_std:.0f} '
        f'N/m, dry friction {balance.friction:.1f} N, viscous {balance.viscous:.0f} N s/m, '
        f'misfit {balance.misfit:.1f} N',
    ]
    lines += [f'# {limit.statement()}'] if limit else []
    lines += [f'# note: {remark}' for remark in proposal.remarks]
    lines += ['/**:', '  ros__parameters:']
    values = proposal.settings.to_dict()
    for row in Settings.describe():
        unit = f' [{row["unit"]}]' if row['unit'] else ''
        lines += [
            f'    # {row["description"]}{unit}',
            f'    {row["name"]}: {_text(values[row["name"]])}',
        ]
    return '\n'.join(lines) + '\n'


def _text(value: Any) -> str:
    if isinstance(value, list):
        return '[' + ', '.join(repr(float(v)) for v in value) + ']'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        text = repr(value)
        return text.replace('e', '.0e') if 'e' in text and '.' not in text else text
    return str(value)


def draw(proposal: Proposal, columns: Mapping[str, np.ndarray], path: Path) -> None:
    """Draw signals, force balance, residual/threshold and the distribution of its maxima."""
    from matplotlib.figure import Figure  # slow to import, needed here only

    figure = Figure(figsize=(11.0, 8.0), layout='constrained')
    axes = figure.subplots(2, 2).ravel()
    result, settings, balance = proposal.result, proposal.settings, proposal.balance
    t = (columns['stamp'] - columns['stamp'][0]) * 1e-9
    thin = slice(None, None, max(1, len(t) // 20000))
    axes[0].plot(t[thin], columns['cv'][thin], color='0.6', label='cv')
    axes[0].plot(t[thin], columns['x1'][thin], color='C0', lw=0.8, label='x1')
    axes[0].set(title='Signals', xlabel='time [s]', ylabel='fraction', ylim=(-0.05, 1.05))
    axes[0].legend(loc='best')
    few = slice(None, None, max(1, len(balance.x) // 5000))
    left = balance.force - balance.stiffness * settings.stroke * (balance.x + balance.preload)
    up = balance.fitted > balance.stiffness * settings.stroke * (balance.x + balance.preload)
    for way, color, label in ((up, 'C0', 'closing'), (~up, 'C1', 'opening')):
        axes[1].plot(balance.x[way][few], left[way][few], '.', ms=2, color=color, label=label)
    axes[1].set(
        title=f'Force balance: K = {balance.stiffness:.0f} N/m, friction {balance.friction:.1f} N',
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


def _draw_maxima(axis: Any, proposal: Proposal) -> None:
    limit = proposal.limit
    if limit is None:
        axis.text(0.5, 0.5, 'too little was monitored\nto propose a limit', ha='center')
        axis.set_axis_off()
        return
    ordered = np.sort(limit.maxima)
    share = 1.0 - np.arange(1, len(ordered) + 1) / (len(ordered) + 1.0)
    per_day = 86400.0 / BLOCK
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


def report(proposal: Proposal) -> Iterator[str]:
    """Yield what to print."""
    s, b = proposal.settings, proposal.balance
    yield (
        f'{s.sample_rate:g} Hz; K = {b.stiffness:.0f} +- {2 * b.stiffness_std:.0f} N/m, '
        f'preload {b.preload:.3f} strokes, dry friction {b.friction:.1f} N, '
        f'viscous {b.viscous:.0f} N s/m; the force balance leaves {b.misfit:.1f} N'
    )
    yield (
        f'wn = {s.wn:g} rad/s, delta = {s.delta:g}, dz = {s.dz:g}, rho_min = {s.rho_min:g}, '
        f'gw = {s.gw:g}, g5 = {s.g5:g}; noise of the residual {proposal.noise:.2g} 1/s'
    )
    if proposal.limit:
        yield proposal.limit.statement()
        if proposal.limit.ratio <= 1.0:
            yield 'The limit stays at 1: the threshold keeps the budget by itself.'
    for remark in proposal.remarks:
        yield f'note: {remark}'


def main(args: list[str] | None = None) -> int:
    """Run the command."""
    options = arguments(args)
    try:
        sheet = data_sheet(options.set)
        recordings = find_recordings(
            [options.bag], topic=options.topic, maps=parse_maps(options.map)
        )
        if len(recordings) != 1:
            names = ', '.join(recording.name for recording in recordings)
            raise CommissioningError(
                f'{options.bag} holds {len(recordings)} recordings '
                f'({names}); commission one valve at a time'
            )
        columns = read(recordings[0])
        proposal = propose(columns, sheet, options.days)
        for line in report(proposal):
            print(line)
        if options.out:
            options.out.write_text(parameter_file(proposal, str(options.bag)), encoding='utf-8')
        if options.plot:
            draw(proposal, columns, options.plot)
        if options.reference:
            _write_reference(proposal, columns, options)
    except (BagError, CommissioningError, SettingsError, KeyError, OSError, ValueError) as error:
        print(f'commission: {error}', file=sys.stderr)
        return 1
    return 0


def _write_reference(
    proposal: Proposal, columns: Mapping[str, np.ndarray], options: argparse.Namespace
) -> None:
    stamps = columns['stamp']
    written = save_reference(
        options.reference,
        Reference(
            options.actuator,
            proposal.result.estimator.learned(),
            proposal.settings.to_dict(),
            source=str(options.bag),
            first_stamp=int(stamps[0]),
            last_stamp=int(stamps[-1]),
        ),
    )
    print(f'reference of {options.actuator}: {written}')


if __name__ == '__main__':
    sys.exit(main())
