# SPDX-License-Identifier: Apache-2.0
"""Offers one service."""

from contextlib import suppress

import rclpy
from rclpy.executors import ExternalShutdownException
from std_srvs.srv import Trigger


def cancel(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
    response.success = True
    return response


def main() -> None:
    rclpy.init()
    node = rclpy.create_node('homing_node')
    node.create_service(Trigger, '~/a0/cancel', cancel)
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)


if __name__ == '__main__':
    main()
