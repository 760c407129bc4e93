# SPDX-License-Identifier: Apache-2.0
"""Starts homing_node and the relay homed_axes in front of a controller, with one parameter file.

ros2 launch homing_node homed_machine.launch.py config:=/path/to/axes.yaml
ros2 launch homing_node homed_machine.launch.py simulated:=true
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def start(context):
    """Return the relay and, where they are wanted, the simulated axes with a controller."""
    given = context.launch_configurations
    common = {
        'package': 'homing_node',
        'namespace': given['namespace'],
        'ros_arguments': ['--log-level', given['log_level']],
        'remappings': [],
        'output': 'screen',
    }
    relay = Node(executable='homed_axes', parameters=[given['config']], **common)
    if given['simulated'] != 'true':
        return [relay]
    controller = given['setpoint_topic'].rpartition('/')[0].rpartition('/')[2]
    plant = [given['plant'], {'controller': controller}]
    return [relay, Node(executable='simulated_axes', parameters=plant, **common)]


def generate_launch_description():
    share = FindPackageShare('homing_node')
    passed = ['config', 'namespace', 'setpoint_topic', 'log_level']
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'config',
                default_value=PathJoinSubstitution([share, 'config', 'homed_machine.yaml']),
                description='parameter file of the axes and of the relay (YAML)',
            ),
            DeclareLaunchArgument(
                'plant',
                default_value=PathJoinSubstitution([share, 'config', 'simulated_axes.yaml']),
                description='parameter file of the simulated axes (YAML)',
            ),
            DeclareLaunchArgument(
                'simulated',
                default_value='false',
                choices=['true', 'false'],
                description='start simulated axes with a controller',
            ),
            DeclareLaunchArgument(
                'namespace', default_value='', description='namespace of all nodes'
            ),
            DeclareLaunchArgument(
                'setpoint_topic',
                default_value='axes_controller/joint_trajectory',
                description='topic of the controller, for the setpoints of the homing node',
            ),
            DeclareLaunchArgument(
                'log_level', default_value='info', description='debug, info, warn, error or fatal'
            ),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(
                    PathJoinSubstitution([share, 'launch', 'homing.launch.py'])
                ),
                launch_arguments=[(name, LaunchConfiguration(name)) for name in passed],
            ),
            OpaqueFunction(function=start),
        ]
    )
