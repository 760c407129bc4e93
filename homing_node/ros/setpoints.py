# SPDX-License-Identifier: Apache-2.0
"""How setpoints leave the node: one class for each value of `setpoint_interface`.

A new interface is one more class here, its name in `SetpointInterface`
(parameters/configuration.py) and a line in `INTERFACES`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from ..core.announcement import Announcer, least_horizon
from ..core.axis import Axis, Setpoint
from ..core.outcome import Outcome
from ..core.position_array import OtherJoint, PositionArray
from ..parameters.configuration import Configuration
from ..parameters.definition import InvalidParameters
from ..parameters.node_fields import SetpointInterface, SetpointStamp
from .serialized import PlainTrajectoryWriter, TrajectoryWriter
from .timebase import Stamps, TimeBase

try:
    from control_msgs.msg import MultiDOFCommand
except ImportError:  # only `dof` needs it
    MultiDOFCommand = None

#: (message type, topic) -> a publisher.
CreatePublisher = Callable[[Any, str], Any]


class Setpoints(Protocol):
    """Publishes the setpoints of the axes through one interface.

    The cycle calls `message` while the axes are locked and `publish` when they no longer are.

    Attributes:
        others: The joints that the messages command and no axis homes, by name; they need their
            feedback.
    """

    others: Mapping[str, OtherJoint]

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

    others: Mapping[str, OtherJoint] = {}

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
        period = 1.0 / checked.update_rate
        least = max(checked.setpoint_horizon, least_horizon(period, checked.lead))
        self._horizon = math.ceil(least / period - 1e-6) * period
        self._announcer = Announcer(period, self._horizon)
        self._stamped = checked.setpoint_stamp is SetpointStamp.due
        self._stamps = Stamps(timebase)
        self._returning: set[str] = set()  # in the last cycle
        self._writer = (TrajectoryWriter if checked.serialized else PlainTrajectoryWriter)()
        self._publisher = create_publisher(JointTrajectory, '~/setpoints')

    def message(self, moving: Mapping[str, Setpoint], due: float) -> Any:
        """Return a trajectory of the axes that move.

        One whose servo has gone off is told once how its command returns, and again with others:
        the controller stops a joint that a new message lacks.
        """
        returning = {name for name, axis in self._axes.items() if axis.returning}
        news, self._returning = returning - self._returning, returning
        if not (moving or news):
            return None
        names = [name for name in self._axes if name in moving or name in returning]
        courses = [self._axes[name].course(self._horizon) for name in names]
        times, rows = self._announcer.points(courses)
        first = stamp = 0
        if self._stamped:
            first = times[0]
            stamp = self._stamps.stamp_of(due) + first
            times = [time - first for time in times]
        return self._writer.write([self._joints[name] for name in names], stamp, times, rows)

    def publish(self, message: Any) -> None:
        """Publish a trajectory."""
        self._publisher.publish(message)

    def unready(self) -> Outcome | None:
        """Return None: a trajectory names only the axes that move."""
        return None


class PositionSetpoints:
    """`position`: one position for each joint of `position_joints`, on `~/position_commands`.

    Which position each joint gets stands in core/position_array.py.
    """

    topic = '~/position_commands'

    def __init__(
        self,
        axes: Mapping[str, Axis],
        checked: Configuration,
        timebase: TimeBase,
        create_publisher: CreatePublisher,
    ) -> None:
        """Create the publisher; the arguments are those of `TrajectorySetpoints`."""
        axis_of = {joint: axis for axis, joint in checked.joints.items()}
        self.array = PositionArray(axes, axis_of, checked.position_joints)
        self.others: Mapping[str, OtherJoint] = self.array.others
        self._timebase = timebase
        self._publisher = create_publisher(self._message_type(), self.topic)

    def message(self, moving: Mapping[str, Setpoint], due: float) -> Any:
        """Return the position of each joint while a run is on."""
        commands = self.array.commands(moving)
        return None if commands is None else self._message(commands)

    def hold(self, positions: Mapping[str, float]) -> Any:
        """Return the message that tells every joint to stay at a raw position."""
        return self._message([(positions[slot.joint], 0.0) for slot in self.array.slots])

    def publish(self, message: Any) -> None:
        """Publish positions."""
        self._publisher.publish(message)

    def unready(self) -> Outcome | None:
        """Return of which joint it is not known where it is: the message commands each one."""
        return self.array.unready(self._timebase.polled)

    def _message_type(self) -> Any:
        return Float64MultiArray

    def _message(self, commands: Sequence[tuple[float, float]]) -> Any:
        return Float64MultiArray(data=[float(position) for position, _ in commands])


def dof_command() -> Any:
    """Return the message type of `dof`.

    Raises:
        InvalidParameters: The package control_msgs is not installed.
    """
    if MultiDOFCommand is None:
        raise InvalidParameters(
            [
                'setpoint_interface: dof needs the package control_msgs, which is not installed '
                '(apt install ros-$ROS_DISTRO-control-msgs)'
            ]
        )
    return MultiDOFCommand


class DofSetpoints(PositionSetpoints):
    """`dof`: a position and a velocity for each joint of `position_joints`, on `~/dof_commands`.

    The names are in the message, but pid_controller (4.42) takes the values by their place.
    """

    topic = '~/dof_commands'

    def _message_type(self) -> Any:
        return dof_command()

    def _message(self, commands: Sequence[tuple[float, float]]) -> Any:
        positions, velocities = zip(*commands, strict=True)
        return MultiDOFCommand(
            dof_names=[slot.joint for slot in self.array.slots],
            values=list(map(float, positions)),
            values_dot=list(map(float, velocities)),
        )


#: The class of each interface.
INTERFACES: Mapping[SetpointInterface, type[TrajectorySetpoints | PositionSetpoints]] = {
    SetpointInterface.trajectory: TrajectorySetpoints,
    SetpointInterface.position: PositionSetpoints,
    SetpointInterface.dof: DofSetpoints,
}
