# SPDX-License-Identifier: Apache-2.0
"""What is noted of an axis in each cycle of a run, in memory and bounded.

The cycle appends, somebody else takes what has come together. Times are those of the core, in s;
positions are raw, m or rad.
"""

from math import nan
from typing import Any, NamedTuple

from ..core.axis import Axis, Setpoint
from ..core.signals import Edge
from ..procedures.states import Input

#: Seconds of cycles, and how many messages of inputs, that wait at most to be taken.
LONGEST_WAIT, MOST_WAITING = 20.0, 20_000
#: The setpoint of a cycle in which the axis is not told to move.
NO_SETPOINT = nan, nan, nan


class Row(NamedTuple):
    """One cycle: its time, the setpoint (NaN: none), and the newest feedback with its time."""

    now: float
    position: float
    velocity: float
    acceleration: float
    sampled: float
    feedback: float


class Reading(NamedTuple):
    """A message of an input: when it arrived, and its level on the wire or its latched place."""

    now: float
    source: Input
    value: bool | float


class Found(NamedTuple):
    """An edge or a latch as the run has found it; see SwitchEdge.msg."""

    time: float
    source: Input
    level: bool
    position: float
    uncertainty: float
    velocity: float


class Taken(NamedTuple):
    """What has come together since the last time.

    Attributes:
        rows: The cycles; the fields of `Row` each.
        readings: The messages of the inputs.
        found: The edges whose place is known.
        states: The states, as they were published, each with its stamp in ns.
        ended: Whether nothing will come any more.
    """

    rows: list[tuple[float, ...]]
    readings: list[Reading]
    found: list[Found]
    states: list[tuple[int, Any]]
    ended: bool


class Tap:
    """What is noted of one run.

    Attributes:
        axis: The axis.
        runs: How many runs of the axis had ended when it began.
        begun: When it began, s.
        ended: How it ended, '' while it goes on.
        lost: How many cycles and messages are missing because nobody took them.
    """

    def __init__(self, axis: Axis, now: float, runs: int) -> None:
        """Begin with a run that has begun.

        Args:
            axis: The axis.
            now: The time, s.
            runs: How many runs of the axis had ended before.
        """
        self.axis, self.begun, self.ended, self.lost = axis, now, '', 0
        self.runs = runs
        self._sign = axis.parameters.home_direction.sign
        self._most = int(LONGEST_WAIT / axis.period)
        self._rows: list[tuple[float, ...]] = []
        self._readings: list[Reading] = []
        self._states: list[tuple[int, Any]] = []
        self._seen = None if axis.machine is None else axis.machine.seen
        self._edges = self._latches = 0  # how many of both were taken
        self._heard = [(switch, -1e300) for switch in axis.readings.switches.values()]
        self._servo: bool | None = None

    def cycle(self, now: float, setpoint: Setpoint | None) -> None:
        """Note a cycle; the axis is locked."""
        axis = self.axis
        readings, rows = axis.readings, self._rows
        if len(rows) < self._most:
            track = readings.track
            command = NO_SETPOINT if setpoint is None else setpoint
            rows.append((now, *command, track.time, self._sign * track.position))
        else:
            self.lost += 1
        for number, (switch, heard) in enumerate(self._heard):
            if switch.seen != heard:
                self._heard[number] = switch, switch.seen
                if switch.signal is not None:
                    self._read(max(switch.seen, self.begun), switch.input, switch.signal)
        if readings.servo_enabled is not self._servo:
            self._servo = readings.servo_enabled
            if self._servo is not None:
                self._read(now, Input.SERVO_ENABLED, self._servo)
        if self._seen is not None and len(self._seen.latches) != self._latches:
            for one in self._seen.latches[self._latches :]:
                self._read(now, one.input, self._sign * one.position)
            self._latches = len(self._seen.latches)

    def state(self, stamp: int, message: Any) -> None:
        """Note a state that is published; the axis is locked."""
        if len(self._states) < MOST_WAITING:
            self._states.append((stamp, message))

    def end(self, ended: str) -> None:
        """Note how the run ended; nothing is noted any more."""
        self.ended = ended

    def take(self) -> Taken:
        """Return what has come together; the axis is locked."""
        taken = Taken(self._rows, self._readings, self._found(), self._states, bool(self.ended))
        self._rows, self._readings, self._states = [], [], []
        return taken

    def _read(self, now: float, source: Input, value: bool | float) -> None:
        if len(self._readings) < MOST_WAITING:
            self._readings.append(Reading(now, source, value))
        else:
            self.lost += 1

    def _found(self) -> list[Found]:
        """Return the edges whose place is known now, in their order; at the end all that are left.

        An edge whose place may still change holds up those behind it.
        """
        edges: list[Edge] = [] if self._seen is None else self._seen.edges[self._edges :]
        found: list[Found] = []
        for edge in edges:
            if not (edge.resolved or self.ended):
                break
            found.append(
                Found(
                    edge.time,
                    edge.input,
                    edge.rises,
                    self._sign * edge.position,
                    edge.uncertainty,
                    self._sign * edge.way * edge.speed,
                )
            )
        self._edges += len(found)
        return found
