# SPDX-License-Identifier: Apache-2.0
"""What is published of an axis, read from its inputs, its run and its last outcome."""

from ..parameters.axis import AxisParameters
from ..procedures.states import Error, State
from .handover import Handover
from .history import History
from .machine import Machine
from .outcome import MemberHome, Outcome
from .readings import Readings
from .travel import LATEST


class AxisStatus:
    """The state of an axis, as others may read it.

    Attributes:
        name: its name.
        parameters: its parameters.
        readings: what it has received.
        machine: the run in progress, None between runs.
        handover: how the home that was found is handed over, None while none is.
        hands_over: whether somebody answers what a hand-over asks; without, there is none.
        applied: what the driver takes off its own coordinates since a hand-over, m or rad.
        outcome: how the last run ended, or why the home was lost.
        history: the runs so far.
        homed: whether the axis knows its home.
        home_source: where the home comes from, as long as the axis is homed: a `run`, `restored`
            from before a restart, or restored and then `verified`.
        notes: what the memory has to say of the axis, for the diagnostics.
        temperature: the newest one, °C; None where it is not known.
        servo_on: whether this node wants the servo on.
        emergency_stop: whether the emergency stop is on.
    """

    def __init__(self, name: str, parameters: AxisParameters) -> None:
        self.name = name
        self.parameters = parameters
        self.readings = Readings(parameters)
        self.machine: Machine | None = None
        self.handover: Handover | None = None
        self.hands_over = False
        self.applied = 0.0
        self.outcome = Outcome(Error.NoError)
        self.history = History()
        self.homed = False
        self.home_source = 'run'
        self.notes: tuple[str, ...] = ()
        self.temperature: float | None = None
        self.servo_on = True
        self.emergency_stop = False
        self._sign = parameters.home_direction.sign

    @property
    def running(self) -> bool:
        """Whether a run is on, or hands its home over."""
        return self.machine is not None or self.handover is not None

    @property
    def moving(self) -> bool:
        """Whether a run may move the axis."""
        return self.machine is not None

    @property
    def handing_over(self) -> bool:
        """Whether the home of a run is being handed over: coordinates may change."""
        return self.handover is not None

    @property
    def powered(self) -> bool:
        """Whether the drive holds the axis, as far as it is known."""
        return self.servo_on and not self.readings.servo_is_off

    @property
    def paused(self) -> bool:
        return self.machine is not None and self.machine.paused

    @property
    def state(self) -> State:
        if self.machine is not None:
            return self.machine.state
        return State.Idle if self.handover is None else State.HomeShift

    @property
    def error(self) -> Error:
        """Why the axis is stopping, or how its last run ended."""
        if self.machine is not None:
            return self.machine.ending.error
        return self.outcome.error if self.handover is None else Error.NoError

    @property
    def message(self) -> str:
        """The error in words."""
        if self.machine is not None:
            return self.machine.ending.message
        if self.handover is not None:
            return f'axis {self.name}: hand-over, step {self.handover.step}'
        return self.outcome.message

    @property
    def torque_limit(self) -> float:
        """The torque limit for the drive, %; 0 for none."""
        return 0.0 if self.machine is None else self.machine.torque_limit

    @property
    def arm_latch(self) -> bool:
        """Whether the run waits for a Z-pulse or a touch probe, so that the drive must latch."""
        return self.machine is not None and self.machine.awaits_latch

    @property
    def position(self) -> float:
        """The newest feedback: in homed coordinates if the axis is homed, else raw."""
        raw = self._sign * self.readings.track.position
        return raw - self.outcome.home_offset if self.homed else raw

    @property
    def raw_position(self) -> float:
        return self._sign * self.readings.track.position

    @property
    def command(self) -> float:
        """The present setpoint of the run, raw; without a run the raw position."""
        if self.machine is None:
            return self.raw_position
        return self.readings.wrapped(self._sign * self.machine.profile.present)

    @property
    def following_error(self) -> float:
        """The setpoint for the time of the newest feedback less that feedback, raw; 0 at rest."""
        machine, track = self.machine, self.readings.track
        if machine is None:
            return 0.0
        profile = machine.profile
        age = min(max(0.0, machine.now - track.time), LATEST)
        return self._sign * (profile.commanded(age + profile.period) - track.position)

    @property
    def levels(self) -> list[tuple[str, bool | None]]:
        """Each wired input and its level after polarity; None: not known, or it is a latch."""
        return [(str(source), level) for source, level in self.readings.levels]

    @property
    def home_position_raw(self) -> float:
        """Where the reference was found, raw: in the run in progress, else in the last one."""
        machine = self.machine
        if machine is not None and machine.reference is not None:
            return self._sign * machine.reference.position
        handover = self.handover
        found = self.outcome if handover is None else handover.plan.found
        return found.home_position_raw

    @property
    def members(self) -> tuple[MemberHome, ...]:
        """The drives of a gantry as they are now, the leader first; () for one drive."""
        return ()

    @property
    def fingerprint(self) -> tuple[object, ...]:
        """A value that changes when the published state changes, and at the end of each run."""
        machine = self.machine
        if machine is None:
            step = None if self.handover is None else self.handover.step
            home = self.homed, self.home_source, self.outcome.error, self.notes
            return self.history.count, *home, self.servo_on, step
        touched = machine.movement.end.touched
        return machine.step, machine.ending.error, machine.paused, touched, self.servo_on
