# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Start estimator and detector of every valve of a fleet, with what else is asked for."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from damadics_bringup.fleet import MONITORS, simulated, spread
from damadics_bringup.launcher import arguments_of_all
from damadics_bringup.respawn import unless_refused
from damadics_fd.store.fleet_file import read_fleet
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

CONFIG = Path(get_package_share_directory('damadics_bringup'), 'config')


def valves(context):
    """Describe the nodes of every valve in the list."""
    fleet = read_fleet(LaunchConfiguration('fleet').perform(context))
    together = spread(fleet, int(LaunchConfiguration('processes').perform(context)))
    blocks = LaunchConfiguration('blocks').perform(context).lower() == 'true'
    actions = [
        Node(
            package='damadics_fd',
            executable='monitors',
            respawn=True,
            on_exit=unless_refused,
            respawn_delay=1.0,
            arguments=arguments_of_all(group, f'/{name}'),
            output='screen',
        )
        for name, group in together.items()
    ]
    if blocks:
        simulate = LaunchConfiguration('simulate').perform(context).lower() == 'true'
        actions = [
            Node(
                package='damadics_fd',
                executable='fleet',
                respawn=True,
                on_exit=unless_refused,
                respawn_delay=1.0,
                arguments=[LaunchConfiguration('fleet')],
                # simulated plants send valve by valve
                parameters=[{'expose': len(fleet)}] if simulate else [],
                ros_arguments=['--enclave', '/fleet'],
                output='screen',
            )
        ]
    for valve in fleet:
        file = [str(valve.parameters)] if valve.parameters else []
        topics = list(valve.topics.items())
        actions += [
            Node(
                package='damadics_fd',
                executable=node,
                namespace=valve.name,
                parameters=[*file, valve.settings_of(node)],
                remappings=topics,
                ros_arguments=['--enclave', f'/{valve.name}/{node}'],
                respawn=True,
                on_exit=unless_refused,
                respawn_delay=1.0,
                output='screen',
            )
            for node in MONITORS
            if not together and not blocks
        ]
        if valve not in simulated(fleet):
            continue  # it has a driver of its own
        actions.append(
            Node(
                package='damadics_plant',
                executable='plant',
                namespace=valve.name,
                ros_arguments=['--enclave', f'/{valve.name}/plant'],
                parameters=[
                    {
                        'duration': 1e8,
                        'wait_for_subscribers': 1,
                        'actuator': valve.settings.get('actuator', valve.name),
                        **valve.simulate,
                    }
                ],
                remappings=topics,
                output='screen',
                condition=IfCondition(LaunchConfiguration('simulate')),
            )
        )
    return actions


def page(context):
    """Describe the page, with the tokens that other machines must show."""
    words = ['--host', LaunchConfiguration('host').perform(context)]
    tokens = LaunchConfiguration('token_file').perform(context)
    return [
        Node(
            package='damadics_dashboard',
            executable='dashboard',
            arguments=words + (['--token-file', tokens] if tokens else []),
            output='screen',
            ros_arguments=['--enclave', '/dashboard'],
            condition=IfCondition(LaunchConfiguration('dashboard')),
        )
    ]


def generate_launch_description():
    """Describe what is started."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'fleet', default_value=str(CONFIG / 'fleet.yaml'), description='list of the valves'
            ),
            DeclareLaunchArgument(
                'processes',
                default_value='0',
                description='run all estimators '
                'and detectors in so many processes; 0: each in its own',
            ),
            DeclareLaunchArgument(
                'blocks',
                default_value='false',
                description='one node fleet, which takes measurement_block, judges all valves',
            ),
            DeclareLaunchArgument(
                'simulate',
                default_value='false',
                description='start the plants that the fleet file describes',
            ),
            DeclareLaunchArgument(
                'dashboard', default_value='false', description='start the page'
            ),
            DeclareLaunchArgument(
                'host', default_value='127.0.0.1', description='address of the page'
            ),
            DeclareLaunchArgument(
                'token_file',
                default_value='',
                description='file with the tokens of those who may open the page; another host '
                'needs one',
            ),
            DeclareLaunchArgument(
                'record', default_value='false', description='record all topics'
            ),
            DeclareLaunchArgument(
                'bag', default_value='fleet_bag', description='folder of the bag'
            ),
            OpaqueFunction(function=valves),
            Node(
                package='damadics_fd',
                executable='recorder',
                arguments=['--all', '--out', LaunchConfiguration('bag')],
                output='screen',
                ros_arguments=['--enclave', '/recorder'],
                condition=IfCondition(LaunchConfiguration('record')),
            ),
            OpaqueFunction(function=page),
        ]
    )
