# SPDX-License-Identifier: Apache-2.0
"""A cell as a test wants it: a node whose checks, goals, cancels and clock the test decides on.

It has the names of a homing node, but no axis moves. A coordinator is a process beside it.
"""

import time

import rclpy
from homing_interfaces.action import Home
from homing_interfaces.msg import AxisState
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from std_srvs.srv import Trigger

PERIOD = 0.1  # s, of the states
MOVING = 'HomeSwitchSearch'


class Goal:
    """A goal that a cell was sent; it ends when the test says how."""

    def __init__(self, handle, future):
        self.handle, self.future = handle, future
        (self.axis,) = handle.request.axes

    def end(self, error=''):
        """End the run of the axis; its result leaves."""
        if not self.future.done():
            self.future.set_result(error)


class CellStandIn:
    """A cell in the test's process, which spins it.

    Attributes:
        homed: The axes that are homed.
        moving: The axes that home.
        checks: The axes of each dry run that has come.
        goals: The goals that have come, by axis; the newest one.
        canceled: The axes whose cancel has come.
        hold: Whether dry runs wait for an answer until `release`.
        on_cancel: What becomes of a goal that is canceled.
        clock: How far the clock of its host is ahead, s.
    """

    def __init__(self, context, cell, axes):
        self.context, self.cell, self.axes = context, cell, list(axes)
        self.checks, self.goals, self.canceled = [], {}, []
        self.hold, self._held, self._all = False, [], []
        self.on_cancel = lambda goal: goal.end('Canceled')
        self.clock = 0.0
        self.start()

    def start(self):
        """Start a node, to which nothing is homed."""
        self.homed, self.moving = set(), set()
        self.node = rclpy.create_node(
            'homing_node', namespace=self.cell, context=self.context, enable_rosout=False
        )
        self.node.declare_parameter('axes', self.axes)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._states = {
            axis: self.node.create_publisher(AxisState, f'~/{axis}/state', latched)
            for axis in self.axes
        }
        group = ReentrantCallbackGroup()
        self._action = ActionServer(
            self.node,
            Home,
            '~/home',
            self._execute,
            callback_group=group,
            cancel_callback=self._cancel,
        )
        for name in ('cancel', *(f'{axis}/cancel' for axis in self.axes)):
            self.node.create_service(Trigger, f'~/{name}', self._rest, callback_group=group)
        self.node.create_timer(PERIOD, self._publish, callback_group=group)

    def end(self):
        """End the node."""
        self._action.destroy()
        self.node.destroy_node()

    def release(self):
        """Answer the dry runs that wait."""
        self.hold = False
        held, self._held = self._held, []
        for future in held:
            future.set_result(None)

    def stop(self, axis, homed):
        """Let an axis come to rest; the result of its goal does not leave."""
        self.moving.discard(axis)
        (self.homed.add if homed else self.homed.discard)(axis)

    def state(self, axis, error=''):
        now = time.time_ns() + round(self.clock * 1e9)
        message = AxisState(
            axis=axis,
            state=MOVING if axis in self.moving else 'Idle',
            homed=axis in self.homed,
            error=error or 'NoError',
            error_code=AxisState.CANCELED if error else 0,
        )
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(now, 1_000_000_000)
        return message

    def _publish(self):
        for axis, publisher in self._states.items():
            publisher.publish(self.state(axis))

    def _rest(self, _, response):
        response.success, response.message = True, 'nothing to cancel'
        return response

    def _future(self):
        return Future(executor=self.node.executor)

    async def _execute(self, handle):
        axes = list(handle.request.axes)
        if handle.request.dry_run:
            self.checks.append(axes)
            if self.hold:
                self._held.append(self._future())
                await self._held[-1]
            handle.succeed()
            return Home.Result(success=True, states=[self.state(axis) for axis in axes])
        goal = self.goals[axes[0]] = Goal(handle, self._future())
        self._all.append(goal)
        self.moving.add(goal.axis)
        self.homed.discard(goal.axis)
        error = await goal.future
        self.stop(goal.axis, homed=not error)
        if not error:
            handle.succeed()
        elif handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        return Home.Result(
            success=not error,
            message=f'{error}: so the test wants it' if error else 'Homed',
            error_code=AxisState.CANCELED if error else 0,
            states=[self.state(goal.axis, error)],
        )

    def _cancel(self, handle):
        for goal in self._all:
            if goal.handle.goal_id == handle.goal_id:
                self.canceled.append(goal.axis)
                self.on_cancel(goal)
        return CancelResponse.ACCEPT
