# SPDX-License-Identifier: Apache-2.0
"""Home a line with a tree of py_trees that branches on `error_code`.

pip install py-trees
python examples/home_line.py
"""

import operator
import sys
import time

import py_trees
import rclpy
from homing_interfaces.action import Home
from homing_interfaces.msg import AxisState
from py_trees.common import Access, Status
from rclpy.action import ActionClient
from rclpy.node import Node

#: Errors after which the same request again homes what is left.
LOST = (AxisState.CELL_LOST, AxisState.RESULT_LOST)


class HomeAxes(py_trees.behaviour.Behaviour):
    """Homes axes, none for all; writes `error_code` and `error_msg` to the blackboard."""

    def __init__(self, name: str, node: Node, action: str, axes: tuple[str, ...] = ()) -> None:
        super().__init__(name)
        self.node, self.axes = node, list(axes)
        self.client = ActionClient(node, Home, action)
        self.board = self.attach_blackboard_client(name)
        for key in ('error_code', 'error_msg'):
            self.board.register_key(key, Access.WRITE)

    def initialise(self) -> None:
        """Wait for the action, then send the goal."""
        self.goal = self.sent = self.result = None

    def update(self) -> Status:
        """Go on with the goal; never block."""
        if self.sent is None and self.client.server_is_ready():
            self.sent = self.client.send_goal_async(Home.Goal(axes=self.axes))
        if self.sent is not None and self.goal is None and self.sent.done():
            self.goal = self.sent.result()
            self.result = self.goal.get_result_async()
        if self.result is None or not self.result.done():
            return Status.RUNNING
        answer = self.result.result().result
        self.board.error_code, self.board.error_msg = answer.error_code, answer.message
        self.feedback_message = answer.message
        return Status.SUCCESS if answer.success else Status.FAILURE

    def terminate(self, new_status: Status) -> None:
        """Cancel the goal where the tree leaves it: the axes make a controlled stop."""
        if new_status is Status.INVALID and self.goal is not None:
            self.goal.cancel_goal_async()


class CallOperator(py_trees.behaviour.Behaviour):
    """Tells a person what has failed."""

    def __init__(self) -> None:
        super().__init__('call the operator')
        self.board = self.attach_blackboard_client(self.name)
        for key in ('error_code', 'error_msg'):
            self.board.register_key(key, Access.READ)

    def update(self) -> Status:
        """Print the error; the tree has failed."""
        print(f'not homed ({self.board.error_code}): {self.board.error_msg}', file=sys.stderr)
        return Status.FAILURE


def home_the_line(node: Node, action: str) -> py_trees.behaviour.Behaviour:
    """Return the tree: home; after a lost cell or result once more; else call a person."""
    lost = py_trees.composites.Selector('lost?', memory=False)
    lost.add_children(
        py_trees.behaviours.CheckBlackboardVariableValue(
            f'error {code}?',
            py_trees.common.ComparisonExpression('error_code', code, operator.eq),
        )
        for code in LOST
    )
    again = py_trees.composites.Sequence('again', memory=True)
    again.add_children(
        [
            lost,
            py_trees.timers.Timer('wait', duration=5.0),
            HomeAxes('home what is left', node, action),
        ]
    )
    root = py_trees.composites.Selector('home the line', memory=True)
    root.add_children([HomeAxes('home all', node, action), again, CallOperator()])
    return root


def main() -> int:
    """Tick the tree ten times a second until it has ended."""
    rclpy.init()
    node = Node('line_manager')
    tree = py_trees.trees.BehaviourTree(home_the_line(node, '/homing_coordinator/home'))
    due = time.monotonic()
    while tree.root.status in (Status.INVALID, Status.RUNNING):
        rclpy.spin_once(node, timeout_sec=0.02)
        if time.monotonic() >= due:
            due += 0.1
            tree.tick()
    print(f'{tree.root.status.value}: {tree.root.tip().feedback_message}')
    node.destroy_node()
    rclpy.shutdown()
    return 0 if tree.root.status is Status.SUCCESS else 1


if __name__ == '__main__':
    sys.exit(main())
