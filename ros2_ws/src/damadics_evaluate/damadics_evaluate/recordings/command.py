# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command `evaluate recordings`."""

import argparse
import sys
from contextlib import nullcontext
from pathlib import Path

from damadics_fd.commands.cluster import cluster

from damadics_evaluate.baselines import DETECTORS
from damadics_evaluate.detectors.find import find_detector
from damadics_evaluate.recordings.evaluation import Rules, evaluate
from damadics_evaluate.recordings.files import read_recordings
from damadics_evaluate.recordings.labels import EXAMPLE, read_labels
from damadics_evaluate.recordings.table import as_text, write_csv
from damadics_evaluate.watching import UNFIT

EXAMPLES = f"""\
a file of labels (times in s since the recording's first sample, or dates):
{EXAMPLE}
kinds: learn (fault-free, detectors learn from it), fault, free (says that nothing is wrong).

examples:
  all detectors on two recordings:
    ros2 run damadics_evaluate evaluate recordings labels.csv monday.mcap tuesday.csv
  a table with names of its own, a detector of yours:
    ros2 run damadics_evaluate evaluate recordings labels.csv week.parquet \\
        --map cv=OP*0.01 --map x1=POS*0.01 --detectors scada my.py:Class"""


def add_parser(commands: 'argparse._SubParsersAction[argparse.ArgumentParser]') -> None:
    """Declare the command and its options."""
    parser = commands.add_parser(
        'recordings',
        help='labelled recordings of any plant: CSV, MCAP, Parquet',
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('labels', type=Path, metavar='LABELS.csv')
    parser.add_argument('recordings', nargs='+', type=Path, metavar='RECORDING')
    parser.add_argument(
        '--detectors',
        nargs='+',
        default=[name for name in DETECTORS if name not in UNFIT],
        metavar='NAME',
        help=f'{", ".join(DETECTORS)}, my.py:Class (all built-in but {", ".join(UNFIT)})',
    )
    parser.add_argument(
        '--map', action='append', default=[], metavar='SIGNAL=COLUMN[*FACTOR]', help='see replay'
    )
    parser.add_argument('--actuator', type=int, choices=(1, 2, 3), help='of a table of Lublin')
    parser.add_argument(
        '--period', type=float, default=1.0, metavar='S', help='faster ones are thinned to it (1)'
    )
    parser.add_argument(
        '--before', type=float, default=0.0, metavar='S', help='labels may be that late (0)'
    )
    parser.add_argument(
        '--after', type=float, default=120.0, metavar='S', help='not counted after a fault (120)'
    )
    parser.add_argument(
        '--scheduler',
        metavar='ADDRESS',
        help='Dask scheduler, tcp://host:port, whose workers take a recording each',
    )
    parser.add_argument('--csv', type=Path, metavar='FILE', help='one line per event and detector')


def recordings(arguments: argparse.Namespace) -> None:
    """
    Run the command and print the table.

    :param arguments: of the parser.
    """
    for name in arguments.detectors:
        find_detector(name)
    if not arguments.period > 0.0:
        raise ValueError(f'--period {arguments.period:g}: give more than 0 s')
    labels = read_labels(arguments.labels)

    def tell(text: str) -> None:
        print(f'evaluate recordings: {text}', file=sys.stderr)

    found = read_recordings(
        arguments.recordings, arguments.map, arguments.actuator, arguments.period, tell
    )
    rules = Rules(arguments.before, arguments.after)
    with cluster(arguments.scheduler) if arguments.scheduler else nullcontext() as executor:
        table = evaluate(found, labels, arguments.detectors, rules, tell, executor)
    print(as_text(table))
    if arguments.csv:
        write_csv(table, arguments.csv)
        print(arguments.csv)
