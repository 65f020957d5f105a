# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""For launch files: a node that refuses what it was given is not started again."""

from typing import TYPE_CHECKING

from damadics_bringup.keeper import USAGE

if TYPE_CHECKING:  # launch comes with an installed ROS 2 only
    from launch.actions import EmitEvent
    from launch.events.process import ProcessExited
    from launch.launch_context import LaunchContext


def unless_refused(event: 'ProcessExited', context: 'LaunchContext') -> 'list[EmitEvent]':
    """
    Have launch give a process up that has ended with code 2; others are started again.

    To be given as `on_exit`, beside `respawn` with a delay.

    :param event: the end of the process.
    :param context: of the launch.
    :return: what launch is to do.
    """
    from launch.actions import EmitEvent
    from launch.events import matches_action
    from launch.events.process import ShutdownProcess

    if event.returncode != USAGE:
        return []
    return [EmitEvent(event=ShutdownProcess(process_matcher=matches_action(event.action)))]
