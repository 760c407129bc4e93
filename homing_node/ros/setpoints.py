# SPDX-License-Identifier: Apache-2.0
"""How setpoints leave the node: one class for each value of `setpoint_interface`.

A new interface is one more class here, its name in `SetpointInterface`
(parameters/configuration.py) and a line in `INTERFACES`.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from ..core.announcement import announcement, least_horizon
from ..core.axis import Axis, Setpoint
from ..core.outcome import Outcome
from ..parameters.configuration import Configuration, SetpointInterface, SetpointStamp
from ..procedures.states import Error
from .serialized import PlainTrajectoryWriter, TrajectoryWriter
from .timebase import Stamps, TimeBase

#: (message type, topic) -> a publisher.
CreatePublisher = Callable[[Any, str], Any]


class Setpoints(Protocol):
    """Publishes the setpoints of the axes through one interface.

    The cycle calls `message` while the axes are locked and `publish` when they no longer are.
    """

    def message(self, moving: Mapping[str, Setpoint], due: float) -> Any:
        """Return the message of this cycle, None if there is nothing to publish.

        Args:
            moving: The setpoints of the axes that move in this cycle, by the axis's name.
            due: When the cycle is due, s of the core's time.
        """

    def publish(self, message: Any) -> None:
        """Publish a message that `message` returned."""

    def unready(self) -> Outcome | None:
        """Return why no axis can start a run through this interface now, else None."""


class TrajectorySetpoints:
    """`trajectory`: publishes what the joints that move will do, on `~/setpoints`.

    The plan from the present up to `setpoint_horizon`, and a stop to rest after it
    (core/announcement.py).
    """

    def __init__(
        self,
        axes: Mapping[str, Axis],
        checked: Configuration,
        timebase: TimeBase,
        create_publisher: CreatePublisher,
    ) -> None:
        """Create the publisher.

        Args:
            axes: The axes, by name.
            checked: The parameters of the node.
            timebase: The clock of the node.
            create_publisher: Makes a publisher of a message type and a topic.
        """
        self._axes, self._joints = axes, checked.joints
        self._period = 1.0 / checked.update_rate
        least = max(checked.setpoint_horizon, least_horizon(self._period, checked.lead))
        self._horizon = math.ceil(least / self._period - 1e-6) * self._period
        self._stamped = checked.setpoint_stamp is SetpointStamp.due
        self._stamps = Stamps(timebase)
        self._writer = (TrajectoryWriter if checked.serialized else PlainTrajectoryWriter)()
        self._publisher = create_publisher(JointTrajectory, '~/setpoints')

    def message(self, moving: Mapping[str, Setpoint], due: float) -> Any:
        """Return a trajectory of the axes that move."""
        if not moving:
            return None
        courses = [self._axes[name].course(self._horizon) for name in moving]
        times, rows = announcement(courses, self._period, self._horizon)
        first = stamp = 0
        if self._stamped:
            first = times[0]
            stamp = self._stamps.stamp_of(due) + first
            times = [time - first for time in times]
        return self._writer.write([self._joints[name] for name in moving], stamp, times, rows)

    def publish(self, message: Any) -> None:
        """Publish a trajectory."""
        self._publisher.publish(message)

    def unready(self) -> Outcome | None:
        """Return None: a trajectory names only the axes that move."""
        return None


class PositionSetpoints:
    """`position`: publishes one position for each axis, on `~/position_commands`.

    The array also commands the axes that rest. The command of an axis at rest is fixed when it is
    first published, for a command that followed the feedback would let the axis sink. It is
    forgotten when a run of the axis ends or its servo is off: then the array holds the axis where
    it is.
    """

    def __init__(
        self,
        axes: Mapping[str, Axis],
        checked: Configuration,
        timebase: TimeBase,
        create_publisher: CreatePublisher,
    ) -> None:
        """Create the publisher; the arguments are those of `TrajectorySetpoints`."""
        self._axes = axes
        self._publisher = create_publisher(Float64MultiArray, '~/position_commands')
        self._held: dict[str, float] = {}  # the fixed commands of the axes at rest

    def message(self, moving: Mapping[str, Setpoint], due: float) -> Any:
        """Return the position of each axis, in the order of `axes`, while a run is on."""
        for name, axis in self._axes.items():
            if name in moving or not axis.powered:
                self._held.pop(name, None)
        if moving:
            return Float64MultiArray(
                data=[
                    float(moving[name][0] if name in moving else self._held_position(axis))
                    for name, axis in self._axes.items()
                ]
            )
        if not any(axis.running for axis in self._axes.values()):
            self._held.clear()
        return None

    def hold(self, positions: Mapping[str, float]) -> Any:
        """Return the array that tells every axis to stay at a raw position."""
        return Float64MultiArray(data=[float(positions[name]) for name in self._axes])

    def publish(self, message: Any) -> None:
        """Publish an array of positions."""
        self._publisher.publish(message)

    def unready(self) -> Outcome | None:
        """Return which axis has no feedback yet: the array has a position of each axis."""
        for axis in self._axes.values():
            if not axis.readings.known:
                return Outcome(Error.FeedbackStale, f'axis {axis.name}: no feedback yet')
        return None

    def _held_position(self, axis: Axis) -> float:
        """Return the command that holds an axis where it is."""
        if not axis.powered:
            return axis.hold_position
        return self._held.setdefault(axis.name, axis.hold_position)


#: The class of each interface.
INTERFACES: Mapping[SetpointInterface, type[TrajectorySetpoints | PositionSetpoints]] = {
    SetpointInterface.trajectory: TrajectorySetpoints,
    SetpointInterface.position: PositionSetpoints,
}
