# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where the executables with a ROS 2 node begin."""

from damadics_fd.start import run


def demo() -> int:
    """Run the experiments of the paper."""
    return run('damadics_bringup.demo')
