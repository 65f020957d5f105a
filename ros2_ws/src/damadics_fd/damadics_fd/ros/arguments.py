# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the commands of all packages share: where they keep things, how they explain themselves."""

import argparse
import io
import os
import sys
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from pathlib import Path

from damadics_fd.core.private import instead_of, writable
from damadics_fd.ros.parameter_files import missing_file

NODE_HELP = """

while it runs, its parameters:
  ros2 param list /{node}
  ros2 param describe /{node} PARAMETER"""


def state_folder() -> Path:
    """
    Return where the project keeps what has to survive a restart.

    :return: a folder of the user, by the XDG base directory specification.
    """
    base = os.environ.get('XDG_STATE_HOME')
    try:
        folder = Path(base or Path.home() / '.local' / 'state', 'damadics_fd')
    except RuntimeError:  # a user without a home
        folder = Path('/nonexistent', 'damadics_fd')
    if base or writable(folder):
        return folder
    return instead_of(folder, 'alarms, references and logs') / 'state'


def command_parser(name: str, description: str, examples: str) -> argparse.ArgumentParser:
    """
    Begin the command line of a command.

    :param name: of the command.
    :param description: one sentence.
    :param examples: shown below the options, line by line as written.
    :return: a parser without arguments.
    """
    for stream in (sys.stdout, sys.stderr):  # a terminal may not have the letters of a file's name
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors='backslashreplace')
    return argparse.ArgumentParser(
        prog=name,
        description=description,
        epilog=examples,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def check_node_arguments(
    name: str,
    description: str,
    examples: str,
    args: Sequence[str] | None,
) -> None:
    """
    Answer `--help` of a node and refuse words that it would not see.

    :param name: of the node.
    :param description: one sentence.
    :param examples: shown below, line by line as written.
    :param args: command line, `sys.argv` by default; what follows `--ros-args` is not looked at.
    :raises SystemExit: after the help, or with code 2.
    """
    p = command_parser(name, description, examples + NODE_HELP.format(node=name))
    p.usage = f'{name} [-h] [--ros-args -p NAME:=VALUE --params-file FILE -r __ns:=/NAMESPACE ...]'
    own, ros_args = split_ros_args(args)
    p.parse_args(own)
    problem = missing_file(ros_args)
    if problem:
        p.error(problem)


def split_ros_args(args: Sequence[str] | None) -> tuple[list[str], list[str]]:
    """
    Part a command line into the command's own arguments and those of ROS 2.

    :param args: command line, `sys.argv` by default.
    :return: what comes before `--ros-args`, which launch adds to every node, and the rest.

    >>> split_ros_args(['my_bag', '--ros-args', '--enclave', '/replay'])
    (['my_bag'], ['--ros-args', '--enclave', '/replay'])
    """
    words = list(sys.argv[1:] if args is None else args)
    own = words.index('--ros-args') if '--ros-args' in words else len(words)
    return words[:own], words[own:]


def suggestion(name: str, known: Iterable[str]) -> str:
    """
    Find the known name that is most like another.

    :param name: as given.
    :param known: the names that there are.
    :return: `do you mean X?`, '' where nothing is like it.

    >>> suggestion('tlearn', ['t_learn', 't_on']), suggestion('rate', ['k2', 'sample_rate'])
    ('do you mean t_learn?', 'do you mean sample_rate?')
    >>> suggestion('xyz', ['t_learn'])
    ''
    """
    known = list(known)
    near = get_close_matches(name, known, 1) or [k for k in known if name in k.split('_')]
    return f'do you mean {near[0]}?' if near else ''
