# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Start estimator and detector for one valve; recorder, plant and web page if asked."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from damadics_bringup.respawn import unless_refused
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

CONFIG = Path(get_package_share_directory('damadics_bringup'), 'config')


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
            condition=IfCondition(LaunchConfiguration('dashboard')),
        )
    ]


def generate_launch_description():
    """Describe what is started."""
    namespace = LaunchConfiguration('namespace')
    parameters = [LaunchConfiguration('parameters')]
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'parameters',
                default_value=str(CONFIG / 'valve.param.yaml'),
                description='parameter file of the valve',
            ),
            DeclareLaunchArgument(
                'namespace', default_value='', description='namespace of the valve'
            ),
            DeclareLaunchArgument(
                'simulate', default_value='false', description='start the plant'
            ),
            DeclareLaunchArgument(
                'scenario',
                default_value='nominal',
                description='scenario of the plant; simulate --list shows all',
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
                'bag', default_value='valve_bag', description='folder of the bag'
            ),
            Node(
                package='damadics_fd',
                executable='estimator',
                namespace=namespace,
                parameters=parameters,
                respawn=True,
                on_exit=unless_refused,
                respawn_delay=1.0,
                output='screen',
            ),
            Node(
                package='damadics_fd',
                executable='detector',
                namespace=namespace,
                parameters=parameters,
                respawn=True,
                on_exit=unless_refused,
                respawn_delay=1.0,
                output='screen',
            ),
            Node(
                package='damadics_fd',
                executable='recorder',
                arguments=['--all', '--out', LaunchConfiguration('bag')],
                output='screen',
                condition=IfCondition(LaunchConfiguration('record')),
            ),
            Node(
                package='damadics_plant',
                executable='plant',
                namespace=namespace,
                parameters=[
                    {
                        'scenario': LaunchConfiguration('scenario'),
                        'model': 'lugre',
                        'rate': 200.0,
                        'noise': True,
                        'duration': 1e8,
                        'wait_for_subscribers': 1,
                    }
                ],
                output='screen',
                condition=IfCondition(LaunchConfiguration('simulate')),
            ),
            OpaqueFunction(function=page),
        ]
    )
