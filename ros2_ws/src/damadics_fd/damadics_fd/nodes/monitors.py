# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Executable `monitors`: estimators and detectors of many valves together in one process."""

import sys
from collections.abc import Callable
from functools import partial

from damadics_fd.core.bank.pair import warm_up
from damadics_fd.nodes.detector_node import DetectorNode
from damadics_fd.nodes.estimator_node import EstimatorNode
from damadics_fd.nodes.joint import Joints
from damadics_fd.ros.arguments import command_parser
from damadics_fd.ros.parameter_files import missing_file
from damadics_fd.ros.spin import SpinnableNode, spin_all

NODES: dict[str, Callable[[list[str], Joints], SpinnableNode]] = {
    'estimator': EstimatorNode,
    'detector': DetectorNode,
}
SEPARATOR = '--'
EXAMPLES = """example, one valve:
  ros2 run damadics_fd monitors estimator --ros-args -r __ns:=/lv101 -- \\
      detector --ros-args -r __ns:=/lv101
a list of valves in two processes:
  ros2 run damadics_bringup run fleet.yaml --processes 2"""


def groups_of(words: list[str]) -> list[list[str]]:
    """
    Part a command line into those of the nodes.

    :param words: name and ROS arguments of each node, with `--` between the nodes.
    :return: the words of each node.

    >>> groups_of(['estimator', '--ros-args', '-r', '__ns:=/lv1', '--', 'detector'])
    [['estimator', '--ros-args', '-r', '__ns:=/lv1'], ['detector']]
    """
    groups: list[list[str]] = [[]]
    for word in words:
        if word == SEPARATOR:
            groups.append([])
        else:
            groups[-1].append(word)
    return [group for group in groups if group]


def main(args: list[str] | None = None) -> int:
    """
    Run the nodes.

    :param args: command line, `sys.argv` by default.
    :return: exit code.
    """
    words = list(sys.argv[1:] if args is None else args)
    p = command_parser(
        'monitors',
        'Run estimators and detectors of many valves in one process: at high sample '
        'rates half the cost of one process each.',
        EXAMPLES,
    )
    p.add_argument(
        'node',
        nargs='+',
        metavar='NODE [--ros-args ...] [--]',
        help='estimator or detector with its own ROS arguments',
    )
    groups = groups_of(words)
    p.parse_args([group[0] for group in groups])  # --help, or nothing at all
    unknown = [group[0] for group in groups if group[0] not in NODES]
    if unknown:
        p.error(
            f'there is no node {unknown[0]}; there are {", ".join(NODES)}, with '
            f'"{SEPARATOR}" between two of them'
        )
    problem = missing_file(words)
    if problem:
        p.error(problem)
    # The process takes its enclave and log level from all words, the nodes theirs from their own.
    joints = Joints()
    warm_up()
    return spin_all([partial(NODES[name], own, joints) for name, *own in groups], words)


if __name__ == '__main__':
    sys.exit(main())
