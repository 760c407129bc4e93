# SPDX-License-Identifier: Apache-2.0
"""Starts three simulated axes and homing_node for them; then home them.

ros2 launch homing_node demo.launch.py
ros2 service call /homing_node/home std_srvs/srv/Trigger
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def start_plant(context):
    """Return the simulated axes: in the namespace of the node, with its interface and topic."""
    given = context.launch_configurations
    interface, topic = given['setpoint_interface'], given['setpoint_topic']
    outputs = ['setpoints', 'position_commands', 'dof_commands'] if topic else []
    return [
        Node(
            package='homing_node',
            executable='simulated_axes',
            namespace=given['namespace'],
            parameters=[
                given['plant'],
                *([{'setpoint_interface': interface}] if interface else []),
            ],
            remappings=[(f'homing_node/{name}', topic) for name in outputs],
            ros_arguments=['--log-level', given['log_level']],
            output='screen',
        )
    ]


def generate_launch_description():
    share = FindPackageShare('homing_node')
    passed = ['config', 'namespace', 'setpoint_interface', 'setpoint_topic', 'log_level']
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
                'namespace',
                default_value='',
                description='namespace of the node and the simulated axes',
            ),
            DeclareLaunchArgument(
                'setpoint_interface',
                default_value='',
                choices=['', 'trajectory', 'position', 'dof'],
                description='overrides setpoint_interface of both parameter files',
            ),
            DeclareLaunchArgument(
                'setpoint_topic',
                default_value='',
                description='topic of the setpoints, instead of a topic of the node',
            ),
            DeclareLaunchArgument(
                'log_level', default_value='info', description='debug, info, warn, error or fatal'
            ),
            # It sets the transports of Fast DDS, for the simulated axes too.
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(
                    PathJoinSubstitution([share, 'launch', 'homing.launch.py'])
                ),
                launch_arguments=[(name, LaunchConfiguration(name)) for name in passed],
            ),
            OpaqueFunction(function=start_plant),
        ]
    )
