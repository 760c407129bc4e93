# SPDX-License-Identifier: Apache-2.0
"""Start ros2_control with the mock hardware of machine.urdf, its controllers, and the node."""

from pathlib import Path

from launch import LaunchDescription
from launch_ros.actions import Node

HERE = Path(__file__).resolve().parent
CONTROLLERS = ('joint_state_broadcaster', 'gpio_controller', 'axes_controller')


def generate_launch_description():
    """Return the nodes."""
    description = (HERE / 'machine.urdf').read_text(encoding='utf-8')
    return LaunchDescription(
        [
            Node(
                package='robot_state_publisher',
                executable='robot_state_publisher',
                output='screen',
                parameters=[{'robot_description': description}],
            ),
            Node(
                package='controller_manager',
                executable='ros2_control_node',
                output='screen',
                parameters=[str(HERE / 'controllers.yaml')],
            ),
            Node(
                package='controller_manager',
                executable='spawner',
                output='screen',
                arguments=[*CONTROLLERS, '--param-file', str(HERE / 'controllers.yaml')],
            ),
            Node(
                package='homing_node',
                executable='homing_node',
                output='screen',
                parameters=[str(HERE / 'axes.yaml')],
                remappings=[('~/setpoints', '/axes_controller/joint_trajectory')],
            ),
        ]
    )
