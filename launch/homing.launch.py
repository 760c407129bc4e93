# SPDX-License-Identifier: Apache-2.0
"""Starts homing_node with a parameter file.

ros2 launch homing_node homing.launch.py config:=/path/to/axes.yaml
"""

import os

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

#: Variables by which users choose the transports of Fast DDS.
CHOICES = (
    'FASTDDS_BUILTIN_TRANSPORTS',
    'FASTDDS_DEFAULT_PROFILES_FILE',
    'FASTRTPS_DEFAULT_PROFILES_FILE',
)


def avoid_shared_memory():
    """Let Fast DDS use UDP alone, unless the user has chosen its transports.

    In shared memory a process that is killed can hold up the setpoints for seconds.
    """
    if any(map(os.environ.get, CHOICES)):
        return []
    return [SetEnvironmentVariable('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')]


def start(context):
    """Return the node, with the values of the arguments."""
    given = context.launch_configurations
    kinds = {'use_sim_time': bool, 'setpoint_interface': str}
    overrides = {
        name: ParameterValue(given[name], value_type=kind)
        for name, kind in kinds.items()
        if given[name]
    }
    topic = given['setpoint_topic']
    names = ['~/setpoints', '~/position_commands', '~/dof_commands'] if topic else []
    return [
        Node(
            package='homing_node',
            executable='homing_node',
            namespace=given['namespace'],
            parameters=[given['config'], *([overrides] if overrides else [])],
            remappings=[(name, topic) for name in names],
            ros_arguments=['--log-level', given['log_level']],
            output='screen',
        )
    ]


def generate_launch_description():
    return LaunchDescription(
        [
            DeclareLaunchArgument('config', description='parameter file of the axes (YAML)'),
            DeclareLaunchArgument(
                'namespace', default_value='', description='namespace of the node'
            ),
            DeclareLaunchArgument(
                'setpoint_interface',
                default_value='',
                choices=['', 'trajectory', 'position', 'dof'],
                description='overrides setpoint_interface of the parameter file',
            ),
            DeclareLaunchArgument(
                'setpoint_topic',
                default_value='',
                description='topic of the setpoints, instead of a topic of the node, for example '
                '/axes_controller/joint_trajectory',
            ),
            DeclareLaunchArgument(
                'use_sim_time',
                default_value='',
                choices=['', 'true', 'false'],
                description='overrides use_sim_time of the parameter file: true takes the time '
                'from /clock',
            ),
            DeclareLaunchArgument(
                'log_level', default_value='info', description='debug, info, warn, error or fatal'
            ),
            *avoid_shared_memory(),
            OpaqueFunction(function=start),
        ]
    )
