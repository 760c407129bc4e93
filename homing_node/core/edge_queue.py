# SPDX-License-Identifier: Apache-2.0
"""Edges that wait until the feedback shows where they were and which way the axis traveled."""

from typing import Protocol

from ..parameters.axis import AxisParameters
from ..procedures.motions import Way
from ..procedures.procedure import Row
from ..procedures.states import LATCHES
from .signals import Edge
from .track import Track


class TakesEdges(Protocol):
    """A run that takes the edges: the machine, or one side of a gantry."""

    @property
    def row(self) -> Row:
        """The present row."""

    def way_at(self, time: float, track: Track) -> int | None:
        """Return the sign of the travel at a time that the track covers, None: not yet known."""

    def edge(self, edge: Edge) -> None:
        """Take an edge whose way of travel is known."""


class EdgeQueue:
    """The edges of a run between their message and the machine, in the order of their times.

    The message of an edge is often newer than the newest feedback sample, so that the place of the
    edge is not known yet. Such an edge waits here. An edge that happened while the axis plainly
    goes toward does not wait: the machine gets it with an extrapolated position, which is located
    again until the feedback has passed it.

    With ``open_loop_homing`` an edge is located on the commands instead of the feedback. But a
    latched position is one of the feedback, and so is then the edge that arms it.
    """

    def __init__(self, parameters: AxisParameters) -> None:
        latched = parameters.procedure.inputs.intersection(LATCHES)
        self._on_command = parameters.open_loop_homing and not latched
        self._commands = Track()
        self._waiting: list[Edge] = []  # the machine has not got them yet
        self._unresolved: list[Edge] = []  # it has, but the position is still extrapolated

    def command(self, time: float, position: float) -> None:
        """Record a command, if edges are located on the commands.

        Args:
            time: when the axis shall be there, s.
            position: the position, m or rad.
        """
        if self._on_command:
            self._commands.append(time, position)

    def clear(self) -> None:
        """Drop all edges."""
        self._waiting.clear()
        self._unresolved.clear()

    def add(self, edge: Edge) -> None:
        """Queue an edge by its time; a limit comes before another switch."""
        self._waiting.append(edge)
        self._waiting.sort(key=lambda waiting: waiting.order)

    def update(self, machine: TakesEdges, feedback: Track) -> None:
        """Locate the edges, and give the machine those whose way of travel is known."""
        track, beside = (self._commands, feedback) if self._on_command else (feedback, None)
        if self._unresolved:
            for edge in self._unresolved:
                edge.locate(track, beside)
            self._unresolved = [edge for edge in self._unresolved if not edge.resolved]
        while self._waiting:
            edge = self._waiting[0]
            located = edge.locate(track, beside)
            wanted = machine.row.motion.way
            way = machine.way_at(min(edge.time, track.time), track)
            if way is None:
                return
            if edge.opening.gap and way != wanted:  # it may have turned within the gap
                later = machine.way_at(min(edge.opening.end, track.time), track)
                way = later if later == wanted else way
            goes_toward = way == wanted == Way.TOWARD
            if not located and not goes_toward:
                return
            if not edge.resolved:
                self._unresolved.append(edge)
            edge.way = way
            del self._waiting[0]
            machine.edge(edge)
