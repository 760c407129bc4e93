# SPDX-License-Identifier: Apache-2.0
"""Motions in front of one controller: its topic and its action, in homed coordinates.

A refused goal is accepted and aborted, so that its result says why. A goal that runs ends with the
controller's result, with the client's cancel, or, when an axis loses its home or the controller is
gone, at once: it is canceled at the controller, and aborted with the reason.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient, ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future
from trajectory_msgs.msg import JointTrajectory

from ...diagnosis.listeners import others
from ...procedures.states import Error
from ...relay.known_home import Knowledge, KnownHome
from ...relay.trajectories import to_homed, to_raw
from .. import graph

try:
    from control_msgs.action import FollowJointTrajectory
except ImportError:
    FollowJointTrajectory = None

#: How long a goal waits for the homing node's word on a home that is being handed over, s. The
#: client may know before the relay that the axis is homed.
CONFIRMED = 0.5
#: Whether the action can be served here.
INSTALLED = FollowJointTrajectory is not None
QUEUE = 10


class Running:
    """One goal that the controller has, or will have.

    ``over``: set once, with the status and the result of the controller, or with the reason why
    the goal is given up.
    """

    def __init__(self, goal: Any, over: Future) -> None:
        self.goal, self.over = goal, over
        self.joints = list(goal.request.trajectory.joint_names)
        self._handle: Any = None  # at the controller
        self._unwanted = False

    def sent(self, future: Future) -> None:
        """Take the controller's word on the goal."""
        self._handle = future.result()
        if not self._handle.accepted:
            self.give_up('the controller has rejected the goal')
            return
        self._handle.get_result_async().add_done_callback(self._ended)
        if self._unwanted:
            self._handle.cancel_goal_async()

    def cancel(self) -> None:
        """Cancel it at the controller, whose result ends it."""
        self._unwanted = True
        if self._handle is not None and self._handle.accepted:
            self._handle.cancel_goal_async()

    def give_up(self, reason: str) -> None:
        """End it here and now, and cancel it at the controller."""
        self.cancel()
        if not self.over.done():
            self.over.set_result(reason)

    def _ended(self, future: Future) -> None:
        if not self.over.done():
            self.over.set_result(future.result())


class ControllerRelay:
    """The motions in front of one controller."""

    def __init__(
        self,
        node: Node,
        controller: str,
        names: Sequence[str],
        axes: Mapping[str, KnownHome],
        homing_node: str,
        guarded: Callable[[Callable[[], Any]], Any],
    ) -> None:
        """Create the topics and the action.

        Args:
            node: The node of the relay.
            controller: The controller's node.
            names: What stands before the names of the topic and the action here.
            axes: The axes, by joint.
            homing_node: The full name of the homing node, which publishes to the controller too.
            guarded: Calls a function while the axes are locked.
        """
        self._node, self._axes, self._homing_node = node, axes, homing_node
        self._guarded = guarded
        self._running: list[Running] = []
        self._waiting: list[tuple[Future, list[str], float]] = []  # goals, until when, s
        self._over = ''  # why no goal is relayed any more
        self._publisher = node.create_publisher(
            JointTrajectory, f'{controller}/joint_trajectory', QUEUE
        )
        group = ReentrantCallbackGroup()
        for name in names:
            node.create_subscription(
                JointTrajectory, f'{name}/joint_trajectory', self._relay, QUEUE
            )
        if FollowJointTrajectory is None:
            return
        self._client = ActionClient(
            node, FollowJointTrajectory, f'{controller}/follow_joint_trajectory'
        )
        self._action = f'{controller}/follow_joint_trajectory'
        self._servers = [
            ActionServer(
                node,
                FollowJointTrajectory,
                f'{name}/follow_joint_trajectory',
                self._execute,
                callback_group=group,
                cancel_callback=self._cancel,
            )
            for name in names
        ]

    def watch(self) -> None:
        """Give up goals of axes that have lost their home, and of a controller that is gone."""
        for one in list(self._waiting):
            future, joints, until = one
            if time.monotonic() > until or not self._guarded(partial(self._told, joints)):
                self._waiting.remove(one)
                future.set_result(None)
        for running in list(self._running):
            why = self._guarded(partial(self._lost, running.joints))
            if not why and not self._client.server_is_ready():
                why = f'nobody serves {self._action} any more'
            if why:
                running.give_up(why)

    def stop(self, reason: str) -> bool:
        """Give up every goal; return whether one is still there."""
        self._over = reason
        for running in list(self._running):
            running.give_up(reason)
        while self._waiting:
            self._waiting.pop()[0].set_result(None)
        return bool(self._running)

    # ------------------------------------------------------------------------------------- inside

    def _lost(self, joints: Sequence[str]) -> str:
        return next(
            (self._axes[j].refusal for j in joints if j in self._axes and self._axes[j].refusal),
            '',
        )

    def _told(self, joints: Sequence[str]) -> bool:
        """Return whether the home of an axis is being handed over."""
        axes = (self._axes[joint] for joint in joints if joint in self._axes)
        return any(axis.knowledge is Knowledge.Told for axis in axes)

    def _conflict(self) -> str:
        """Return who else publishes to the controller, '' for nobody."""
        topic = self._publisher.topic_name
        if self._node.count_publishers(topic) < 2:
            return ''
        # One that was killed may stay listed beside the one that has taken its place.
        listed = graph.publishers(self._node, topic)
        found = [one for one in listed if one.node != self._homing_node]
        second = others(self._node.get_fully_qualified_name(), found, {self._homing_node})
        if not second:
            return ''
        return (
            f'{Error.PublisherConflict}: {topic} is published by {", ".join(second)}, too (one '
            'that was killed stays listed for about 20 s)'
        )

    def _to_raw(self, trajectory: Any) -> str:
        """Turn a trajectory into raw coordinates; return why it must not be played, else ''."""
        return self._conflict() or self._guarded(partial(to_raw, trajectory, self._axes))

    def _relay(self, trajectory: JointTrajectory) -> None:
        """Relay a message of the topic, or say why not."""
        why = self._to_raw(trajectory)
        if why:
            text = f'a trajectory is refused: {why}'
            self._node.get_logger().error(text, throttle_duration_sec=1.0)
            return
        self._publisher.publish(trajectory)

    async def _execute(self, goal: Any) -> Any:
        """Relay a goal, and return how it ended."""
        request = goal.request
        joints = list(request.trajectory.joint_names)
        if self._guarded(partial(self._told, joints)):
            confirmed = Future(executor=self._node.executor)
            self._waiting.append((confirmed, joints, time.monotonic() + CONFIRMED))
            await confirmed
            if goal.is_cancel_requested:
                goal.canceled()
                return FollowJointTrajectory.Result()
        why = self._over or self._to_raw(request.trajectory)
        if not why and not self._client.server_is_ready():
            why = f'nobody serves {self._action}'
        if why:
            return self._abort(goal, why)
        running = Running(goal, Future(executor=self._node.executor))
        self._running.append(running)
        sending = self._client.send_goal_async(
            request, feedback_callback=partial(self._feedback, running)
        )
        sending.add_done_callback(running.sent)
        ended = await running.over
        self._running.remove(running)
        if isinstance(ended, str):
            return self._abort(goal, ended)
        result = ended.result
        if ended.status == GoalStatus.STATUS_SUCCEEDED:
            goal.succeed()
        elif ended.status == GoalStatus.STATUS_CANCELED and goal.is_cancel_requested:
            goal.canceled()
        else:
            goal.abort()
            result.error_string = result.error_string or (
                'the controller has canceled the goal: another one has taken its place'
            )
        return result

    def _abort(self, goal: Any, why: str) -> Any:
        self._node.get_logger().error(f'a goal is aborted: {why}')
        goal.abort()
        result = FollowJointTrajectory.Result()
        result.error_code, result.error_string = result.INVALID_GOAL, why
        return result

    def _cancel(self, goal: Any) -> CancelResponse:
        for running in self._running:
            if bytes(running.goal.goal_id.uuid) == bytes(goal.goal_id.uuid):
                running.cancel()
        return CancelResponse.ACCEPT

    def _feedback(self, running: Running, message: Any) -> None:
        """Relay the feedback of the controller."""
        if running.over.done():
            return
        feedback = message.feedback
        points = feedback.desired, feedback.actual
        if self._guarded(partial(to_homed, points, feedback.joint_names, self._axes)):
            running.goal.publish_feedback(feedback)
