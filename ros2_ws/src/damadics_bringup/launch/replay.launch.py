# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Play a recorded bag through the live nodes: its measurement, under its own time."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


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
    parameters = {'mode': LaunchConfiguration('mode'), 'use_sim_time': True}
    return LaunchDescription(
        [
            DeclareLaunchArgument('bag', description='bag directory or MCAP file'),
            DeclareLaunchArgument(
                'mode', default_value='monitor', description='mode of detection'
            ),
            DeclareLaunchArgument('rate', default_value='1.0', description='speed of the replay'),
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
                'dashboard', default_value='true', description='start the web page'
            ),
            Node(
                package='damadics_fd',
                executable='estimator',
                parameters=[parameters],
                output='screen',
            ),
            Node(
                package='damadics_fd',
                executable='detector',
                parameters=[{**parameters, 'alarm_folder': ''}],
                output='screen',
            ),
            OpaqueFunction(function=page),
            Node(
                package='damadics_fd',
                executable='replay',
                output='screen',
                arguments=[
                    LaunchConfiguration('bag'),
                    '--live',
                    '--rate',
                    LaunchConfiguration('rate'),
                    '--inputs-only',
                ],
            ),
        ]
    )
