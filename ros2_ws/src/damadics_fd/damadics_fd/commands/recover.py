# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command recover: save every intact message of a damaged bag."""

import sys
from pathlib import Path

from damadics_fd.bag.checking.inspection import UNUSABLE
from damadics_fd.bag.errors import BagError, printable
from damadics_fd.bag.salvage import salvage
from damadics_fd.commands.verify import print_report
from damadics_fd.ros.arguments import command_parser

EXAMPLE = """exit code: 0 nothing was lost, 3 something was, 1 nothing can be saved

example:
  ros2 run damadics_fd recover bags/broken --out bags/saved"""


def main(args: list[str] | None = None) -> int:
    """Run the command."""
    parser = command_parser(
        'recover', 'Copy every intact message of a damaged bag to a new one.', EXAMPLE
    )
    parser.add_argument(
        'bag', type=Path, metavar='BAG', help='MCAP file, SQLite bag or bag directory'
    )
    parser.add_argument(
        '--out',
        type=Path,
        required=True,
        metavar='BAG',
        help='MCAP file to write, a directory where BAG is one',
    )
    options = parser.parse_args(args)
    try:
        result = salvage(options.bag, options.out)
    except BagError as error:
        print(f'recover: {error}', file=sys.stderr)
        return UNUSABLE
    print_report(result.found)
    if not result.saved:
        return UNUSABLE
    for problem in result.saved.problems:
        print(printable(f'in the new bag: {problem}'), file=sys.stderr)
    if result.missing:
        print(f'{result.missing} messages that can be read were not saved', file=sys.stderr)
    print(f'saved {result.saved.messages} messages: {printable(str(options.out))}')
    return result.code


if __name__ == '__main__':
    sys.exit(main())
