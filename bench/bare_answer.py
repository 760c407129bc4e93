# SPDX-License-Identifier: Apache-2.0
"""Answers a switch by a setpoint, in its subscription's callback."""

from contextlib import suppress

import rclpy
from builtin_interfaces.msg import Duration
from rclpy.executors import ExternalShutdownException
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint


def main() -> None:
    rclpy.init()
    node = rclpy.create_node('homing_node')
    publisher = node.create_publisher(JointTrajectory, '~/setpoints', 1)
    point = JointTrajectoryPoint(
        positions=[0.0],
        velocities=[0.0],
        accelerations=[-1.0],
        time_from_start=Duration(nanosec=4_000_000),
    )
    message = JointTrajectory(joint_names=['a0'], points=[point])
    node.create_subscription(Bool, '~/a0/home_switch', lambda _: publisher.publish(message), 100)
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)


if __name__ == '__main__':
    main()
