# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command `simulate`: scenarios to CSV or MCAP files, as fast as the machine can."""

import argparse
import re
import signal
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import Any

from damadics_fd.bag.errors import BagError

from damadics_plant.actuator.twin import ENTRY, origin, parts_of, read_twin
from damadics_plant.export import ALL, Job, run_all, run_one
from damadics_plant.faults.catalogue import CATALOGUE, Fault
from damadics_plant.scenarios.library import load_scenario, scenario_names
from damadics_plant.scenarios.recorded import read_recorded
from damadics_plant.scenarios.scenario import Scenario
from damadics_plant.simulator import MODELS

_EXAMPLE = """\
examples:
  ros2 run damadics_plant simulate --list
  ros2 run damadics_plant simulate paper_friction --out friction.mcap
  ros2 run damadics_plant simulate --fault f11 --strength 0.5 --from 900 --noise --seed 3 \\
      --out spring.csv
  ros2 run damadics_plant simulate nominal --cv 'plant.csv:LC74_20CV*0.01' --duration 3600 \\
      --rate 1 --out replayed.csv
  ros2 run damadics_plant simulate all44 --rate 1 --out scenarios/
"""
_INTERRUPTED = 130


def parser() -> argparse.ArgumentParser:
    """
    Describe the command line.

    :return: the parser.
    """
    p = argparse.ArgumentParser(
        prog='simulate',
        description='Simulate the DAMADICS actuator.',
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument(
        'scenario',
        nargs='*',
        metavar='SCENARIO',
        help=f'names of --list, FILE.yaml[:NAME], fN@STRENGTH, or {ALL};'
        ' nominal where there is only a --fault',
    )
    p.add_argument(
        '--out',
        type=Path,
        metavar='PATH',
        help='FILE.csv or FILE.mcap; a folder where there are several scenarios',
    )
    p.add_argument(
        '--format', choices=('csv', 'mcap'), default='csv', help='of the files in the folder'
    )
    p.add_argument(
        '--scada', type=Path, metavar='FILE', help='write the same run at 1 Hz here, too'
    )
    p.add_argument('--list', action='store_true', help='list the scenarios and exit')
    p.add_argument('--faults', action='store_true', help='list the faults and exit')
    p.add_argument('--model', choices=list(MODELS), default='dablib')
    p.add_argument(
        '--valve',
        type=Path,
        metavar='FILE',
        help='the file of a valve, or its twin, written by commission, in place of --model',
    )
    p.add_argument(
        '--rate',
        type=float,
        metavar='HZ',
        help='samples per second (default: dablib 400, lugre 200, with --valve that of the file)',
    )
    p.add_argument('--duration', type=float, metavar='S', help='length of the run')
    p.add_argument('--noise', action='store_true', help="add the benchmark's disturbances")
    p.add_argument('--seed', type=int, default=0, metavar='N', help='of noise and random inputs')
    p.add_argument('--quiet', action='store_true', help='no progress bar')
    inputs = p.add_argument_group(
        'recorded inputs', 'FILE.csv:COLUMN[*FACTOR] or BAG:FIELD[*FACTOR], factor to SI'
    )
    for name in ('cv', 'p1', 'p2', 't1'):
        inputs.add_argument(f'--{name}', metavar='SOURCE')
    fault = p.add_argument_group('a fault of your own, instead of those of the scenario')
    fault.add_argument('--fault', metavar='fN', help='f1 .. f19')
    fault.add_argument(
        '--strength', type=float, default=1.0, metavar='S', help='signed, default 1'
    )
    fault.add_argument(
        '--from', type=float, default=0.0, metavar='T', dest='start', help='begin [s], default 0'
    )
    fault.add_argument(
        '--to',
        type=float,
        default=float('inf'),
        metavar='T',
        dest='end',
        help='end [s], default never',
    )
    fault.add_argument(
        '--development',
        type=float,
        default=0.0,
        metavar='T',
        help='time to full strength [s], default 0: abrupt',
    )
    return p


def scenario_from(name: str, arguments: argparse.Namespace) -> Scenario:
    """
    Find a scenario and apply the options that change it.

    :param name: of the scenario.
    :param arguments: parsed command line.
    :return: what to run.
    :raises ValueError: if a value is not admissible.
    """
    scenario = load_scenario(name)
    for signal_name in ('cv', 'p1', 'p2', 't1'):
        source = getattr(arguments, signal_name)
        if source:
            match = re.fullmatch(r'(.+?):([^:*]+)(?:\*([-+.\deE]+))?', source)
            if not match:
                raise ValueError(f'--{signal_name}: {source!r} is not FILE:COLUMN[*FACTOR]')
            recorded = read_recorded(Path(match[1]), match[2], float(match[3] or 1))
            changes: dict[str, Any] = {signal_name: recorded}
            scenario = replace(scenario, **changes)
    if arguments.fault:
        fault = Fault(
            arguments.fault,
            arguments.strength,
            arguments.start,
            arguments.development,
            arguments.end,
        )
        scenario = replace(scenario, faults=(fault,))
    if arguments.duration is not None:
        scenario = replace(scenario, duration=arguments.duration)
    return scenario


@contextmanager
def _stop_on_signal() -> Iterator[Event]:
    """Turn SIGINT and SIGTERM into an event, so that a file ends with a whole block."""
    stop = Event()
    old = {
        number: signal.signal(number, lambda *_: stop.set())
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield stop
    finally:
        for number, handler in old.items():
            signal.signal(number, handler)


def _print_lists(arguments: argparse.Namespace) -> None:
    if arguments.list:
        for name in scenario_names():
            scenario = load_scenario(name)
            print(f'{name:15} {scenario.duration:7g} s  {scenario.description}')
    if arguments.faults:
        for kind in CATALOGUE.values():
            print(f'{kind.key:4} {kind.minimum:2g}..1  {kind.name}: {kind.meaning}')


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the command.

    :param args: arguments, those of the process where absent.
    :return: exit code.
    """
    p = parser()
    arguments = p.parse_args(args)
    if arguments.list or arguments.faults:
        _print_lists(arguments)
        return 0
    if arguments.fault and not arguments.scenario:
        arguments.scenario = ['nominal']
    if not arguments.scenario or not arguments.out:
        p.error('wants a scenario and --out FILE.csv or FILE.mcap (or --list)')
    names = list(arguments.scenario)
    if ALL in names:
        standard = [name for name in scenario_names() if re.match(r'f\d', name)]
        names[names.index(ALL) : names.index(ALL) + 1] = standard
    warnings.showwarning = lambda message, *_: print(f'simulate: {message}', file=sys.stderr)
    try:
        model, rate = arguments.model, arguments.rate
        if arguments.valve:
            model = read_twin(arguments.valve)
            rate = rate or origin(parts_of(arguments.valve)[ENTRY]).sample_rate
        jobs = [
            Job(
                scenario_from(name, arguments),
                arguments.out,
                rate,
                model,
                arguments.noise,
                arguments.seed,
            )
            for name in names
        ]
        with _stop_on_signal() as stop:
            if len(jobs) == 1 and arguments.out.suffix:
                done = run_one(jobs[0], stop, arguments.scada, bar=not arguments.quiet)
            elif len(jobs) > 1 and arguments.out.suffix:
                raise ValueError(
                    f'--out {arguments.out}: {len(jobs)} scenarios go into a folder: give its name'
                )
            elif arguments.scada:
                raise ValueError('--scada: goes with a single scenario and --out FILE')
            else:
                done = run_all(jobs, arguments.format, stop, bar=not arguments.quiet)
    except (ValueError, OSError, BagError) as error:
        print(f'simulate: {error}', file=sys.stderr)
        return 2 if isinstance(error, ValueError) else 1
    if not done:
        print(f'simulate: interrupted; what is in {arguments.out} is valid', file=sys.stderr)
        return _INTERRUPTED
    if not arguments.quiet:
        several = f'{len(jobs)} recordings in ' if len(jobs) > 1 else ''
        print(f'written: {several}{arguments.out}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
