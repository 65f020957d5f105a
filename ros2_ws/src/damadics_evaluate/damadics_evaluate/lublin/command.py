# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command `evaluate lublin`."""

import argparse
import re
import sys
from datetime import date
from pathlib import Path

from damadics_evaluate.baselines import DETECTORS
from damadics_evaluate.detectors.find import find_detector
from damadics_evaluate.lublin.evaluation import Learned, evaluate
from damadics_evaluate.lublin.files import read_folder
from damadics_evaluate.lublin.table import as_text, write_csv, write_json
from damadics_evaluate.watching import UNFIT

EXAMPLES = """\
examples:
  all detectors on the daily files in a folder:
    ros2 run damadics_evaluate evaluate lublin lublin/
  some of them, learned on a stretch of your own (seconds of the day), as a file:
    ros2 run damadics_evaluate evaluate lublin lublin/ --detectors scada fir_cusum \\
        --learn 2001-11-17:52880-53780 --csv table.csv

Files: the plant's daily files DDMMYYYY.txt (33 columns, no header), or CSV files with a date in
the name and the plant's tags as header; parts of a day will do. Events that no file covers are
named. Without --learn every detector learns from the 900 s before the day's first event."""


def add_parser(commands: 'argparse._SubParsersAction[argparse.ArgumentParser]') -> None:
    """Declare the command and its options."""
    parser = commands.add_parser(
        'lublin',
        help='the 19 faults that were induced in the real plant, from its daily files',
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('folder', type=Path, help='folder of the daily files, or one of them')
    parser.add_argument(
        '--detectors',
        nargs='+',
        default=[name for name in DETECTORS if name not in UNFIT],
        metavar='NAME',
        help=f'{", ".join(DETECTORS)}, my.py:Class (all built-in but {", ".join(UNFIT)})',
    )
    parser.add_argument(
        '--learn',
        action='append',
        default=[],
        metavar='[DATE:]START-END',
        help='fault-free stretch in seconds of the day; may be given once per day',
    )
    parser.add_argument(
        '--campaign', type=Path, metavar='DIRECTORY', help='put the table into its report, too'
    )
    parser.add_argument('--csv', type=Path, metavar='FILE', help='write all outcomes here, too')


def stretch_of(text: str) -> tuple[date | None, Learned]:
    """
    Read a stretch as the user states it.

    :raises ValueError: where it is none.

    >>> stretch_of('2001-11-17:52880-53780')
    (datetime.date(2001, 11, 17), Learned(start=52880.0, end=53780.0))
    """
    match = re.fullmatch(r'(?:(\d{4}-\d\d-\d\d):)?(\d+(?:\.\d*)?)-(\d+(?:\.\d*)?)', text)
    if not match or float(match[2]) >= float(match[3]):
        raise ValueError(f'--learn {text}: give [DATE:]START-END, such as 52880-53780')
    day = date.fromisoformat(match[1]) if match[1] else None
    return day, Learned(float(match[2]), float(match[3]))


def lublin(arguments: argparse.Namespace) -> None:
    """
    Run the command and print the table.

    :param arguments: of the parser.
    """
    learn = dict(stretch_of(text) for text in arguments.learn)
    for name in arguments.detectors:
        find_detector(name)

    def tell(text: str) -> None:
        print(f'evaluate lublin: {text}', file=sys.stderr)

    record = read_folder(arguments.folder, tell)
    table = evaluate(record, arguments.detectors, learn, tell)
    print(as_text(table))
    if arguments.campaign:
        arguments.campaign.mkdir(parents=True, exist_ok=True)
        write_json(table, arguments.campaign / 'lublin.json')
    if arguments.csv:
        write_csv(table, arguments.csv)
        print(arguments.csv)
