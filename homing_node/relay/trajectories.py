# SPDX-License-Identifier: Apache-2.0
"""Trajectories in homed coordinates: judged, and shifted to raw ones.

The messages are `trajectory_msgs/JointTrajectory` or look like it. Velocities, accelerations,
efforts, times and tolerances are the same in both coordinates; positions are not.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ..parameters.definition import Interval
from .known_home import KnownHome
from .soft_limits import Knot, beyond


def refusal(trajectory: Any, axes: Mapping[str, KnownHome]) -> str:
    """Return why a trajectory must not be played, '' if it may.

    Args:
        trajectory: The message, in homed coordinates.
        axes: The axes of the relay, by joint; other joints are not judged.
    """
    names = list(trajectory.joint_names)
    for place, name in enumerate(names):
        axis = axes.get(name)
        if axis is None:
            continue
        if axis.refusal:
            return axis.refusal
        why = _misfit(trajectory.points, len(names)) or _outside(trajectory.points, place, axis)
        if why:
            return f'axis {axis.name}: {why}'
    return ''


def _outside(points: Sequence[Any], place: int, axis: KnownHome) -> str:
    """Return why the course of one axis is not within its soft limits, '' if it is."""
    knots = []
    for number, point in enumerate(points):
        if place >= len(point.positions):
            return f'point {number} has no position for joint {axis.joint}'
        knot = Knot(
            point.time_from_start.sec + point.time_from_start.nanosec * 1e-9,
            point.positions[place],
            _at(point.velocities, place),
            _at(point.accelerations, place),
        )
        if not all(map(math.isfinite, (one for one in knot if one is not None))):
            return f'point {number}: a value of joint {axis.joint} is not finite'
        knots.append(knot)
    limits = axis.parameters.soft_limits
    if limits is None or not knots:
        return ''
    found = beyond(knots, limits)
    if found is None:
        found = _beyond_at_start(knots[0], limits, axis)
    if found is None:
        return ''
    unit = axis.parameters.unit
    return (
        f'it would go to {found:.6g} {unit}, beyond its soft limits {limits.low:g} to '
        f'{limits.high:g} {unit} (travel_min, travel_max)'
    )


def _beyond_at_start(first: Knot, limits: Interval, axis: KnownHome) -> float | None:
    """Return a position beyond the limits on the way to the first point, None if there is none.

    The controller begins where the axis is, and, if it knows the velocity, as fast as the axis is.
    An axis that is beyond a limit may lead back.
    """
    here = axis.position
    if here is None or first.time <= 0.0:
        return None
    wide = Interval(min(limits.low, here), max(limits.high, here))
    for velocity in {0.0, axis.velocity}:
        for acceleration in (0.0, None):
            found = beyond([Knot(0.0, here, velocity, acceleration), first], wide)
            if found is not None:
                return found
    return None


def _misfit(points: Sequence[Any], joints: int) -> str:
    """Return which point has more positions than there are joints, '' if none has."""
    for number, point in enumerate(points):
        if len(point.positions) > joints:
            return f'point {number} has {len(point.positions)} positions for {joints} joints'
    return ''


def _at(values: Sequence[float], place: int) -> float | None:
    return values[place] if place < len(values) else None


def to_raw(trajectory: Any, axes: Mapping[str, KnownHome]) -> str:
    """Shift the positions of a trajectory from homed to raw coordinates, if it may be played.

    It is judged and shifted in one step, with the axes locked: a home that were lost in between
    would leave homed positions that pass for raw ones.

    Args:
        trajectory: The message, in homed coordinates; raw ones afterwards.
        axes: The axes of the relay, by joint; other joints are neither judged nor shifted.

    Returns:
        Why the trajectory must not be played, and is not shifted; '' if it may.
    """
    why = refusal(trajectory, axes)
    offsets = offsets_of(trajectory.joint_names, axes)
    if why or offsets is None:
        return why or 'an axis is not homed'
    for point in trajectory.points:
        _shift(point, [-offset for offset in offsets])
    return ''


def to_homed(points: Sequence[Any], names: Sequence[str], axes: Mapping[str, KnownHome]) -> bool:
    """Shift points from raw to homed coordinates; return whether every home is known for that."""
    offsets = offsets_of(names, axes)
    if offsets is None:
        return False
    for point in points:
        _shift(point, offsets)
    return True


def offsets_of(names: Sequence[str], axes: Mapping[str, KnownHome]) -> list[float] | None:
    """Return raw minus homed position of each joint, None if the home of one is not known.

    A joint that is no axis of the relay has the offset 0.
    """
    offsets = [axes[name].offset if name in axes else 0.0 for name in names]
    known = [offset for offset in offsets if offset is not None]
    return known if len(known) == len(offsets) else None


def _shift(point: Any, offsets: Sequence[float]) -> None:
    """Take an offset off each position; a joint without one keeps its position to the last bit."""
    if point.positions:
        point.positions = [
            position - offset if offset else position
            for position, offset in zip(point.positions, offsets, strict=False)
        ]
