# SPDX-License-Identifier: Apache-2.0
"""A process that sends a goal and is interrupted at once, as `ros2 action send_goal` is.

Like ros2cli it cancels, when it ends, a goal whose status it knows to be accepted or executing.
"""

import sys
import threading

import rclpy
from action_msgs.msg import GoalStatus
from homing_interfaces.action import Home
from rclpy.action import ActionClient


def main(axis, interrupted_after):
    rclpy.init()
    node = rclpy.create_node('send_goal', start_parameter_services=False, enable_rosout=False)
    client = ActionClient(node, Home, '/homing_node/home')
    client.wait_for_server()
    sent = client.send_goal_async(Home.Goal(axes=[axis]), lambda _: None)
    rclpy.spin_until_future_complete(node, sent)
    goal = sent.result()
    ended = goal.get_result_async()
    over = rclpy.task.Future()
    threading.Timer(interrupted_after, over.set_result, [None]).start()
    while not (over.done() or ended.done()):
        rclpy.spin_once(node, timeout_sec=0.01)
    known = goal.status in (GoalStatus.STATUS_ACCEPTED, GoalStatus.STATUS_EXECUTING)
    if known:
        rclpy.spin_until_future_complete(node, goal.cancel_goal_async())
        rclpy.spin_until_future_complete(node, ended)
        print('canceled', ended.result().status, flush=True)
    else:
        print('unknown', goal.status, flush=True)


if __name__ == '__main__':
    main(sys.argv[1], float(sys.argv[2]))
