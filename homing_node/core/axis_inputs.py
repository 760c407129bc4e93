# SPDX-License-Identifier: Apache-2.0
"""What an axis receives: feedback, levels of switches, latched positions.

The run in progress gets each of them: a limit at once, an edge with its place once the feedback
shows where it was.
"""

import math
from collections.abc import Iterable

from ..parameters.axis import AxisParameters
from ..procedures.states import LIMIT_SWITCHES, Input
from .axis_home import AxisHome
from .edge_queue import EdgeQueue
from .signals import Edge


class AxisInputs(AxisHome):
    """An axis that receives messages; positions are raw, times in s of one monotonic clock."""

    def __init__(self, name: str, parameters: AxisParameters) -> None:
        super().__init__(name, parameters)
        self._edges = EdgeQueue(parameters)

    def feedback(
        self, time: float, position: float, arrival: float | None = None, doubt: float = 0.0
    ) -> None:
        """Record a feedback sample.

        Args:
            time: when it was sampled, s.
            position: the raw position, m or rad.
            arrival: when its message arrived, s; by default ``time``.
            doubt: how far ``time`` may be wrong, s; 0 if it is a stamp that is trusted.
        """
        arrival = time if arrival is None else arrival
        homing, track = self.machine is not None, self.readings.track
        before = track.time
        failure = self.readings.feedback(time, position, arrival, doubt, homing)
        if failure is not None and self.machine is not None:
            self.machine.fail(failure)
        if track.time != before:
            self._watch_home(time)

    def switch(
        self,
        switch: Input,
        time: float,
        signal: bool,
        arrival: float | None = None,
        doubt: float = 0.0,
    ) -> None:
        """Record the level of a switch; a switch that is not wired is ignored.

        Args:
            switch: which one.
            time: when the level was read, s.
            signal: the level as it is on the wire, before the polarity is applied.
            arrival: when its message arrived, s; by default ``time``.
            doubt: how far ``time`` may be wrong, s; 0 if it is a stamp that is trusted.
        """
        arrival = time if arrival is None else arrival
        edge = self.readings.switch(switch, time, signal, arrival, doubt)
        if edge is not None:
            self._take(edge)

    def repeat(
        self, switches: Iterable[Input], time: float, arrival: float, doubt: float = 0.0
    ) -> None:
        """Record that some switches have the levels of their last messages.

        The arguments are those of :meth:`switch`.
        """
        for edge in self.readings.repeat(switches, time, arrival, doubt):
            self._take(edge)

    def latch(self, source: Input, position: float) -> None:
        """Record a latched raw position; one that is not finite or not wired is ignored."""
        wired = source in self.parameters.inputs
        if self.machine is not None and wired and math.isfinite(position):
            self.machine.latch(source, self._sign * self.readings.unwrapped(position))

    def _take(self, edge: Edge) -> None:
        """Queue an edge for the machine; act on a limit at once."""
        machine = self.machine
        if machine is None:
            if edge.rises:
                self.readings.series.rose_without_run(edge.input)
            return
        if edge.input in LIMIT_SWITCHES:
            if edge.rises:
                machine.limit_rises(edge.input)
            else:
                machine.limit_falls(edge.input)
        self._edges.add(edge)
