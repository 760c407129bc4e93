# SPDX-License-Identifier: Apache-2.0
"""Passes joint states on as they come, as bytes, in the shortest way that rclpy has.

bare_relay.py: by the executor's callback; bare_relay.py --poll: by a loop that polls.
"""

import sys
import time
from contextlib import suppress

import rclpy
from rclpy.executors import ExternalShutdownException
from sensor_msgs.msg import JointState

POLL = 0.0002


def main() -> None:
    rclpy.init()
    node = rclpy.create_node('homed_axes', start_parameter_services=False, enable_rosout=False)
    publisher = node.create_publisher(JointState, '~/joint_states', 100)
    callback = publisher.publish
    subscription = node.create_subscription(JointState, 'joint_states', callback, 100, raw=True)
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        if '--poll' not in sys.argv:
            rclpy.spin(node)
        while True:
            taken = subscription.handle.take_message(JointState, True)
            if taken is None:
                time.sleep(POLL)
            else:
                publisher.publish(taken[0])


if __name__ == '__main__':
    main()
