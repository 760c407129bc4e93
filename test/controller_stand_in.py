# SPDX-License-Identifier: Apache-2.0
"""A process that looks like a ros2_control controller, and its controller manager, to the node.

It has the parameters of the controller, subscribes to a topic of its type and publishes its
transitions. It plays nothing. Its one argument is JSON; each line on its standard input is a
lifecycle state that it takes.
"""

import json
import sys
import threading
from contextlib import suppress

import rclpy
from lifecycle_msgs.msg import State, TransitionEvent
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

KINDS = {'trajectory': JointTrajectory, 'position': Float64MultiArray}


def declare(node, parameters):
    for name, value in parameters.items():
        if value == []:  # rclpy takes it for bytes
            node.declare_parameter(name, Parameter.Type.STRING_ARRAY)
            node.set_parameters([Parameter(name, Parameter.Type.STRING_ARRAY, [])])
        elif node.has_parameter(name):
            node.set_parameters([Parameter(name, value=value)])
        else:
            node.declare_parameter(name, value)


class StandIn:
    """A controller, and where ``manager`` has its parameters, the manager too."""

    def __init__(self, name, parameters, topic, interface='trajectory', manager=None, state=''):
        self.state = state
        self.node = Node(name)
        declare(self.node, parameters)
        self.node.create_subscription(KINDS[interface], topic, lambda _: None, 10)
        self._transitions = self.node.create_publisher(TransitionEvent, '~/transition_event', 10)
        self.nodes = [self.node]
        if manager is not None:
            self._manage(manager)

    def _manage(self, parameters):
        from controller_manager_msgs.msg import ControllerState
        from controller_manager_msgs.srv import ListControllers

        manager = Node('controller_manager')
        declare(manager, parameters)

        def answer(_, response):
            claimed = [f'{joint}/position' for joint in self.node.get_parameter('joints').value]
            response.controller = [
                ControllerState(
                    name=self.node.get_name(),
                    state=self.state,
                    claimed_interfaces=claimed if self.state == 'active' else [],
                )
            ]
            return response

        manager.create_service(ListControllers, '~/list_controllers', answer)
        self.nodes.append(manager)

    def take(self, state, silent=False):
        """Take a lifecycle state and publish the transition, as a controller does."""
        before, self.state = self.state, state
        if not silent:
            self._transitions.publish(
                TransitionEvent(start_state=State(label=before), goal_state=State(label=state))
            )


def main():
    rclpy.init()
    stand_in = StandIn(**json.loads(sys.argv[1]))
    executor = rclpy.executors.SingleThreadedExecutor()
    for node in stand_in.nodes:
        executor.add_node(node)

    def obey():
        for line in sys.stdin:
            silent, _, state = line.strip().rpartition(' ')
            stand_in.take(state, silent == 'silently')
        executor.create_task(rclpy.shutdown)  # the test has ended

    threading.Thread(target=obey, daemon=True).start()
    with suppress(KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        executor.spin()
    for node in stand_in.nodes:  # so that the others hear that it has gone
        node.destroy_node()


if __name__ == '__main__':
    main()
