# SPDX-License-Identifier: Apache-2.0
"""Publishes setpoints on a grid, from a thread of its own, in the shortest way that rclpy has.

With --inputs it also takes the messages that the homing node takes.
"""

import argparse
import signal
import threading
import time

import rclpy
from builtin_interfaces.msg import Duration
from grid import Grid
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

#: The points that the node tells: the plan up to the horizon, and the three of a stop, ns.
HORIZON, STOP = 20_000_000, (5_000_000, 100_000_000, 105_000_000)


def cycle(axes: int, rate: float, inputs: bool, ended: threading.Event, grid: Grid) -> None:
    node = rclpy.create_node('homing_node')
    names = [f'a{i}' for i in range(axes)]
    publisher = node.create_publisher(JointTrajectory, '~/setpoints', 1)
    subscriptions = []
    if inputs:
        qos = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
        wired = ('home_switch', 'positive_limit_switch', 'negative_limit_switch')
        subscriptions = [
            node.create_subscription(Bool, f'~/{name}/{switch}', print, 100)
            for name in names
            for switch in wired
        ]
        subscriptions.append(node.create_subscription(JointState, 'joint_states', print, qos))
    period = 1.0 / rate
    step = round(period * 1e9)
    times = [*range(0, HORIZON + 1, step), *(HORIZON + more for more in STOP)]
    position, due = 0.0, time.monotonic()
    while not ended.is_set():
        due += period
        grid.note(due)
        time.sleep(max(0.0, due - time.monotonic()))
        for subscription in subscriptions:
            while subscription.handle.take_message(subscription.msg_type, False) is not None:
                pass
        position += 0.05 * period
        publisher.publish(
            JointTrajectory(
                joint_names=names,
                points=[
                    JointTrajectoryPoint(
                        positions=[position + 0.05 * time * 1e-9] * axes,
                        velocities=[0.05 if time <= HORIZON else 0.0] * axes,
                        accelerations=[0.0] * axes,
                        time_from_start=Duration(nanosec=time),
                    )
                    for time in times
                ],
            )
        )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument('--axes', type=int, required=True)
    parser.add_argument('--rate', type=float, required=True)
    parser.add_argument('--inputs', action='store_true')
    parser.add_argument('--grid', required=True)
    arguments = parser.parse_args()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    ended, grid = threading.Event(), Grid()
    signal.signal(signal.SIGINT, lambda *_: ended.set())
    thread = threading.Thread(
        target=cycle, args=(arguments.axes, arguments.rate, arguments.inputs, ended, grid)
    )
    thread.start()
    while not ended.wait(0.1):
        pass
    thread.join()
    grid.save(arguments.grid)


if __name__ == '__main__':
    main()
