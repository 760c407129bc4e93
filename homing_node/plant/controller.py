# SPDX-License-Identifier: Apache-2.0
"""Models of the two controllers of ros2_controllers that a stream of setpoints is played by.

Written from their sources: joint_trajectory_controller 4.42.1 (Jazzy; ``trajectory.cpp``,
``joint_trajectory_controller.cpp``) and forward_command_controller 4.42.1. They have position
command interfaces. Without a clock: time is passed in, as ns of the clock that stamps are of.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import isfinite, isnan, nan
from typing import NamedTuple

NS = 1_000_000_000
#: The velocity that passes for none at the end of a trajectory (FLT_EPSILON).
NO_VELOCITY = 1.1920929e-07

Values = tuple[float, ...]


class Point(NamedTuple):
    """A point of a trajectory: its time from the start in ns, and a value for each joint.

    Velocities and accelerations may be missing.
    """

    time: int
    positions: Values
    velocities: Values = ()
    accelerations: Values = ()


class Message(NamedTuple):
    """A ``trajectory_msgs/JointTrajectory``; the stamp is in ns, 0: start at once."""

    stamp: int
    joints: tuple[str, ...]
    points: tuple[Point, ...]


class JtcParameters(NamedTuple):
    """The parameters of joint_trajectory_controller that matter here, with its defaults.

    ``tolerance`` is ``constraints.<joint>.trajectory``, 0: none.
    """

    allow_partial_joints_goal: bool = False
    allow_nonzero_velocity_at_trajectory_end: bool = False
    interpolate_from_desired_state: bool = False
    set_last_command_interface_value_as_state_on_activation: bool = True
    interpolation_method: str = 'splines'
    tolerance: float = 0.0


#: What README asks for.
RECOMMENDED = JtcParameters(allow_partial_joints_goal=True, interpolate_from_desired_state=True)


class TrajectoryController:
    """joint_trajectory_controller, as it samples what it is told.

    ``command`` is the point that its last update commanded (for a period later), ``refused`` why
    it refused the last message that it refused.
    """

    def __init__(
        self, joints: Sequence[str], rate: float, parameters: JtcParameters = RECOMMENDED
    ) -> None:
        self.joints = tuple(joints)
        self.parameters = parameters
        self.period = round(NS / rate)
        self.active = False
        self.refused = ''
        self.command = Point(0, (nan,) * len(self.joints))
        self._new: Message | None = None
        self._trajectory: Message | None = None
        self._start = 0  # when the trajectory starts, ns; 0: at its first sample
        self._sampled = False
        self._holding = True
        self._anchor = 0, self.command  # the time and the state before the trajectory
        self._last_commanded = 0, self.command

    # ------------------------------------------------------------------------- lifecycle, topic

    def activate(self, feedback: Sequence[float]) -> None:
        """Become active: hold the last command, or the state where there is none."""
        positions = tuple(feedback)
        wanted = self.parameters.set_last_command_interface_value_as_state_on_activation
        if wanted and not any(map(isnan, self.command.positions)):
            positions = self.command.positions
        self.active = True
        self._last_commanded = 0, _at_rest(positions)
        self._trajectory = None
        self._hold(positions)

    def deactivate(self) -> None:
        """Become inactive: the hardware keeps the last command."""
        self.active = False
        self._trajectory = self._new = None

    def unload(self) -> None:
        """Forget everything; the hardware's command interfaces lose their values too."""
        self.deactivate()
        self.command = Point(0, (nan,) * len(self.joints))

    def receive(self, message: Message, now: int) -> bool:
        """Take a message from the topic; return whether it is taken."""
        self.refused = self._refusal(message, now) or ('' if self.active else 'not active')
        if self.refused:
            return False
        self._new, self._holding = message, False
        return True

    def _refusal(self, message: Message, now: int) -> str:
        """Return why a message is refused (``validate_trajectory_msg``)."""
        p, points, count = self.parameters, message.points, len(message.joints)
        if not p.allow_partial_joints_goal and count != len(self.joints):
            return "joints don't match the controller joints"
        if not message.joints or not points:
            return 'empty'
        if not set(message.joints) <= set(self.joints):
            return 'unknown joint'
        if not p.allow_nonzero_velocity_at_trajectory_end and any(
            abs(velocity) > NO_VELOCITY for velocity in points[-1].velocities
        ):
            return 'velocity of the last point is not zero'
        if message.stamp and message.stamp + points[-1].time < now:
            return 'ends in the past'
        if any(later.time <= earlier.time for earlier, later in pairwise(points)):
            return 'time is not strictly increasing'
        sizes = (count,), (0, count), (0, count)
        if any(
            len(values) not in allowed
            for point in points
            for values, allowed in zip(point[1:], sizes, strict=True)
        ):
            return 'mismatch between joint_names and a field'
        return ''

    # ----------------------------------------------------------------------------------- update

    def update(self, now: int, feedback: Sequence[float]) -> Point | None:
        """Run one update; return the command, None where it commands nothing (anew)."""
        if not self.active:
            return None
        if self._new is not None:
            self._trajectory, self._new = self._completed(self._new), None
            self._start, self._sampled = self._trajectory.stamp, False
        assert self._trajectory is not None
        first = not self._sampled
        if first:
            anchor = now, _at_rest(tuple(feedback))
            if self.parameters.interpolate_from_desired_state:
                time, state = self._last_commanded
                anchor = time or now, state
            self._anchor = anchor
            self._start = self._start or now
            self._sampled = True
        desired = self._sample(now)
        command = self._sample(now + self.period)
        if command is None:
            return None
        before_end = now + self.period < self._start + self._trajectory.points[-1].time
        limit = self.parameters.tolerance
        if (
            limit
            and (before_end or first)
            and not self._holding
            and desired is not None
            and any(abs(d - f) > limit for d, f in zip(desired.positions, feedback, strict=True))
        ):
            self._hold(tuple(feedback))
            return None
        self.command = command
        self._last_commanded = now, command  # the state is of a period later
        return command

    def _hold(self, positions: Values) -> None:
        self._new = Message(0, self.joints, (Point(0, positions),))
        self._holding = True

    def _completed(self, message: Message) -> Message:
        """Bring a message into our order of joints; joints that it lacks hold their command."""
        place = {joint: i for i, joint in enumerate(message.joints)}
        held = self.command.positions

        def ordered(values: Values, missing: Values) -> Values:
            return values and tuple(
                values[place[joint]] if joint in place else missing[i]
                for i, joint in enumerate(self.joints)
            )

        zero = (0.0,) * len(self.joints)
        return message._replace(
            joints=self.joints,
            points=tuple(
                Point(p.time, ordered(p[1], held), ordered(p[2], zero), ordered(p[3], zero))
                for p in message.points
            ),
        )

    def _sample(self, time: int) -> Point | None:
        """Return the state of the trajectory at a time (``Trajectory::sample``)."""
        assert self._trajectory is not None
        points, joined = self._trajectory.points, self.parameters.interpolation_method != 'none'
        before, state = self._anchor
        if time < before:
            return None
        start = self._start
        first = start + points[0].time
        if time < first:
            if not joined:
                return state
            state = _with_derivatives(state, points[0])
            return between(before, state, first, points[0], time)
        for one, other in pairwise(points):
            begin, end = start + one.time, start + other.time
            if begin <= time < end:
                return between(begin, one, end, other, time) if joined else other
        return _with_derivatives(points[-1], _at_rest(points[-1].positions))


class ForwardController:
    """forward_command_controller with a position interface: a staircase.

    ``command`` is what the hardware has, a value for each joint, NaN: none yet.
    """

    def __init__(self, joints: Sequence[str], rate: float) -> None:
        self.joints = tuple(joints)
        self.period = round(NS / rate)
        self.active = False
        self.command: Values = (nan,) * len(self.joints)
        self._told: Values = ()

    def activate(self) -> None:
        """Become active; what came before is forgotten."""
        self.active, self._told = True, ()

    def deactivate(self) -> None:
        self.active, self._told = False, ()

    def receive(self, data: Sequence[float]) -> bool:
        """Take a message from the topic; one with a value that is not finite is dropped."""
        if not all(map(isfinite, data)):
            return False
        self._told = tuple(data)
        return True

    def update(self) -> Values | None:
        """Run one update; an array of a wrong length deactivates the controller."""
        if not self.active:
            return None
        if self._told:
            if len(self._told) != len(self.joints):
                self.deactivate()
                return None
            self.command = self._told
        return self.command


def between(begin: int, one: Point, end: int, other: Point, time: int) -> Point:
    """Join two points by a line, a cubic or a quintic (``interpolate_between_points``)."""
    t, total = (time - begin) / NS, (end - begin) / NS
    velocity = bool(one.velocities and other.velocities)
    acceleration = bool(one.accelerations and other.accelerations)
    if t < 0.0 or t > total:
        t = min(max(t, 0.0), total)
        velocity = acceleration = False
    columns = []
    for i, (p0, p1) in enumerate(zip(one.positions, other.positions, strict=True)):
        c = [p0, 0.0, 0.0, 0.0, 0.0, 0.0]
        if not velocity:
            c[1] = (p1 - p0) / total if total else 0.0
        elif not acceleration:
            v0, v1 = one.velocities[i], other.velocities[i]
            c[1] = v0
            if total:
                c[2] = (3.0 * (p1 - p0) - (2.0 * v0 + v1) * total) / total**2
                c[3] = (-2.0 * (p1 - p0) + (v0 + v1) * total) / total**3
        else:
            v0, v1 = one.velocities[i], other.velocities[i]
            a0, a1 = one.accelerations[i], other.accelerations[i]
            c[1], c[2] = v0, 0.5 * a0
            if total:
                d, v = p1 - p0, total
                c[3] = (20.0 * d - (3.0 * a0 - a1) * v**2 - (12.0 * v0 + 8.0 * v1) * v) / (
                    2.0 * v**3
                )
                c[4] = (-30.0 * d + (3.0 * a0 - 2.0 * a1) * v**2 + (16.0 * v0 + 14.0 * v1) * v) / (
                    2.0 * v**4
                )
                c[5] = (12.0 * d - (a0 - a1) * v**2 - 6.0 * (v0 + v1) * v) / (2.0 * v**5)
        columns.append(
            (
                c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5])))),
                c[1] + t * (2 * c[2] + t * (3 * c[3] + t * (4 * c[4] + t * 5 * c[5]))),
                2 * c[2] + t * (6 * c[3] + t * (12 * c[4] + t * 20 * c[5])),
            )
        )
    positions, velocities, accelerations = zip(*columns, strict=True)
    return Point(0, positions, velocities, accelerations)


def _at_rest(positions: Values) -> Point:
    zero = (0.0,) * len(positions)
    return Point(0, positions, zero, zero)


def _with_derivatives(point: Point, like: Point) -> Point:
    """Fill in velocities and accelerations of 0 where another point has them."""
    zero = (0.0,) * len(point.positions)
    return point._replace(
        velocities=point.velocities or (like.velocities and zero),
        accelerations=point.accelerations or (like.accelerations and zero),
    )


def message_of(
    stamp: int,
    joints: Sequence[str],
    times: Sequence[int],
    rows: Sequence[Sequence[Sequence[float]]],
) -> Message:
    """Make a message of points.

    Args:
        stamp: When the trajectory starts, ns; 0: when it is received.
        joints: The names.
        times: The time of each point from the start, ns.
        rows: The positions, the velocities and the accelerations of the joints at each point.
    """
    points = [Point(time, *map(tuple, row)) for time, row in zip(times, rows, strict=True)]
    return Message(stamp, tuple(joints), tuple(points))
