# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Command `demo`: the paper's experiments, live through the nodes and from their bags."""

import argparse
import json
import math
import shutil
import sys
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, closing
from pathlib import Path

from damadics_fd.core.settings import Settings
from damadics_fd.figures.panels import six_panels
from damadics_fd.store.references import ReferenceFileError, load_reference
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

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
from damadics_bringup.live_run import LiveRun
from damadics_bringup.processes import ProcessError

AS_FAST_AS_IT_GOES = 0.0  # for what is learned, which waits in no queue of another process


def main(args: list[str] | None = None) -> int:
    """
    Run the command.

    :param args: command line, `sys.argv` by default.
    :return: 0, or 1 where an experiment failed or differs from the paper.
    """
    options = parser().parse_args(args)
    console = Console()
    chosen = [e for e in EXPERIMENTS if options.only in (None, e.name)]
    try:
        with _progress(console) as progress:
            learned = _learn(options, progress)
            outcomes = _perform(chosen, learned, options, progress)
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


def _learn(options: argparse.Namespace, progress: Progress) -> Learned:
    """Learn the fault-free experiment live, pass after pass, each from what the last one knew."""
    folder = options.out / 'learned'
    shutil.rmtree(folder, ignore_errors=True)
    reference = folder / 'reference'
    for number in range(1, PASSES + 1):
        line = _Line(progress, f'Learning the fault-free valve ({number} of {PASSES})')
        lesson = LiveRun(
            NOMINAL.scenario, folder / f'pass_{number}', reference, line.on_time, recorded=False
        )
        with closing(lesson):
            lesson.play(AS_FAST_AS_IT_GOES)
            lesson.keep_learned(SECONDS)
        line.done()
    return load_reference(reference, None, Settings.for_mode('paper')).learned


def _perform(
    experiments: list[Experiment],
    learned: Learned,
    options: argparse.Namespace,
    progress: Progress,
) -> list[Outcome]:
    """Run experiments; the processes of the next start while those of the last one end."""
    reference = options.out / 'learned' / 'reference'
    outcomes: list[Future[Outcome]] = []
    with ThreadPoolExecutor(1) as judging, ExitStack() as left:

        def begin(experiment: Experiment) -> tuple[Experiment, _Line, LiveRun]:
            line = _Line(progress, experiment.title)
            folder = options.out / experiment.name
            run = LiveRun(experiment.scenario, folder, reference, line.on_time, recorded=True)
            return experiment, line, left.enter_context(closing(run))

        following = begin(experiments[0])
        for number in range(len(experiments)):
            experiment, line, run = following
            run.play(options.factor)
            if number + 1 < len(experiments):
                following = begin(experiments[number + 1])
            run.finish()
            run.close()
            outcomes.append(judging.submit(_judge, experiment, run.bag, learned, line))
    return [outcome.result() for outcome in outcomes]


def _judge(experiment: Experiment, bag: Path, learned: Learned, line: '_Line') -> Outcome:
    line.note('replaying the bag')
    outcome, columns_read, result = judge(experiment, bag, learned)
    line.note('drawing')
    six_panels(result, columns_read, outcome.figure, experiment.title)
    line.done()
    return outcome


class _Line:
    """What is told of one run while it goes on."""

    def __init__(self, progress: Progress, title: str) -> None:
        self._progress = progress
        self._task = progress.add_task(title, total=SECONDS, note='starting the nodes')

    def on_time(self, t: float) -> None:
        self._progress.update(self._task, completed=t, note=f't = {t:5.1f} s')

    def note(self, text: str) -> None:
        self._progress.update(self._task, completed=SECONDS, note=text)

    def done(self) -> None:
        self.note('')
        self._progress.stop_task(self._task)


def _progress(console: Console) -> Progress:
    columns = (
        TextColumn('{task.description:<42}'),
        BarColumn(),
        TextColumn('{task.percentage:3.0f} %'),
        TextColumn('{task.fields[note]}'),
        TimeElapsedColumn(),
    )
    return Progress(*columns, console=console)


def _table(outcomes: list[Outcome]) -> Table:
    table = Table(title='Instants of detection in s', title_justify='left', box=SIMPLE_HEAD)
    numbers = ('paper', 'over the threshold', 'flag, live', 'flag, from the bag')
    for heading in ('start', 'experiment', *numbers, 'decisions before the fault'):
        whole = max(map(len, heading.split()))  # no word is cut in a narrow terminal
        table.add_column(
            heading, justify='right' if heading in numbers else 'left', min_width=whole
        )
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
