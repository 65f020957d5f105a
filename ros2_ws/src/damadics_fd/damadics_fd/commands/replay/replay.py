# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command replay: recordings through estimator and detector."""

import argparse
import os
import re
import sys
from collections.abc import Iterator, Sequence
from itertools import chain, count
from pathlib import Path

import yaml

from damadics_fd.bag.checking.inspection import LOSSY
from damadics_fd.bag.errors import BagError, NoMeasurementError, printable
from damadics_fd.bag.recording import Recording, find_recordings, parse_maps
from damadics_fd.commands.options import (
    add_settings,
    add_sources,
    settings_in,
    with_suggestions,
)
from damadics_fd.commands.replay.bags import Plan
from damadics_fd.commands.replay.many import BESIDE, replay_all
from damadics_fd.commands.replay.outcome import Outcome
from damadics_fd.commands.replay.output import (
    check_format,
    make_folder,
    print_table,
    write_outcomes,
)
from damadics_fd.core.estimating import estimator_for
from damadics_fd.core.modes import MODES
from damadics_fd.core.record import Saved
from damadics_fd.core.settings import Settings, SettingsError
from damadics_fd.core.settings.document import parameters_in
from damadics_fd.ros.arguments import command_parser, split_ros_args
from damadics_fd.store.references import ReferenceFileError, load_reference

EXAMPLES = """examples:
  ros2 run damadics_fd replay bags/dablib_friction.mcap --mode paper --figures figures
  ros2 run damadics_fd replay plant_bags/ --out alarms.csv
  ros2 run damadics_fd replay 17112001.txt --actuator 1 --mode scada
  ros2 run damadics_fd replay valve.mcap --map cv=/pos/setpoint.data*0.01 --map x1=/pos/stem.data
  ros2 run damadics_fd replay bags/dablib_spring.mcap --live --rate 2

exit code: 0 every recording gave a result, 3 something of one is damaged or missing, 1 one of them
failed, 2 wrong command line"""
WARNINGS = 3  # shown per recording
_SUFFIX = re.compile(r'(\.(mcap|db3)(\.zstd)?|\.csv|\.txt|\.tsv|\.parquet|\.pq)$', re.IGNORECASE)
_UNSAFE = re.compile(r'[^\w. +#()@=-]')


def arguments(args: list[str] | None = None) -> argparse.Namespace:
    """Parse and check the command line."""
    parser = command_parser(
        'replay', 'Replay recorded bags or tables through estimator and detector.', EXAMPLES
    )
    parser.add_argument(
        'bags',
        nargs='+',
        metavar='BAG',
        type=Path,
        help='MCAP file, bag directory, table (.csv, .txt), or folder of such',
    )
    parser.add_argument(
        '--mode',
        choices=MODES,
        default='monitor',
        help='monitor: learn the valve, then watch it; needs ps (default). paper:'
        ' the method as printed. scada: slow signals of a control room',
    )
    parser.add_argument(
        '--settings', type=Path, metavar='FILE', help='parameter file of the nodes (YAML)'
    )
    add_settings(parser, 'one setting')
    add_sources(parser)
    parser.add_argument(
        '--actuator',
        type=int,
        choices=(1, 2, 3),
        help='actuator of a table with the tags of the plant',
    )
    parser.add_argument(
        '--out', type=Path, metavar='FILE', help='write the result: .json, .csv or .parquet'
    )
    parser.add_argument(
        '--reference',
        type=Path,
        metavar='PATH',
        help='begin with what was learned: the path that save_reference was given, without'
        ' .a.json',
    )
    parser.add_argument('--figures', type=Path, metavar='DIR', help='draw the six panels')
    parser.add_argument(
        '--bag',
        type=Path,
        nargs='?',
        const=BESIDE,
        metavar='DIR',
        help='write the flags as MCAP, next to the input if no DIR is given',
    )
    parser.add_argument(
        '--jobs',
        type=int,
        default=len(os.sched_getaffinity(0)),
        help='processes (default: one per core)',
    )
    parser.add_argument(
        '--scheduler',
        metavar='ADDRESS',
        help='Dask scheduler, tcp://host:port: its workers replay, and see the same files',
    )
    parser.add_argument(
        '--live', action='store_true', help='publish on the topics, with /clock, instead'
    )
    parser.add_argument(
        '--rate', type=float, help='speed of --live in multiples of real time (default 1)'
    )
    parser.add_argument(
        '--inputs-only',
        action='store_true',
        help='with --live: publish no results, for nodes that run',
    )
    options = parser.parse_args(args)
    if options.jobs < 1:
        parser.error(f'--jobs {options.jobs}: give 1 or more')
    if options.live and (options.out or options.figures or options.bag):
        parser.error('--live writes no files: leave out --out, --figures and --bag')
    if options.live and options.scheduler:
        parser.error('--live runs here: leave out --scheduler')
    if not options.live and (options.rate is not None or options.inputs_only):
        parser.error('--rate and --inputs-only go with --live')
    if options.rate is not None and not options.rate > 0.0:
        parser.error('--rate must be positive')
    return options


def settings_of(options: argparse.Namespace) -> Saved:
    """
    Return the settings that the user gave.

    :raises SettingsError: where they are wrong, all problems at once.
    """
    values: Saved = {}
    if options.settings:
        values |= _parameters(options.settings)
    values |= settings_in(options.set)
    values.pop('mode', None)
    Settings.for_mode(options.mode, **values)
    return values


def learned(options: argparse.Namespace, settings: Saved) -> Saved | None:
    """
    Read what the estimator begins with.

    :param options: the command line.
    :param settings: settings that the user gave.
    :return: what was learned, None where no reference is named.
    :raises ReferenceFileError: where there is no good reference for these settings.
    """
    if options.reference is None:
        return None
    wanted = Settings.for_mode(options.mode, **settings)
    kept = load_reference(options.reference, None, wanted).learned
    try:
        estimator_for(wanted).restore(kept)
    except ValueError as error:
        raise ReferenceFileError(f'{options.reference}: {error}') from error
    return kept


def _parameters(path: Path) -> Saved:
    """Read the settings out of a parameter file of the nodes."""
    try:
        content = yaml.safe_load(path.read_text(encoding='utf-8'))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise SettingsError([f'{path} cannot be read: {error}']) from error
    known = {entry['name'] for entry in Settings.describe()}
    try:
        given = parameters_in(content)
    except SettingsError as error:
        raise SettingsError([f'{path}: {problem}' for problem in error.problems]) from error
    return {name: value for name, value in given.items() if name in known}


def main(args: list[str] | None = None) -> int:
    """Run the command."""
    words, ros_args = split_ros_args(args)
    options = arguments(words)
    failed: list[BagError] = []

    def left_out(error: BagError) -> None:
        if isinstance(error, NoMeasurementError):
            print(f'replay: warning: {error}; it is left out', file=sys.stderr)
        else:
            failed.append(error)

    try:
        settings = settings_of(options)
        if options.out:
            check_format(options.out)
        for folder in (options.out and options.out.parent, options.figures, options.bag):
            if folder and folder != BESIDE:
                make_folder(folder)
        if options.actuator and not options.live and all(_is_bag(path) for path in options.bags):
            raise SettingsError(
                [f'--actuator {options.actuator} is for tables of the plant: choose with --topic']
            )
        recordings = find_recordings(
            options.bags, options.topic, parse_maps(options.map), options.actuator, left_out
        )
        plan = Plan(
            options.mode, settings, options.figures, options.bag, learned(options, settings)
        )
        if options.live:
            from damadics_fd.commands.replay.live import publish

            code = publish(recordings, plan, options.rate or 1.0, options.inputs_only, ros_args)
            return max(code, report_errors(failed))
        stems = list(unique_stems(recordings))
        outcomes = replay_all(recordings, stems, plan, options.jobs, options.scheduler)
        outcomes += [Outcome(str(error.path), plan.mode, error=str(error)) for error in failed]
        if not all(outcome.error for outcome in outcomes):
            print_table(outcomes)
        told: set[str] = set()  # the valves of one file share what is wrong with it
        for outcome in outcomes:
            report_problems([text for text in outcome.problems if text not in told])
            told.update(outcome.problems)
        if options.out:
            write_outcomes(outcomes, options.out)
            print(f'written: {options.out}')
    except SettingsError as error:
        print(f'replay: {with_suggestions(error)}', file=sys.stderr)
        return 2
    except (BagError, ReferenceFileError, RuntimeError, OSError, ImportError) as error:
        print(f'replay: {error}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print('replay: stopped', file=sys.stderr)
        return 130
    lossy = LOSSY if any(outcome.lossy for outcome in outcomes) else 0
    return report_errors([outcome.error for outcome in outcomes if outcome.error]) or lossy


def _is_bag(path: Path) -> bool:
    return path.name.endswith(('.mcap', '.db3', '.mcap.zstd', '.db3.zstd'))


def report_problems(problems: Sequence[str]) -> None:
    """Print the first few warnings and how many more there are."""
    for problem in problems[:WARNINGS]:
        print(f'replay: warning: {printable(problem)}', file=sys.stderr)
    if len(problems) > WARNINGS:
        print(f'replay: and {len(problems) - WARNINGS} more warnings like it', file=sys.stderr)


def report_errors(errors: Sequence[object]) -> int:
    """Print errors and return the exit code."""
    for error in errors:
        print(f'replay: {error}', file=sys.stderr)
    return int(bool(errors))


def unique_stems(recordings: Sequence[Recording]) -> Iterator[str]:
    """Yield a file name for each recording, no two alike."""
    taken: set[str] = set()
    for recording in recordings:
        stem = _SUFFIX.sub('', recording.path.resolve().name)
        if recording.table and recording.table.name:
            stem += f'_{recording.table.name}'
        elif recording.valve:
            stem += recording.valve.replace('/', '_')
        elif recording.topic != '/measurement':
            stem += recording.topic.removesuffix('measurement').rstrip('/').replace('/', '_')
        stem = _UNSAFE.sub('_', stem)  # topics are text from outside
        names = chain([stem], (f'{stem}_{number}' for number in count(2)))
        taken.add(stem := next(name for name in names if name not in taken))
        yield stem


if __name__ == '__main__':
    sys.exit(main())
