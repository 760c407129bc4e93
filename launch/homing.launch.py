# SPDX-License-Identifier: Apache-2.0
"""Starts homing_node with a parameter file.

ros2 launch homing_node homing.launch.py config:=/path/to/axes.yaml
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue


def generate_launch_description():
    return LaunchDescription(
        [
            DeclareLaunchArgument('config', description='parameter file of the axes (YAML)'),
            DeclareLaunchArgument(
                'namespace', default_value='', description="the node's namespace"
            ),
            DeclareLaunchArgument(
                'use_sim_time', default_value='false', description='take the time from /clock'
            ),
            DeclareLaunchArgument(
                'log_level', default_value='info', description='debug, info, warn, error or fatal'
            ),
            Node(
                package='homing_node',
                executable='homing_node',
                namespace=LaunchConfiguration('namespace'),
                parameters=[
                    LaunchConfiguration('config'),
                    {
                        'use_sim_time': ParameterValue(
                            LaunchConfiguration('use_sim_time'), value_type=bool
                        )
                    },
                ],
                ros_arguments=['--log-level', LaunchConfiguration('log_level')],
                output='screen',
            ),
        ]
    )
