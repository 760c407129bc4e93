# SPDX-License-Identifier: Apache-2.0
"""Records what one axis does, from its topics, into a course; for scripts (client.py).

Of a gantry the leader and each follower have a course; they get their samples from the same
messages.
"""

import time
from collections.abc import Callable, Mapping
from types import MappingProxyType
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


class _Drive:
    """One drive of an axis: its joint, its course, and what was heard last."""

    def __init__(self, joint: str) -> None:
        self.joint, self.course = joint, Course()
        self.feedback = 0.0
        self.heard = False
        self.levels: dict[Input, bool] = {}


class CourseRecorder:
    """Fills a course from the topics of one axis; the times are those of publishing."""

    def __init__(
        self,
        node: Node,
        node_name: str,
        axis: str,
        joint: str,
        state: Callable[[str], AxisState],
        followers: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        """Begin to record.

        Args:
            node: The node that subscribes.
            node_name: The full name of the homing node.
            axis: The name of the axis.
            joint: The name of its joint.
            state: Returns the newest state of an axis.
            followers: The joints of the followers of a gantry, by their names in `followers`.
        """
        leader = _Drive(joint)
        others = {f'{axis}.{name}': _Drive(own) for name, own in followers.items()}
        self.course = leader.course
        self.course.followers = {name: drive.course for name, drive in others.items()}
        self._drives = [leader, *others.values()]
        self._node, self._axis, self._state = node, axis, state
        self._begun = time.time_ns()
        self._subscriptions = [
            node.create_subscription(
                JointTrajectory, f'{node_name}/setpoints', self._take_setpoint, 100
            ),
            node.create_subscription(JointState, 'joint_states', self._take_feedback, BEST_EFFORT),
        ]
        for name, drive in {axis: leader, **others}.items():
            for source in Input:
                if source is not Input.SERVO_ENABLED:
                    self._subscriptions.append(
                        node.create_subscription(
                            Float64 if source in LATCHES else Bool,
                            f'{node_name}/{name.replace(".", "/")}/{source}',
                            self._input_taker(drive, source),
                            100,
                        )
                    )

    def wait(self, patience: float) -> None:
        """Wait until the feedback of all joints was heard; another thread spins the node.

        Raises:
            TimeoutError: nothing was heard of a joint for ``patience`` s.
        """
        until = time.monotonic() + patience
        while missing := [drive.joint for drive in self._drives if not drive.heard]:
            if time.monotonic() > until:
                raise TimeoutError(f'no joint_states of {", ".join(missing)} in {patience:g} s')
            time.sleep(0.02)

    def close(self) -> None:
        """Stop recording."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)

    def _time(self, info: Info) -> float:
        return (info['source_timestamp'] - self._begun) * 1e-9

    def _take_setpoint(self, message: JointTrajectory, info: Info) -> None:
        joints, point = message.joint_names, message.points[0]
        if not {drive.joint for drive in self._drives} <= set(joints):
            return
        state = self._state(self._axis).state
        if state == State.Idle:
            return
        for drive in self._drives:
            index = joints.index(drive.joint)
            drive.course.samples.append(
                Sample(
                    self._time(info),
                    state,
                    point.positions[index],
                    point.velocities[index],
                    point.accelerations[index],
                    drive.feedback,
                )
            )

    def _take_feedback(self, message: JointState) -> None:
        for drive in self._drives:
            if drive.joint in message.name:
                drive.feedback = message.position[message.name.index(drive.joint)]
                drive.heard = True

    def _input_taker(self, drive: _Drive, source: Input) -> Callable[[Any, Info], None]:
        def take(message: Bool | Float64, info: Info) -> None:
            value = message.data
            latched = source in LATCHES
            if not latched:
                before, drive.levels[source] = drive.levels.get(source, value), value
                if before == value:
                    return
            drive.course.happenings.append(
                Happening(
                    self._time(info), str(source), value, value if latched else drive.feedback
                )
            )

        return take
