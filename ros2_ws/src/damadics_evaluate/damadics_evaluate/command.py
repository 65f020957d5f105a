# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command `evaluate`: run, report, compare."""

import argparse
import math
import sys
from pathlib import Path

from damadics_evaluate import detectability
from damadics_evaluate.baselines import DETECTORS, MissingPackageError
from damadics_evaluate.baselines.classifiers import train
from damadics_evaluate.benchmark.campaign import Campaign
from damadics_evaluate.benchmark.compare import compare, overall
from damadics_evaluate.benchmark.runner import admit, read_results, run_campaign
from damadics_evaluate.benchmark.tables import write_csv
from damadics_evaluate.lublin import command as lublin
from damadics_evaluate.recordings import command as recordings
from damadics_evaluate.scenarios.cases import SCENARIOS
from damadics_evaluate.scenarios.trajectories import CACHE_VARIABLE

EXAMPLES = f"""\
examples:
  44 scenarios, all detectors, one seed:
    ros2 run damadics_evaluate evaluate run --out results
  more of it; what is there is kept:
    ros2 run damadics_evaluate evaluate run --out results --seeds 20 --nominal-days 40
  some of it, a strength of your own; on a Dask cluster:
    ros2 run damadics_evaluate evaluate run --out results --scenarios f4_I f12@-0.37 \
        --detectors scada
    ros2 run damadics_evaluate evaluate run --out results --scheduler tcp://head:8786
  the paper's two experiments, all detectors:
    ros2 run damadics_evaluate evaluate paper results
  index.html, summary.csv and README.md:
    ros2 run damadics_evaluate evaluate report results
  what a change did, per scenario and detector:
    ros2 run damadics_evaluate evaluate compare before after

Plant trajectories are kept in ${CACHE_VARIABLE}, by default ~/.cache/damadics_fd."""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='evaluate',
        description='Run detectors over the benchmark scenarios and report its indices.',
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest='command', required=True)
    run = commands.add_parser('run', help='run a campaign; results already there are kept')
    run.add_argument('--out', type=Path, default=Path('results'), help='directory (results)')
    run.add_argument(
        '--scenarios',
        nargs='+',
        default=None,
        metavar='NAME',
        help='f1_S .. f19_B, fN@STRENGTH for an abrupt one of any strength, my.yaml:mine (all 44)',
    )
    run.add_argument(
        '--faults',
        nargs='+',
        default=[],
        metavar='FILE.py:NAME',
        help='faults of your own under the inputs of the benchmark',
    )
    run.add_argument(
        '--detectors',
        nargs='+',
        default=list(DETECTORS),
        metavar='NAME',
        help=f'{", ".join(DETECTORS)}, my.py:Class, an installed one (all built-in ones)',
    )
    run.add_argument('--seeds', type=int, default=1, metavar='N', help='runs per scenario (1)')
    run.add_argument('--first-seed', type=int, default=0, metavar='N', help='first seed (0)')
    run.add_argument(
        '--calibration-days',
        type=int,
        default=3,
        metavar='N',
        help='fault-free days that set the limits of the baselines (3)',
    )
    run.add_argument(
        '--nominal-days',
        type=int,
        default=0,
        metavar='N',
        help='further fault-free days on which false alarms are counted (0)',
    )
    run.add_argument(
        '--isolated-seeds',
        type=int,
        default=5,
        metavar='N',
        help='seeds for which the faults are also isolated (5)',
    )
    run.add_argument('--debounce', type=int, default=1, metavar='N', help='samples (1)')
    run.add_argument('--jobs', type=int, metavar='N', help='processes (one per core)')
    run.add_argument('--scheduler', metavar='ADDRESS', help='Dask scheduler, tcp://host:port')
    run.add_argument('--no-report', action='store_true', help='results only')
    report = commands.add_parser('report', help='write the report of a campaign')
    report.add_argument('directory', type=Path)
    report.add_argument('--to', type=Path, help='directory of the report (that of the campaign)')
    paper = commands.add_parser('paper', help="add the paper's experiments to a campaign")
    paper.add_argument('directory', type=Path)
    paper.add_argument(
        '--detectors',
        nargs='+',
        default=list(DETECTORS),
        metavar='NAME',
        help='as for run (all built-in ones)',
    )
    versus = commands.add_parser('compare', help='compare two campaigns')
    versus.add_argument('a', type=Path)
    versus.add_argument('b', type=Path)
    versus.add_argument('--csv', type=Path, help='write all rows here')
    lublin.add_parser(commands)
    recordings.add_parser(commands)
    detectability.add_parser(commands)
    check = commands.add_parser('check', help='test a detector: finite, repeatable, causal')
    check.add_argument('detectors', nargs='+', metavar='my.py:Class')
    return parser


def main(argv: list[str] | None = None) -> int:
    """
    Run the command.

    :param argv: arguments, by default those of the process.
    :return: 0, or 1 after an error on stderr, 130 after Ctrl-C.
    """
    arguments = _parser().parse_args(argv)
    try:
        commands = {
            'run': _run,
            'report': _report,
            'compare': _compare,
            'paper': _paper,
            'lublin': lublin.lublin,
            'recordings': recordings.recordings,
            'detectability': detectability.detectability,
            'check': _check,
        }
        return commands[arguments.command](arguments) or 0
    except (ValueError, OSError, MissingPackageError, ImportError) as error:
        print(f'evaluate: {error}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print('evaluate: stopped; the same command goes on from here', file=sys.stderr)
        return 130


def _run(arguments: argparse.Namespace) -> None:
    first = arguments.first_seed
    stated = arguments.scenarios
    if stated is None:
        stated = [] if arguments.faults else list(SCENARIOS)
    campaign = Campaign(
        scenarios=(*stated, *arguments.faults),
        detectors=tuple(arguments.detectors),
        seeds=tuple(range(first, first + arguments.seeds)),
        calibration_days=arguments.calibration_days,
        nominal_days=arguments.nominal_days,
        debounce=arguments.debounce,
        isolated_seeds=arguments.isolated_seeds,
    )
    campaign, refused = admit(campaign, _tell)
    train(_tell, campaign.detectors)
    results = run_campaign(campaign, arguments.out, arguments.jobs, arguments.scheduler, refused)
    for reason in dict.fromkeys(r['reason'] for r in results if r['kind'] == 'refused'):
        _tell(f'refused: {reason}')
    print(f'{len(results)} results in {arguments.out}')
    if not arguments.no_report:
        _write_report(arguments.out, arguments.out)


def _tell(text: str) -> None:
    print(f'evaluate: {text}', file=sys.stderr)


def _check(arguments: argparse.Namespace) -> int:
    from damadics_evaluate.benchmark.runner import CHECKED_ON
    from damadics_evaluate.detectors.check import problems
    from damadics_evaluate.detectors.find import find_detector
    from damadics_evaluate.scenarios.trajectories import learning_hour, scenario_run

    hour, samples = learning_hour(0), scenario_run(CHECKED_ON, 0)[0]
    found = [
        p for name in arguments.detectors for p in problems(find_detector(name), hour, samples)
    ]
    for problem in found:
        print(problem)
    if not found:
        print(f'{len(arguments.detectors)} detectors pass')
    return 1 if found else 0


def _paper(arguments: argparse.Namespace) -> None:
    from damadics_evaluate.benchmark.paper import write_paper

    print(write_paper(arguments.directory, arguments.detectors))


def _report(arguments: argparse.Namespace) -> None:
    _write_report(arguments.directory, arguments.to or arguments.directory)


def _write_report(source: Path, target: Path) -> None:
    from damadics_evaluate.report.write import write_report

    for file in write_report(source, target):
        print(file)


def _compare(arguments: argparse.Namespace) -> None:
    first, second = read_results(arguments.a), read_results(arguments.b)
    rows = compare(first, second)
    if not rows:
        raise ValueError(f'{arguments.a} and {arguments.b} share no scenario and detector')
    print(
        f'{"scenario":10} {"detector":14} {"found a":>8} {"found b":>8} '
        f'{"t_dt a":>8} {"t_dt b":>8} {"earlier":>8} {"later":>6} {"p":>6} {"p Holm":>7}'
    )
    for row in rows:
        if row['earlier_in_b'] or row['later_in_b'] or row['detected_a'] != row['detected_b']:
            print(
                f'{row["scenario"]:10} {row["detector"]:14} {row["detected_a"]:8.0%} '
                f'{row["detected_b"]:8.0%} {_seconds(row["t_dt_a"]):>8} '
                f'{_seconds(row["t_dt_b"]):>8} {row["earlier_in_b"]:8} '
                f'{row["later_in_b"]:6} {row["p"]:6.2f} {row["p_holm"]:7.2f}'
            )
    for row in overall(first, second):
        print(
            f'{row["detector"]}: {row["pairs"]} pairs, {row["earlier_in_b"]} earlier in b, '
            f'{row["later_in_b"]} later, {row["only_in_a"]} found only in a, '
            f'{row["only_in_b"]} only in b; median difference {_seconds(row["difference"])} s '
            f'[{_seconds(row["low"])}, {_seconds(row["high"])}], p {row["p"]:.2g}'
        )
    same = sum(not r['earlier_in_b'] and not r['later_in_b'] for r in rows)
    print(f'{same} of {len(rows)} pairs without a difference; "earlier", "later": seeds of b')
    settings = [
        {(r['detector'], r['settings_hash']) for r in results} for results in (first, second)
    ]
    changed = sorted({name for name, _ in settings[0] ^ settings[1]})
    if changed:
        print(f'other settings: {", ".join(changed)}')
    if arguments.csv:
        write_csv(rows, arguments.csv)


def _seconds(value: float) -> str:
    return f'{value:.0f}' if math.isfinite(value) else '-'
