# SPDX-License-Identifier: Apache-2.0
"""Starts three simulated axes and homing_node for them; then home them.

ros2 launch homing_node demo.launch.py
ros2 service call /homing_node/home std_srvs/srv/Trigger
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    share = FindPackageShare('homing_node')
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'config',
                default_value=PathJoinSubstitution([share, 'config', 'demo.yaml']),
                description='parameter file of the axes (YAML)',
            ),
            DeclareLaunchArgument(
                'plant',
                default_value=PathJoinSubstitution([share, 'config', 'simulated_axes.yaml']),
                description='parameter file of the simulated axes (YAML)',
            ),
            DeclareLaunchArgument(
                'log_level', default_value='info', description='debug, info, warn, error or fatal'
            ),
            Node(
                package='homing_node',
                executable='simulated_axes',
                parameters=[LaunchConfiguration('plant')],
                output='screen',
            ),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(
                    PathJoinSubstitution([share, 'launch', 'homing.launch.py'])
                ),
                launch_arguments={
                    'config': LaunchConfiguration('config'),
                    'log_level': LaunchConfiguration('log_level'),
                }.items(),
            ),
        ]
    )
