# SPDX-License-Identifier: Apache-2.0
"""Records what one axis does, from its topics, into a course; for scripts (client.py)."""

import time
from collections.abc import Callable, Mapping
from typing import Any

from homing_interfaces.msg import AxisState
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64
from trajectory_msgs.msg import JointTrajectory

from ..course import Course, Happening, Sample
from ..procedures.states import LATCHES, Input, State

BEST_EFFORT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)

#: What the middleware says of a message.
Info = Mapping[str, int]


class CourseRecorder:
    """Fills a course from the topics of one axis; the times are those of publishing."""

    def __init__(
        self,
        node: Node,
        node_name: str,
        axis: str,
        joint: str,
        state: Callable[[str], AxisState],
    ) -> None:
        """Begin to record.

        Args:
            node: The node that subscribes.
            node_name: The full name of the homing node.
            axis: The name of the axis.
            joint: The name of its joint.
            state: Returns the newest state of an axis.
        """
        self.course = Course()
        self._node, self._axis, self._joint, self._state = node, axis, joint, state
        self._begun = time.time_ns()
        self._feedback = 0.0
        self._levels: dict[Input, bool] = {}
        self._subscriptions = [
            node.create_subscription(
                JointTrajectory, f'{node_name}/setpoints', self._take_setpoint, 100
            ),
            node.create_subscription(JointState, 'joint_states', self._take_feedback, BEST_EFFORT),
        ]
        for source in Input:
            if source is not Input.SERVO_ENABLED:
                self._subscriptions.append(
                    node.create_subscription(
                        Float64 if source in LATCHES else Bool,
                        f'{node_name}/{axis}/{source}',
                        self._input_taker(source),
                        100,
                    )
                )

    def close(self) -> None:
        """Stop recording."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)

    def _time(self, info: Info) -> float:
        return (info['source_timestamp'] - self._begun) * 1e-9

    def _take_setpoint(self, message: JointTrajectory, info: Info) -> None:
        if self._joint not in message.joint_names:
            return
        index, point = message.joint_names.index(self._joint), message.points[0]
        state = self._state(self._axis).state
        if state != State.Idle:
            self.course.samples.append(
                Sample(
                    self._time(info),
                    state,
                    point.positions[index],
                    point.velocities[index],
                    point.accelerations[index],
                    self._feedback,
                )
            )

    def _take_feedback(self, message: JointState) -> None:
        if self._joint in message.name:
            self._feedback = message.position[message.name.index(self._joint)]

    def _input_taker(self, source: Input) -> Callable[[Any, Info], None]:
        def take(message: Bool | Float64, info: Info) -> None:
            value = message.data
            latched = source in LATCHES
            if not latched:
                before, self._levels[source] = self._levels.get(source, value), value
                if before == value:
                    return
            self.course.happenings.append(
                Happening(
                    self._time(info), str(source), value, value if latched else self._feedback
                )
            )

        return take
