# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Start estimator, detector and recorder for one valve, and the simulated plant if asked."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description():
    """Describe what is started."""
    arguments = [
        DeclareLaunchArgument('mode', default_value='paper', description='mode of the detection'),
        DeclareLaunchArgument('namespace', default_value='', description='namespace of the valve'),
        DeclareLaunchArgument('simulate', default_value='true', description='start the plant'),
        DeclareLaunchArgument('scenario', default_value='paper_friction',
                              description='scenario of the plant; simulate --list shows all'),
        DeclareLaunchArgument('record', default_value='false', description='record all topics'),
        DeclareLaunchArgument('bag', default_value='valve_bag', description='folder of the bag'),
    ]
    namespace = LaunchConfiguration('namespace')
    mode = {'mode': LaunchConfiguration('mode')}
    return LaunchDescription([
        *arguments,
        Node(package='damadics_fd', executable='estimator', namespace=namespace,
             parameters=[mode], output='screen'),
        Node(package='damadics_fd', executable='detector', namespace=namespace,
             parameters=[mode], output='screen'),
        Node(package='damadics_fd', executable='recorder',
             arguments=['--all', '--out', LaunchConfiguration('bag')], output='screen',
             condition=IfCondition(LaunchConfiguration('record'))),
        Node(package='damadics_plant', executable='plant', namespace=namespace,
             parameters=[{'scenario': LaunchConfiguration('scenario'),
                          'wait_for_subscribers': 1}],
             output='screen', condition=IfCondition(LaunchConfiguration('simulate'))),
    ])
