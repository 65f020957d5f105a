# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command `simulate`: scenarios to CSV or MCAP files, as fast as the machine can."""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from damadics_fd.bag.errors import BagError

from damadics_plant.faults import Fault
from damadics_plant.library import load_scenario, scenario_names
from damadics_plant.scenario import Scenario
from damadics_plant.simulator import MODELS, Simulator
from damadics_plant.writer import open_writer

_EXAMPLE = """\
examples:
  simulate --list
  simulate paper_friction --out friction.mcap
  simulate nominal --fault f11 --strength 0.5 --from 70 --out spring.csv --noise --seed 3
"""


def parser() -> argparse.ArgumentParser:
    """
    Describe the command line.

    :return: the parser.
    """
    p = argparse.ArgumentParser(
        prog='simulate', description='Simulate the DAMADICS actuator.', epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument('scenario', nargs='?', help='a name of --list, or FILE.yaml[:NAME]')
    p.add_argument('--out', type=Path, help='FILE.csv or FILE.mcap')
    p.add_argument('--list', action='store_true', help='list the scenarios and exit')
    p.add_argument('--model', choices=list(MODELS), default='dablib')
    p.add_argument('--rate', type=float, metavar='HZ',
                   help='samples per second (dablib: 400, lugre: 200)')
    p.add_argument('--duration', type=float, metavar='S', help='end the run after S seconds')
    p.add_argument('--noise', action='store_true', help="add the benchmark's disturbances")
    p.add_argument('--seed', type=int, default=0, metavar='N', help='of noise and random inputs')
    fault = p.add_argument_group('a fault of your own, instead of those of the scenario')
    fault.add_argument('--fault', metavar='fN', help='f1 .. f19')
    fault.add_argument('--strength', type=float, default=1.0, metavar='S',
                       help='signed, default 1')
    fault.add_argument('--from', type=float, default=0.0, metavar='T', dest='start',
                       help='begin [s], default 0')
    fault.add_argument('--to', type=float, default=float('inf'), metavar='T', dest='end',
                       help='end [s], default never')
    fault.add_argument('--development', type=float, default=0.0, metavar='T',
                       help='time to full strength [s], default 0: abrupt')
    return p


def scenario_from(arguments: argparse.Namespace) -> Scenario:
    """
    Find the scenario and apply the options that change it.

    :param arguments: parsed command line.
    :return: what to run.
    :raises ValueError: if a value is not admissible.
    """
    scenario = load_scenario(arguments.scenario)
    if arguments.fault:
        fault = Fault(arguments.fault, arguments.strength, arguments.start,
                      arguments.development, arguments.end)
        scenario = replace(scenario, faults=(fault,))
    return scenario


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the command.

    :param args: arguments, those of the process where absent.
    :return: exit code.
    """
    p = parser()
    arguments = p.parse_args(args)
    if arguments.list:
        for name in scenario_names():
            print(f'{name:16} {load_scenario(name).description}')
        return 0
    if not arguments.scenario or not arguments.out:
        p.error('wants a scenario and --out FILE.csv or FILE.mcap (or --list)')
    try:
        simulator = Simulator(scenario_from(arguments), arguments.rate, arguments.model,
                              arguments.noise, arguments.seed, arguments.duration)
        with open_writer(arguments.out) as write:
            while not simulator.finished:
                write(simulator.advance(1 << 14))
    except (ValueError, OSError, BagError) as error:
        print(f'simulate: {error}', file=sys.stderr)
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())
