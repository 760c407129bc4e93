# SPDX-License-Identifier: Apache-2.0
"""A client in a process of its own: homes an axis and tells how that went."""

import json
import sys
import time

import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

#: How a request is refused that comes before the plant is heard, or its drive is on again.
UNREADY = ('SwitchUnknown', 'FeedbackStale', 'ServoOff')


def home(axis):
    """Home an axis; print `moving` once it does, then what happened as one line of JSON."""
    rclpy.init()
    node = rclpy.create_node('client', enable_rosout=False)
    setpoints, feedback, enabled = [], [], [None]
    node.create_subscription(
        JointTrajectory,
        '/homing_node/setpoints',
        lambda m: setpoints.append((m.points[0].positions[0], m.points[0].velocities[0])),
        1000,
    )
    node.create_subscription(
        JointState, '/joint_states', lambda m: feedback.append(m.position[0]), 100
    )
    node.create_subscription(
        Bool,
        f'/homing_node/{axis}/servo_enabled',
        lambda m: enabled.append(m.data),
        QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL),
    )
    servo = node.create_client(SetBool, f'/homing_node/{axis}/servo')
    client = node.create_client(Trigger, f'/homing_node/{axis}/home')
    until = time.monotonic() + 40.0
    servo.wait_for_service(40.0)
    for on in (False, True):  # a drive that stopped by itself has to be switched on again
        servo.call_async(SetBool.Request(data=on))
        while enabled[-1] is not on and time.monotonic() < until:
            rclpy.spin_once(node, timeout_sec=0.01)
    told = False
    future = None
    while time.monotonic() < until:
        rclpy.spin_once(node, timeout_sec=0.01)
        if future is None and client.service_is_ready():
            future = client.call_async(Trigger.Request())
        if not told and len(setpoints) > 50:
            told = True
            print('moving', flush=True)
        if future is not None and future.done():
            answer = future.result()
            if setpoints or not answer.message.startswith(UNREADY):
                break
            future = None
    until = time.monotonic() + 10.0
    while time.monotonic() < until and setpoints and setpoints[-1][1]:
        rclpy.spin_once(node, timeout_sec=0.01)
    print(
        json.dumps({'message': answer.message, 'setpoints': setpoints, 'feedback': feedback}),
        flush=True,
    )


if __name__ == '__main__':
    home(sys.argv[1])
