# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Command `files`: samples from files that a historian or a program keeps writing."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from damadics_fd.ros.arguments import command_parser, split_ros_args

from damadics_connect.process import Graph, run
from damadics_connect.settings import Section, check, read_config

EXAMPLES = """example:
  ros2 run damadics_connect files files.yaml
with files.yaml:
  stamp: {column: Time, unit: iso, zone: Europe/Warsaw}
  begin: end                   # or start: what is in the files already, too
  valves:
    lv101:
      path: export/lv101.csv   # or a folder of CSV and Parquet files
      signals: {cv: 'SP[%]', x1: 'POS[%]', p1: 'PT1[bar]'}"""


def parser() -> argparse.ArgumentParser:
    """
    Describe the command line.

    :return: its parser.
    """
    p = command_parser('files', 'Follow files that grow as a live source of samples.', EXAMPLES)
    p.add_argument('config', type=Path, metavar='CONFIG.yaml', help='files and their columns')
    return p


async def follow(path: Path, ros_args: list[str]) -> int:
    """
    Follow what a configuration names.

    :param path: the configuration.
    :param ros_args: arguments of ROS 2.
    :return: exit code.
    """
    from damadics_connect.files.source import UNITS, Files, Stamps
    from damadics_connect.publishing import output_of
    from damadics_connect.valve_list import read_valves

    config = read_config(path)
    valves = read_valves(config, 'column', place='path')
    stamp = config.section('stamp')
    column = stamp.text('column', 't')
    unit = stamp.text('unit', 's', choices=(*UNITS, 'iso'))
    zone = _zone(stamp)
    stamp.done()
    begin = config.text('begin', 'end', choices=('end', 'start'))
    publish = config.text('publish', 'topics', choices=('topics', 'blocks'))
    for valve in valves:
        if not valve.place:
            config.problems.append(f'valves.{valve.name}.path: give a CSV file or a folder')
    if not valves:
        config.problems.append('valves: name at least one (see --help)')
    check(config, path)
    graph = Graph('files', ros_args)
    try:
        output = output_of(publish, graph.node, [valve.known_as for valve in valves])
        files = Files(
            valves,
            config.folder,
            begin == 'end',
            lambda: Stamps(column, unit, zone),
            output,
            graph.node.get_logger().info,
        )
        graph.tell_health('files', files.report)
        graph.start()
        await files.run()
    finally:
        graph.stop()
    return 0


def _zone(stamp: Section) -> ZoneInfo | None:
    name = stamp.text('zone')
    try:
        return ZoneInfo(name) if name else None
    except (ZoneInfoNotFoundError, ValueError, OSError):
        stamp.refuse('zone', 'is no time zone such as Europe/Warsaw or UTC')
        return None


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the command.

    :param args: command line, `sys.argv` by default.
    :return: exit code.
    """
    words, ros_args = split_ros_args(args)
    options = parser().parse_args(words)
    return run('files', lambda: follow(options.config, ros_args))


if __name__ == '__main__':
    sys.exit(main())
