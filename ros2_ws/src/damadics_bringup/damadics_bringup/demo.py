# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Command `demo`: the paper's experiments, live through the nodes and from their bags."""

import argparse
import json
import math
import shutil
import sys
from pathlib import Path

from damadics_fd.core.settings import Settings
from damadics_fd.figures.panels import six_panels
from damadics_fd.store.references import ReferenceFileError, load_reference
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from damadics_bringup import live_run
from damadics_bringup.experiments import (
    EXPERIMENTS,
    NOMINAL,
    PASSES,
    SECONDS,
    Decisions,
    Experiment,
    Learned,
    Outcome,
    judge,
)
from damadics_bringup.processes import ProcessError


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
        learned = _learn(options, console)
        for experiment in EXPERIMENTS:
            if options.only in (None, experiment.name):
                outcomes.append(_perform(experiment, learned, options, console))
    except (ProcessError, ReferenceFileError) as problem:
        print(f'demo: {problem}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print('demo: interrupted', file=sys.stderr)
        return 130
    results = {outcome.experiment.name: outcome.as_dict() for outcome in outcomes}
    results['zero_start'] = {
        outcome.experiment.name: outcome.zero_start.as_dict(outcome.experiment)
        for outcome in outcomes
    }
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
        description='The experiments of the paper through plant, estimator, detector and '
        'recorder as real processes: the fault-free valve is learned first, then nothing, its '
        'friction and its spring change; then the recorded bags through the same core off line.',
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
        type=_positive,
        default=16.0,
        help='seconds of scenario per second of wall time, where the machine can (default: 16)',
    )
    top.add_argument(
        '--only', choices=[e.name for e in EXPERIMENTS], help='do this experiment only'
    )
    return top


def _positive(text: str) -> float:
    value = float(text)
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f'{text} is not a number above 0')
    return value


def _learn(options: argparse.Namespace, console: Console) -> Learned:
    """Learn the fault-free experiment live, pass after pass, each from what the last one knew."""
    folder = options.out / 'learned'
    shutil.rmtree(folder, ignore_errors=True)
    reference = folder / 'reference'
    for number in range(1, PASSES + 1):
        title = f'Learning the fault-free valve ({number} of {PASSES})'
        with _progress(title, console) as progress:
            task = progress.add_task('', total=SECONDS, note='starting the nodes')
            live_run.learn(
                NOMINAL.scenario,
                folder / f'pass_{number}',
                factor=options.factor,
                on_time=lambda t: progress.update(task, completed=t, note=f't = {t:5.1f} s'),  # noqa: B023
                reference=reference,
                until=SECONDS,
            )
            progress.update(task, completed=SECONDS, note='')
    return load_reference(reference, None, Settings.for_mode('paper')).learned


def _perform(
    experiment: Experiment, learned: Learned, options: argparse.Namespace, console: Console
) -> Outcome:
    folder = options.out / experiment.name
    with _progress(experiment.title, console) as progress:
        task = progress.add_task('', total=SECONDS, note='starting the nodes')
        bag = live_run.run(
            experiment.scenario,
            folder,
            factor=options.factor,
            on_time=lambda t: progress.update(task, completed=t, note=f't = {t:5.1f} s'),
            reference=options.out / 'learned' / 'reference',
        )
        progress.update(task, completed=SECONDS, note='replaying the bag')
        outcome, columns_read, result = judge(experiment, bag, learned)
        progress.update(task, note='drawing')
        six_panels(result, columns_read, outcome.figure, experiment.title)
        progress.update(task, note='')
    return outcome


def _progress(title: str, console: Console) -> Progress:
    columns = (
        TextColumn(f'{title:<42}'),
        BarColumn(),
        TextColumn('{task.percentage:3.0f} %'),
        TextColumn('{task.fields[note]}'),
        TimeElapsedColumn(),
    )
    return Progress(*columns, console=console)


def _table(outcomes: list[Outcome]) -> Table:
    table = Table(title='Instants of detection in s', title_justify='left')
    for heading in ('start', 'experiment'):
        table.add_column(heading)
    for heading in ('paper', 'over the threshold', 'flag, live', 'flag, from the bag'):
        table.add_column(heading, justify='right')
    table.add_column('decisions before the fault')
    for outcome in outcomes:
        _add_row(table, 'learned', outcome, outcome.live, outcome.offline, outcome.agrees)
    table.add_section()
    for outcome in outcomes:
        _add_row(table, 'zero weights', outcome, None, outcome.zero_start, None)
    return table


def _add_row(
    table: Table,
    start: str,
    outcome: Outcome,
    live: Decisions | None,
    offline: Decisions,
    agrees: bool | None,
) -> None:
    paper = outcome.experiment.paper
    colour = {True: 'green', False: 'red', None: 'default'}[agrees]
    before = offline.flags if paper is None else offline.before_fault
    after = offline.detected_at if paper is not None else None
    table.add_row(
        start,
        outcome.experiment.name,
        '-' if paper is None else f'{paper:.3f}',
        _seconds(offline.exceeds_at if after is not None else None),
        '' if live is None else f'[{colour}]{_seconds(live.detected_at)}[/]',
        _seconds(after),
        ', '.join(f'{t:.4f}'.rstrip('0') for t in before) or 'none',
    )


def _seconds(value: float | None) -> str:
    return 'none' if value is None else f'{value:.4f}'


def _remarks(outcome: Outcome) -> str:
    same = 'bit for bit the same' if outcome.identical else '[red]NOT the same[/]'
    lost = f'{outcome.lost} lost' if not outcome.lost else f'[red]{outcome.lost} lost[/]'
    return (
        f'\n[bold]{outcome.experiment.name}[/]\n'
        f'  nodes and off-line core are {same} over {outcome.samples} samples, {lost}\n'
        f'  {outcome.bag}, {outcome.bag_bytes / 1e6:.1f} MB\n'
        f'  {outcome.figure}'
    )


if __name__ == '__main__':
    sys.exit(main())
