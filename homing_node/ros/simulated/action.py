# SPDX-License-Identifier: Apache-2.0
"""The action of the simulated controller: FollowJointTrajectory, as JTC serves it.

Without the package control_msgs there is no such action, and the topic alone is served.
"""

from functools import partial
from typing import Any, Protocol

from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

try:
    from control_msgs.action import FollowJointTrajectory
except ImportError:
    FollowJointTrajectory = None

#: How often a goal is looked at, and its feedback is sent, s.
PERIOD = 0.05
#: How far from its last point an axis may be at the end, where the goal does not say, m or rad.
TOLERANCE = 1e-4
#: How long after its last point a goal may end, s.
GOAL_TIME = 2.0


class Playing(Protocol):
    """What a goal needs of the plant; `play` and `hold` are called between two of its steps."""

    active: bool

    def play(self, message: JointTrajectory) -> str:
        """Play a trajectory; return why it is refused, else ''."""

    def hold(self) -> str:
        """Hold every axis where it is."""

    def shown(self) -> tuple[list[str], list[float], list[float]]:
        """Return the joints, their commands and their feedback, raw."""

    def left(self) -> float:
        """Return how long the trajectory still lasts, s; below 0: it is over for so long."""


class Goals:
    """Serves the action; a new goal ends the one before."""

    def __init__(self, node: Node, jobs: Any, plant: Playing) -> None:
        self._node, self._jobs, self._plant = node, jobs, plant
        self._goal: Any = None
        self._group = ReentrantCallbackGroup()
        if FollowJointTrajectory is None:
            node.get_logger().info('without control_msgs there is no follow_joint_trajectory')
            return
        self._server = ActionServer(
            node,
            FollowJointTrajectory,
            '~/follow_joint_trajectory',
            self._execute,
            callback_group=self._group,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    async def _execute(self, goal: Any) -> Any:
        result = FollowJointTrajectory.Result()
        refused = self._jobs.do(partial(self._plant.play, goal.request.trajectory))
        if refused:
            goal.abort()
            result.error_code, result.error_string = result.INVALID_GOAL, refused
            return result
        self._goal = goal
        targets = _targets(goal.request)
        while True:
            await self._pause()
            if self._goal is not goal:
                goal.abort()
                result.error_code, result.error_string = result.INVALID_GOAL, 'preempted'
                return result
            if not self._plant.active:
                goal.abort()
                result.error_code, result.error_string = result.INVALID_GOAL, 'deactivated'
                return result
            if goal.is_cancel_requested:
                self._jobs.do(self._plant.hold)
                goal.canceled()
                return result
            names, desired, actual = self._plant.shown()
            goal.publish_feedback(_feedback(names, desired, actual))
            left = self._plant.left()
            now = dict(zip(names, actual, strict=True))
            if left <= 0.0 and all(abs(now[n] - p) <= tol for n, (p, tol) in targets.items()):
                goal.succeed()
                return result
            if left < -GOAL_TIME:
                goal.abort()
                result.error_code = result.GOAL_TOLERANCE_VIOLATED
                result.error_string = f'the goal is not reached after {GOAL_TIME:g} s'
                return result

    def _pause(self) -> Future:
        future = Future(executor=self._node.executor)

        def end() -> None:
            self._node.destroy_timer(timer)
            future.set_result(None)

        clock = Clock(clock_type=ClockType.STEADY_TIME)
        timer = self._node.create_timer(PERIOD, end, callback_group=self._group, clock=clock)
        return future


def _targets(request: Any) -> dict[str, tuple[float, float]]:
    """Return the last position of each joint, and how far from it the joint may be."""
    tolerances = {one.name: one.position for one in request.goal_tolerance if one.position > 0.0}
    trajectory = request.trajectory
    last = trajectory.points[-1].positions
    return {
        name: (position, tolerances.get(name, TOLERANCE))
        for name, position in zip(trajectory.joint_names, last, strict=True)
    }


def _feedback(names: list[str], desired: list[float], actual: list[float]) -> Any:
    def point(values: list[float]) -> JointTrajectoryPoint:
        return JointTrajectoryPoint(positions=values)

    return FollowJointTrajectory.Feedback(
        joint_names=names,
        desired=point(desired),
        actual=point(actual),
        error=point([d - a for d, a in zip(desired, actual, strict=True)]),
    )
