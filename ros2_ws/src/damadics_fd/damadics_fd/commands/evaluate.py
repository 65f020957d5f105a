# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The former name of `ros2 run damadics_evaluate evaluate`."""

import os
import shutil
import sys

COMMAND = ('ros2', 'run', 'damadics_evaluate', 'evaluate')


def main() -> int:
    """
    Hand the arguments over to the package that evaluates.

    :return: exit code 2 where that package is not installed; otherwise this does not return.
    """
    from ament_index_python.packages import PackageNotFoundError, get_package_prefix

    try:
        get_package_prefix('damadics_evaluate')
    except PackageNotFoundError:
        print(
            'evaluate: the package damadics_evaluate is not installed: build it with colcon, '
            'then use ros2 run damadics_evaluate evaluate.',
            file=sys.stderr,
        )
        return 2
    program = shutil.which('ros2')
    if program is None:
        print(
            'evaluate: there is no ros2 on the path: source the environment first.',
            file=sys.stderr,
        )
        return 2
    print('evaluate: this is ros2 run damadics_evaluate evaluate now.', file=sys.stderr)
    return os.execv(program, [*COMMAND, *sys.argv[1:]])
