# SPDX-License-Identifier: Apache-2.0
"""Shows where the switches were found, and home, on `~/markers` for RViz.

The frame of an axis is `marker_frame`; a linear axis runs along its x, a rotary one turns about
its z, and both are at its origin where their raw position is 0.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from ..core.axis import Axis
from ..parameters.units import Unit
from ..procedures.states import LIMIT_SWITCHES, Input
from .messages import place, to_stamp

#: The size of a mark, as a part of the travel of a linear axis, and the radius on which the marks
#: of a rotary axis stand, m.
SIZE, RADIUS = 0.02, 0.1
HOME, LIMIT, SWITCH = (
    ColorRGBA(r=r, g=g, b=b, a=1.0)
    for r, g, b in ((0.0, 0.62, 0.45), (0.84, 0.37, 0.0), (0.0, 0.45, 0.70))
)


class Mark(NamedTuple):
    """A place to show: its raw position, what it is, and its colour."""

    position: float
    text: str
    colour: ColorRGBA


class Markers:
    """The markers of all axes.

    Attributes:
        frame: The parameter `marker_frame`.
    """

    def __init__(
        self,
        publisher: Any,
        axes: Mapping[str, Axis],
        joints: Mapping[str, str],
        frame: str,
        call: Callable[[Callable[[], object]], object],
    ) -> None:
        """Keep what is shown.

        Args:
            publisher: The publisher of a MarkerArray.
            axes: The axes, by name.
            joints: The joint of each axis.
            frame: The parameter `marker_frame`.
            call: Lets the executor call a function.
        """
        self._publisher, self._axes, self._joints = publisher, axes, joints
        self.frame, self._call = frame, call
        self._seen: dict[str, Any] = {}  # what the last run of each axis has seen
        self._found: dict[str, tuple[Mark, ...]] = {}
        self._shown: dict[str, object] = {}

    def state(self, axis: Axis, stamp: int) -> None:
        """Note a state that is published; show what has changed. The axes are locked."""
        if axis.machine is not None:
            self._seen[axis.name] = axis.machine.seen
            return
        seen = self._seen.pop(axis.name, None)
        if seen is not None:
            self._found[axis.name] = tuple(_switches(axis, seen))
        shown = axis.homed, axis.home_position_raw, self._found.get(axis.name)
        if self._shown.get(axis.name, (False, 0.0, None)) != shown:
            self._shown[axis.name] = shown
            self.show(stamp)

    def show(self, stamp: int) -> None:
        """Show everything, with a stamp in ns. The axes are locked."""
        message = MarkerArray(markers=[Marker(action=Marker.DELETEALL)])
        for name, axis in self._axes.items():
            marks = list(self._found.get(name, ()))
            if axis.homed:
                home = axis.home_position_raw
                known = place(home, axis.outcome.uncertainty)
                marks.append(Mark(home, f'{name}: home {known} {axis.parameters.unit}', HOME))
            frame = self.frame.replace('<axis>', name).replace('<joint>', self._joints[name])
            for mark in marks:
                message.markers += _markers(axis, mark, frame, stamp, len(message.markers))
        self._call(lambda: self._publisher.publish(message))


def _switches(axis: Axis, seen: Any) -> list[Mark]:
    """Return where the last run has met each switch, and each of its edges."""
    found: dict[tuple[Input, bool], Mark] = {}
    for edge in seen.edges:
        raw = axis.parameters.home_direction.sign * edge.position
        limit = edge.input in LIMIT_SWITCHES
        what = 'on' if edge.rises else 'off'
        text = f'{axis.name}: {Input(edge.input).text} {what}'
        found[edge.input, edge.rises] = Mark(raw, text, LIMIT if limit else SWITCH)
    return list(found.values())


def _markers(axis: Axis, mark: Mark, frame: str, stamp: int, number: int) -> list[Marker]:
    """Return a mark and its text."""
    rotary = axis.parameters.unit is Unit.rad
    size = SIZE * (RADIUS if rotary else axis.parameters.travel)
    if rotary:
        turned = RADIUS * math.cos(mark.position), RADIUS * math.sin(mark.position)
        where = Point(x=turned[0], y=turned[1])
    else:
        where = Point(x=float(mark.position))
    made = []
    for offset, kind in enumerate((Marker.SPHERE, Marker.TEXT_VIEW_FACING)):
        one = Marker(ns=axis.name, id=number + offset, type=kind, color=mark.colour)
        one.header.frame_id = frame
        one.header.stamp = to_stamp(stamp)
        one.pose.orientation.w = 1.0
        one.pose.position = Point(x=where.x, y=where.y, z=where.z + 2.0 * offset * size)
        one.scale.x = one.scale.y = one.scale.z = float(size)
        one.text = mark.text if offset else ''
        made.append(one)
    return made
