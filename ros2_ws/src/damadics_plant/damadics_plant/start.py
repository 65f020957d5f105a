# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where the executables with a ROS 2 node begin."""

from damadics_fd.start import run


def plant() -> int:
    """Run the simulated plant."""
    return run('damadics_plant.plant')
