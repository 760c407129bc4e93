# SPDX-License-Identifier: Apache-2.0
"""Starts a line: the cells with simulated axes, each in its namespace, and their coordinator.

ros2 launch homing_node line.launch.py
ros2 service call /homing_coordinator/home std_srvs/srv/Trigger
"""

import os

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

#: Variables by which users choose the transports of Fast DDS.
CHOICES = (
    'FASTDDS_BUILTIN_TRANSPORTS',
    'FASTDDS_DEFAULT_PROFILES_FILE',
    'FASTRTPS_DEFAULT_PROFILES_FILE',
)


def avoid_shared_memory():
    """Let Fast DDS use UDP alone, unless the user has chosen its transports."""
    if any(map(os.environ.get, CHOICES)):
        return []
    return [SetEnvironmentVariable('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')]


def start(context):
    """Return the node and the simulated axes of each cell, and the coordinator."""
    given = context.launch_configurations

    def node(executable, file, namespace, **more):
        return Node(
            package='homing_node',
            executable=executable,
            namespace=namespace,
            parameters=[given[file], more] if more else [given[file]],
            remappings=[],
            ros_arguments=['--log-level', given['log_level']],
            output='screen',
        )

    started = [node('homing_coordinator', 'line', '')]
    for cell in filter(None, (name.strip() for name in given['cells'].split(','))):
        if given['simulated'] == 'true':  # a dry run tells what rehearsals with the plant take
            started.append(node('homing_node', 'config', cell, layout=given['plant']))
            started.append(node('simulated_axes', 'plant', cell))
        else:
            started.append(node('homing_node', 'config', cell))
    return started


def generate_launch_description():
    share = FindPackageShare('homing_node')

    def file(name, default, description):
        path = PathJoinSubstitution([share, 'config', default])
        return DeclareLaunchArgument(name, default_value=path, description=description)

    return LaunchDescription(
        [
            file('line', 'line.yaml', 'parameter file of the coordinator (YAML)'),
            file('config', 'demo.yaml', 'parameter file of the axes of each cell (YAML)'),
            file('plant', 'simulated_axes.yaml', 'parameter file of the simulated axes (YAML)'),
            DeclareLaunchArgument(
                'cells',
                default_value='cell1, cell2',
                description='namespaces of the cells on this host; empty: only the coordinator',
            ),
            DeclareLaunchArgument(
                'simulated',
                default_value='true',
                choices=['true', 'false'],
                description='start simulated axes in each cell',
            ),
            DeclareLaunchArgument(
                'log_level', default_value='info', description='debug, info, warn, error or fatal'
            ),
            *avoid_shared_memory(),
            OpaqueFunction(function=start),
        ]
    )
