# SPDX-License-Identifier: Apache-2.0
"""What is noted of an axis in a run, and of its followers, in memory and bounded.

The cycle does as little as it can: it notes its time and the setpoints of all drives together
(cycles.py), and looks whether a switch has a new message. The feedback is taken from the track, of
one drive in each cycle. Somebody else takes what has come together. Times are those of the core,
in s; positions are raw, m or rad.
"""

from array import array
from math import inf
from typing import NamedTuple, Protocol

from ..core.axis import Axis
from ..core.readings import Readings
from ..core.remembered import Seen
from ..core.signals import Edge, Switch
from ..core.track import Sample
from ..parameters.axis import AxisParameters
from ..procedures.states import LATCHES, Input
from .cycles import Cycles

#: Seconds of cycles, and how many messages of inputs, that wait at most to be taken.
LONGEST_WAIT, MOST_WAITING = 20.0, 20_000
#: A reading that is closer behind another than this part of a cycle is left out.
CLOSEST = 0.75


class State(Protocol):
    """A state that is published."""

    def serialized(self) -> bytes:
        """Return its bytes, which may have been made already."""


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


class DriveTaken(NamedTuple):
    """What has come together of a drive since the last time.

    Attributes:
        name: The axis, or the full name of a follower.
        feedback: Times and positions of the new readings of the track, in its own frame.
        sign: What makes them raw.
        readings: The messages of the inputs.
        found: The edges whose place is known.
    """

    name: str
    feedback: 'array[float]'
    sign: float
    readings: list[Reading]
    found: list[Found]


class Taken(NamedTuple):
    """What has come together of a run since the last time.

    Attributes:
        cycles: The cycles of the node in the run, packed.
        drives: What has come of each drive: of the axis, and then of its followers.
        states: The states as they are published, each with its stamp in ns.
        ended: Whether nothing will come any more.
    """

    cycles: list[Cycles]
    drives: list[DriveTaken]
    states: list[tuple[int, State]]
    ended: bool


class Drive(Protocol):
    """A drive of an axis: the axis itself, or a follower."""

    parameters: AxisParameters
    readings: Readings


class Watched:
    """A switch of a drive, and when its newest message came that was noted."""

    __slots__ = ('switch', 'tap', 'seen')

    def __init__(self, tap: 'DriveTap', switch: Switch) -> None:
        self.tap, self.switch, self.seen = tap, switch, -1e300


class DriveTap:
    """What is noted of one drive in a run.

    Attributes:
        name: The axis, or the full name of a follower.
        switches: Its switches, with what was noted of each.
        looks: Whether `look` may find anything.
    """

    def __init__(self, tap: 'Tap', name: str, drive: Drive, seen: Seen | None) -> None:
        """Begin.

        Args:
            tap: The run.
            name: The axis, or the full name of a follower.
            drive: The drive.
            seen: The edges and latches of the drive in the run.
        """
        self.name, self._tap, self._drive, self._seen = name, tap, drive, seen
        self._sign = drive.parameters.home_direction.sign
        readings, inputs = drive.readings, set(drive.parameters.inputs)
        self._samples = readings.track.samples
        self._period = CLOSEST * tap.axis.period
        self._feedback = array('d')
        self._gathered = -inf
        if self._samples:
            self._gathered = self._samples[-1][0]
            self._feedback.extend(self._samples[-1])
        self._readings: list[Reading] = []
        self._edges = self._latches = 0  # how many of both were taken
        self.switches = [Watched(self, switch) for switch in readings.switches.values()]
        self.looks = Input.SERVO_ENABLED in inputs or not inputs.isdisjoint(LATCHES)
        self._servo: bool | None = None

    def look(self, now: float) -> None:
        """Note what the servo tells and what was latched; the axis is locked."""
        servo = self._drive.readings.servo_enabled
        if servo is not self._servo:
            self._servo = servo
            if servo is not None:
                self._read(now, Input.SERVO_ENABLED, servo)
        if self._seen is not None and len(self._seen.latches) != self._latches:
            for one in self._seen.latches[self._latches :]:
                self._read(now, one.input, self._sign * one.position)
            self._latches = len(self._seen.latches)

    def gather(self) -> None:
        """Note new readings of the track, about one a cycle; the axis is locked."""
        due = self._gathered + self._period
        for time, position in reversed(self._since(due)):
            if time >= due:
                self._gathered, due = time, time + self._period
                if len(self._feedback) < 2 * MOST_WAITING:
                    self._feedback.extend((time, position))
                else:
                    self._tap.lost += 1

    def _since(self, due: float) -> list[Sample]:
        """Return the readings from a time on, the newest first."""
        found = []
        for one in reversed(self._samples):
            if one[0] < due:
                break
            found.append(one)
        return found

    def heard(self, switch: Switch) -> None:
        """Note a message of a switch; the axis is locked."""
        if switch.signal is not None:
            self._read(max(switch.seen, self._tap.begun), switch.input, switch.signal)

    def take(self, ended: bool) -> DriveTaken:
        """Return what has come together; the axis is locked."""
        taken = DriveTaken(
            self.name, self._feedback, self._sign, self._readings, self._found(ended)
        )
        self._feedback, self._readings = array('d'), []
        return taken

    def _read(self, now: float, source: Input, value: bool | float) -> None:
        if len(self._readings) < MOST_WAITING:
            self._readings.append(Reading(now, source, value))
        else:
            self._tap.lost += 1

    def _found(self, ended: bool) -> list[Found]:
        """Return the edges whose place is known now, in their order; at the end all that are left.

        An edge whose place may still change holds up those behind it.
        """
        edges: list[Edge] = [] if self._seen is None else self._seen.edges[self._edges :]
        found: list[Found] = []
        for edge in edges:
            if not (edge.resolved or ended):
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


class Tap:
    """What is noted of one run.

    Attributes:
        axis: The axis.
        runs: How many runs of the axis had ended when it began.
        begun: When it began, s.
        ended: How it ended, '' while it goes on.
        lost: How many cycles and messages are missing because nobody took them.
        drives: What is noted of the axis's own drive, and then of each follower's.
        cycles: The cycles of the node in the run, those that are noted now last.
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
        self.cycles: list[Cycles] = []
        self._states: list[tuple[int, State]] = []
        seen = axis.seen_by_drive
        self.drives = [
            DriveTap(self, name, drive, seen.get(name)) for name, drive in axis.drives.items()
        ]

    def state(self, stamp: int, state: State) -> None:
        """Note a state that is published; the axis is locked."""
        if len(self._states) < MOST_WAITING:
            self._states.append((stamp, state))

    def end(self, ended: str) -> None:
        """Note how the run ended; nothing is noted any more."""
        for drive in self.drives:
            drive.gather()
        self.ended = ended

    def take(self) -> Taken:
        """Return what has come together; the axis is locked, and new cycles are begun."""
        ended = bool(self.ended)
        taken = Taken(
            self.cycles, [drive.take(ended) for drive in self.drives], self._states, ended
        )
        self.cycles, self._states = [], []
        return taken
