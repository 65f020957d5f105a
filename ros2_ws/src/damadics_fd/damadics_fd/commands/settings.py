# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Command `settings`: what can be set, its unit, its range and who reads it."""

import argparse
import json
import sys

from damadics_fd.core.modes import MODES
from damadics_fd.core.settings.settings import Description, Settings
from damadics_fd.ros.arguments import command_parser, split_ros_args, suggestion

EXAMPLES = """examples:
  ros2 run damadics_fd settings --list
  ros2 run damadics_fd settings --list --mode scada --of valve
  ros2 run damadics_fd settings k2 stiffness"""


def parser() -> argparse.ArgumentParser:
    """
    Describe the command line.

    :return: its parser.
    """
    p = command_parser('settings', 'Explain the settings of estimator and detector.', EXAMPLES)
    p.add_argument('names', nargs='*', metavar='NAME', help='settings to explain')
    p.add_argument('--list', action='store_true', help='list all of the mode')
    p.add_argument('--mode', choices=MODES, default='monitor', help='whose defaults (monitor)')
    p.add_argument(
        '--of',
        choices=('valve', 'mode'),
        help='only what describes the valve, or only what tunes the mode',
    )
    p.add_argument('--json', action='store_true', help='for programs')
    return p


def main(args: list[str] | None = None) -> int:
    """
    Explain settings.

    :param args: command line, `sys.argv` by default.
    :return: 0; 2 for a name that is none.
    """
    options = parser().parse_args(split_ros_args(args)[0])
    rows = Settings.describe(options.mode)
    known = [row['name'] for row in rows]
    for name in options.names:
        if name not in known:
            hint = suggestion(name, known) or 'settings --list shows all'
            print(f'settings: there is no setting {name}: {hint}', file=sys.stderr)
            return 2
    if not options.names and not options.list:
        parser().print_help()
        return 0
    chosen = [row for row in rows if _wanted(row, options)]
    if options.json:
        print(json.dumps([_plain(row) for row in chosen], indent=1))
        return 0
    width = max((len(row['name']) for row in chosen), default=0)
    for row in chosen:
        print(_line(row, width))
    return 0


def _wanted(row: Description, options: argparse.Namespace) -> bool:
    if options.names:
        return row['name'] in options.names
    read = options.mode in row['modes']
    return read and options.of in (None, row['describes'])


def _line(row: Description, width: int) -> str:
    """Return a setting with its default, unit, range and sentence."""
    default = row['default']
    if isinstance(default, tuple):
        shown = f'{len(default)} numbers'
    elif isinstance(default, float):
        shown = f'{default:g}'
    else:
        shown = str(default)
    unit = '' if row['unit'] in ('', '-', '1') else f' {row["unit"]}'
    span = ''
    if 'choices' in row:
        span = f'; one of {", ".join(row["choices"])}'
    elif 'low' in row:
        span = f'; {row["low"]:g} .. {row["high"]:g}'
    return f'{row["name"]:{width}}  {shown}{unit}{span}\n{"":{width}}    {row["description"]}'


def _plain(row: Description) -> dict[str, object]:
    default = row['default']
    listed = list(default) if isinstance(default, tuple) else default
    return {**row, 'type': row['type'].__name__, 'default': listed}


if __name__ == '__main__':
    sys.exit(main())
