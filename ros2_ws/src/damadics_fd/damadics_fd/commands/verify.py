# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command verify: what recordings hold, whether they are whole, and how regular they are."""

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from damadics_fd.bag.checking.expectation import EXAMPLE as EXPECTATION
from damadics_fd.bag.checking.expectation import Expected, measures, read_expectations, unmet
from damadics_fd.bag.checking.inspection import LOSSY, UNUSABLE, WHOLE, Report, inspect
from damadics_fd.bag.errors import BagError, printable
from damadics_fd.bag.sources import find_bags
from damadics_fd.ros.arguments import command_parser

VERDICTS = {WHOLE: 'whole', LOSSY: 'lossy', UNUSABLE: 'unusable'}
SHOWN = 10  # problems told one by one
TOPICS = 200  # shown in the table
EXAMPLE = f"""exit code: 0 whole, 3 lossy, 1 unusable or not as expected (the worst of all)

examples:
  ros2 run damadics_fd verify bags/dablib_friction.mcap
  ros2 run damadics_fd verify plant_bags/ --json > report.json
  ros2 run damadics_fd verify monday.mcap --expect expected.yaml

expected.yaml:
  {EXPECTATION.replace(chr(10), chr(10) + '  ')}"""
_HEAD = (
    ('topic', 'type', 'count', 'duration', 'rate', 'max gap', 'gaps', 'jitter')
    + ('doubled', 'zero', 'back', 'late')
)  # fmt: skip
_LEFT = 2  # columns of text


def report_of(report: Report, failures: Sequence[str] = ()) -> dict[str, object]:
    """Return a report as one object for JSON; times in seconds, stamps in nanoseconds."""
    return {
        'path': str(report.path),
        'verdict': VERDICTS[report.code],
        'files': report.files,
        'bytes': report.size,
        'messages': report.messages,
        'attachments': report.attachments,
        'start_ns': report.start,
        'end_ns': report.end,
        'topics': {
            name: {'type': topic.type, **measures(report, name)}
            for name, topic in report.topics.items()
        },
        'problems': report.problems,
        'remarks': report.remarks,
        'unmet': list(failures),
    }


def seconds(value: float) -> str:
    """
    Write a time for a table.

    >>> seconds(82.0), seconds(0.0025), seconds(0.0)
    ('82.0 s', '2.50 ms', '-')
    """
    if not value:
        return '-'
    return f'{value:.1f} s' if abs(value) >= 1.0 else f'{value * 1e3:.2f} ms'


def _row(report: Report, name: str) -> tuple[str, ...]:
    found = measures(report, name)
    return (
        printable(name),
        printable(report.topics[name].type),
        f'{found["count"]:.0f}',
        f'{found["duration"]:.3f} s',
        f'{found["rate"]:.4g} /s',
        seconds(found['max_gap']),
        *(f'{found[n]:.0f}' if n != 'jitter' else seconds(found[n]) for n in ('gaps', 'jitter')),
        *(f'{found[n]:.0f}' for n in ('duplicates', 'zero_stamps', 'steps_back')),
        seconds(found['late_start']),
    )


def print_report(report: Report, failures: Sequence[str] = ()) -> None:
    """Print what a bag holds and its verdict; problems go to stderr."""
    path = printable(str(report.path))
    print(f'{path}: {report.files} file(s), {report.size} bytes, {report.messages} messages')
    rows = [_row(report, name) for name in list(report.topics)[:TOPICS]]
    if rows:
        rows.insert(0, _HEAD)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = [
            cell.ljust(width) if i < _LEFT else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        print('  ' + '  '.join(cells).rstrip())
    if len(report.topics) > TOPICS:
        print(f'  and {len(report.topics) - TOPICS} more topics')
    for remark in report.remarks[:SHOWN]:
        print(f'  remark: {printable(remark)}')
    for problem in [*report.problems[:SHOWN], *failures]:
        print(printable(problem), file=sys.stderr)
    if len(report.problems) > SHOWN:
        print(f'and {len(report.problems) - SHOWN} more problems', file=sys.stderr)
    print(f'{path}: {VERDICTS[report.code]}{", not as expected" if failures else ""}')


def _recordings(paths: Sequence[Path]) -> Iterator[Path]:
    """Yield every recording that the paths name, folders searched at any depth."""
    for path in paths:
        try:
            yield from find_bags(path)
        except BagError:
            yield path  # its report says why


def main(args: list[str] | None = None) -> int:
    """Run the command."""
    parser = command_parser(
        'verify', 'Tell what recordings hold, whether they are whole, and how regular.', EXAMPLE
    )
    parser.add_argument(
        'bags',
        nargs='+',
        type=Path,
        metavar='BAG',
        help='MCAP file, SQLite bag, bag directory, or folder of such at any depth',
    )
    parser.add_argument('--json', action='store_true', help='print a list of reports as JSON')
    parser.add_argument(
        '--expect', type=Path, metavar='FILE', help='YAML file with what the topics have to be'
    )
    options = parser.parse_args(args)
    expected: list[Expected] = []
    try:
        if options.expect:
            expected = read_expectations(options.expect)
    except BagError as error:
        print(f'verify: {error}', file=sys.stderr)
        return 2
    codes, reports = set(), []
    for path in _recordings(options.bags):
        report = inspect(path)
        failures = unmet(report, expected)
        codes.add(UNUSABLE if failures else report.code)
        if options.json:
            reports.append(report_of(report, failures))
        else:
            print_report(report, failures)
    if options.json:
        print(json.dumps(reports, indent=1))
    return next(code for code in (UNUSABLE, LOSSY, WHOLE) if code in codes)


if __name__ == '__main__':
    sys.exit(main())
