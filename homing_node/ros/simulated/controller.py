# SPDX-License-Identifier: Apache-2.0
"""The controller between the setpoints and the simulated drives, fed with messages.

It plays trajectories as joint_trajectory_controller does and positions as
forward_command_controller does (plant/controller.py). Commands by name go the way of positions:
the simulated drives close the loop.
"""

from collections.abc import Mapping, Sequence
from math import isfinite, nan
from typing import Any

from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from ...parameters.node_fields import SetpointInterface
from ...plant.controller import (
    NS,
    RECOMMENDED,
    ForwardController,
    Message,
    Point,
    TrajectoryController,
    Values,
)
from ..setpoints import dof_command
from .settings import Settings

#: The new command of a joint: its position, and its velocity if the controller tells it.
Command = tuple[float, float | None]


class PlayedTrajectories:
    """Trajectories, played as joint_trajectory_controller does.

    ``interpolate``: whether it joins the points, else it forwards the next one; ``over``: how long
    a drive takes to follow a command, s.
    """

    def __init__(
        self, joints: Sequence[str], positions: Sequence[float], rate: float, interpolate: bool
    ) -> None:
        method = 'splines' if interpolate else 'none'
        self._controller = TrajectoryController(
            joints, rate, RECOMMENDED._replace(interpolation_method=method)
        )
        self._controller.activate(positions)
        self._last = tuple(positions)
        self._ends = 0  # when the trajectory ends, ns of the system's time
        self.over = 1.0 / rate

    def activate(self, positions: Sequence[float]) -> None:
        """Become active where the axes are: the drives have no command of before."""
        self._controller.unload()
        self._controller.activate(positions)
        self._last, self._ends = tuple(positions), 0

    def deactivate(self) -> None:
        """Become inactive."""
        self._controller.unload()

    @property
    def joints(self) -> Sequence[str]:
        return self._controller.joints

    @property
    def commands(self) -> Sequence[float]:
        """The last commands, raw."""
        return self._last

    def left(self, now: int) -> float:
        """Return how long the trajectory still lasts at a system time in ns, s."""
        return (self._ends - now) / NS

    def take(self, message: JointTrajectory, now: int) -> str:
        """Take a message at a system time in ns; return why it is refused, else ''."""
        stamp = message.header.stamp
        points = tuple(
            Point(
                point.time_from_start.sec * NS + point.time_from_start.nanosec,
                tuple(point.positions),
                tuple(point.velocities),
                tuple(point.accelerations),
            )
            for point in message.points
        )
        if not all(isfinite(value) for point in points for row in point[1:] for value in row):
            return 'a value is not finite'
        told = Message(stamp.sec * NS + stamp.nanosec, tuple(message.joint_names), points)
        if not self._controller.receive(told, now):
            return self._controller.refused
        self._ends = (told.stamp or now) + points[-1].time
        return ''

    def repeat(self, joint: str) -> None:
        """Return the command of a joint at the next update although it has not changed."""
        self._last = _without(self._last, self._controller.joints.index(joint))

    def update(self, now: int) -> Mapping[str, Command]:
        """Return the commands that differ from the last ones."""
        point = self._controller.update(now, self._last)
        if point is None:
            return {}
        last, self._last = self._last, point.positions
        return {
            joint: (position, velocity)
            for joint, position, velocity, before in zip(
                self._controller.joints, point.positions, point.velocities, last, strict=True
            )
            if position != before
        }


class ForwardedPositions:
    """Arrays of positions, forwarded as forward_command_controller does."""

    def __init__(self, joints: Sequence[str], rate: float, over: float) -> None:
        self._controller = ForwardController(joints, rate)
        self._controller.activate()
        self._last = self._controller.command
        self.over = over

    def activate(self, positions: Sequence[float]) -> None:
        """Become active; without a message nothing is commanded."""
        self._controller = ForwardController(self._controller.joints, 1.0 / self.over)
        self._controller.activate()
        self._last = self._controller.command

    def deactivate(self) -> None:
        """Become inactive."""
        self._controller.deactivate()

    def take(self, message: Float64MultiArray, now: int) -> str:
        """Take a message; return why it is refused, else ''."""
        return self._take(list(message.data))

    def _take(self, data: list[float]) -> str:
        if not self._controller.active:
            return 'an array of a wrong length has deactivated the controller'
        if not self._controller.receive(data):
            return f'positions {data} are not all finite'
        count = len(self._controller.joints)
        return '' if len(data) == count else f'{len(data)} positions for {count} joints'

    def repeat(self, joint: str) -> None:
        """Return the command of a joint at the next update although it has not changed."""
        self._last = _without(self._last, self._controller.joints.index(joint))

    def update(self, now: int) -> Mapping[str, Command]:
        """Return the commands that differ from the last ones; the first has no velocity."""
        command = self._controller.update()
        if command is None:
            return {}
        last, self._last = self._last, command
        return {
            joint: (position, None if isfinite(before) else 0.0)
            for joint, position, before in zip(self._controller.joints, command, last, strict=True)
            if position != before and isfinite(position)
        }


class ForwardedDofs(ForwardedPositions):
    """Commands by name (`control_msgs/MultiDOFCommand`); their positions are forwarded.

    As pid_controller does, it wants each of its joints; here their order matters too.
    """

    def take(self, message: Any, now: int) -> str:
        """Take a message; return why it is refused, else ''."""
        if tuple(message.dof_names) != self._controller.joints:
            return f'the command is for {", ".join(message.dof_names)}'
        return self._take(list(message.values))


def controller_for(
    settings: Settings, start: Sequence[float]
) -> tuple[PlayedTrajectories | ForwardedPositions, Any]:
    """Return the controller that plays the setpoints, and the type of their messages."""
    joints, rate, over = settings.joints, settings.controller_rate, settings.setpoint_period
    if settings.setpoint_interface is SetpointInterface.trajectory:
        return PlayedTrajectories(joints, start, rate, settings.interpolate), JointTrajectory
    if settings.setpoint_interface is SetpointInterface.position:
        return ForwardedPositions(joints, rate, over), Float64MultiArray
    return ForwardedDofs(joints, rate, over), dof_command()


def _without(values: Values, place: int) -> Values:
    """Return values, one of which equals none."""
    return (*values[:place], nan, *values[place + 1 :])
