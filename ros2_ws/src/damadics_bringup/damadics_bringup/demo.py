# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Command `demo`: the paper's two experiments, live through the nodes and from their bags."""

import argparse
import json
import sys
from pathlib import Path

from damadics_fd.figures.panels import six_panels
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from damadics_bringup import live_run
from damadics_bringup.experiments import EXPERIMENTS, Experiment, Outcome, judge
from damadics_bringup.processes import ProcessError

SECONDS = 120.0  # length of the paper's experiments


def main(args: list[str] | None = None) -> int:
    """
    Run the command.

    :param args: command line, `sys.argv` by default.
    :return: 0, or 1 where an experiment failed or differs from the paper.
    """
    options = parser().parse_args(args)
    console = Console()
    outcomes = []
    try:
        for experiment in EXPERIMENTS:
            if options.only in (None, experiment.name):
                outcomes.append(_perform(experiment, options, console))
    except ProcessError as problem:
        print(f'demo: {problem}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print('demo: interrupted', file=sys.stderr)
        return 130
    results = {outcome.experiment.name: outcome.as_dict() for outcome in outcomes}
    path = options.out / 'results.json'
    path.write_text(json.dumps(results, indent=2) + '\n')
    console.print(_table(outcomes))
    for outcome in outcomes:
        console.print(_remarks(outcome), soft_wrap=True)
    console.print(f'\nThe results are also in [bold]{path}[/].')
    return 0 if all(outcome.agrees for outcome in outcomes) else 1


def parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    top = argparse.ArgumentParser(
        prog='demo',
        description="The paper's friction and spring experiment through plant, "
        'estimator, detector and recorder as real processes; then the recorded bags through '
        'the same core off line.',
        epilog='Example: ros2 run damadics_bringup demo --factor 5',
    )
    top.add_argument(
        '--out',
        type=Path,
        default=Path('demo'),
        metavar='DIR',
        help='folder for bags, figures and results.json (default: demo)',
    )
    top.add_argument(
        '--factor',
        type=float,
        default=8.0,
        help='seconds of scenario per second of wall time (default: 8)',
    )
    top.add_argument(
        '--only', choices=[e.name for e in EXPERIMENTS], help='do this experiment only'
    )
    return top


def _perform(experiment: Experiment, options: argparse.Namespace, console: Console) -> Outcome:
    folder = options.out / experiment.name
    columns = (
        TextColumn(f'{experiment.title:<42}'),
        BarColumn(),
        TextColumn('{task.percentage:3.0f} %'),
        TextColumn('{task.fields[note]}'),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console) as progress:
        task = progress.add_task('', total=SECONDS, note='starting the nodes')
        bag = live_run.run(
            experiment.scenario,
            folder,
            factor=options.factor,
            on_time=lambda t: progress.update(task, completed=t, note=f't = {t:5.1f} s'),
        )
        progress.update(task, completed=SECONDS, note='replaying the bag')
        outcome, columns_read, result = judge(experiment, bag)
        progress.update(task, note='drawing')
        six_panels(result, columns_read, outcome.figure, experiment.title)
        progress.update(task, note='')
    return outcome


def _table(outcomes: list[Outcome]) -> Table:
    table = Table(title='Instant of detection in s', title_justify='left')
    table.add_column('experiment')
    for heading in ('paper', 'live', 'from the bag', 'samples', 'lost', 'bag, MB'):
        table.add_column(heading, justify='right')
    for outcome in outcomes:
        colour = 'green' if outcome.agrees else 'red'
        table.add_row(
            outcome.experiment.name,
            f'{outcome.experiment.paper:.3f}',
            f'[{colour}]{_seconds(outcome.detected_at)}[/]',
            _seconds(outcome.offline_detected_at),
            str(outcome.samples),
            str(outcome.lost),
            f'{outcome.bag_bytes / 1e6:.1f}',
        )
    return table


def _seconds(value: float | None) -> str:
    return 'none' if value is None else f'{value:.4f}'


def _remarks(outcome: Outcome) -> str:
    same = 'bit for bit the same' if outcome.identical else '[red]NOT the same[/]'
    before = ', '.join(f'{t:.4f}'.rstrip('0') for t in outcome.before) or 'none'
    return (
        f'\n[bold]{outcome.experiment.name}[/]\n'
        f'  decisions before the fault, as the printed method gives them: {before} s\n'
        f'  nodes and off-line core are {same} over {outcome.samples} samples\n'
        f'  {outcome.bag}\n'
        f'  {outcome.figure}'
    )


if __name__ == '__main__':
    sys.exit(main())
