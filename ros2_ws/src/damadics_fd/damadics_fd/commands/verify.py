# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command verify: what a bag holds, and whether it is whole."""

import sys
from pathlib import Path

from damadics_fd.bag.errors import printable
from damadics_fd.bag.inspection import LOSSY, UNUSABLE, WHOLE, Report, inspect
from damadics_fd.ros.arguments import command_parser

VERDICTS = {WHOLE: 'whole', LOSSY: 'lossy', UNUSABLE: 'unusable'}
SHOWN = 10  # problems told one by one
EXAMPLE = """exit code: 0 whole, 3 lossy, 1 unusable (the worst of all bags)

example:
  ros2 run damadics_fd verify bags/dablib_friction.mcap"""


def print_report(report: Report) -> None:
    """Print what a bag holds and its verdict; problems go to stderr."""
    name = printable(str(report.path))
    print(f'{name}: {report.files} file(s), {report.size} bytes, {report.messages} messages')
    rows = [
        (
            printable(topic.name),
            printable(topic.type),
            str(topic.count),
            f'{(topic.timing.end - topic.timing.start) / 1e9:.3f} s',
        )
        for topic in report.topics.values()
    ]
    widths = [max((len(row[i]) for row in rows), default=0) for i in range(4)]
    for name, kind, count, duration in rows:
        print(
            f'  {name:{widths[0]}}  {kind:{widths[1]}}  {count:>{widths[2]}}'
            f'  {duration:>{widths[3]}}'
        )
    for remark in report.remarks:
        print(f'  remark: {printable(remark)}')
    for problem in report.problems[:SHOWN]:
        print(printable(problem), file=sys.stderr)
    if len(report.problems) > SHOWN:
        print(f'and {len(report.problems) - SHOWN} more problems', file=sys.stderr)
    print(f'{printable(str(report.path))}: {VERDICTS[report.code]}')


def main(args: list[str] | None = None) -> int:
    """Run the command."""
    parser = command_parser('verify', 'Tell what bags hold and whether they are whole.', EXAMPLE)
    parser.add_argument(
        'bags', nargs='+', type=Path, metavar='BAG', help='MCAP file or bag directory'
    )
    options = parser.parse_args(args)
    codes = set()
    for path in options.bags:
        report = inspect(path)
        print_report(report)
        codes.add(report.code)
    return next(code for code in (UNUSABLE, LOSSY, WHOLE) if code in codes)


if __name__ == '__main__':
    sys.exit(main())
