# SPDX-License-Identifier: Apache-2.0
"""The runs that an axis begins, homings and jogs, and why one cannot begin now."""

import math

from ..parameters.axis import AxisParameters
from ..procedures.states import Error
from .axis_inputs import AxisInputs
from .edge_queue import EdgeQueue
from .jog import DEADMAN_TIME, Jog, fault_of, jog_parameters, met
from .kept_home import RunKind
from .machine import Machine
from .outcome import Failure, Jogged, Outcome
from .profile import Profile
from .remembered import Remembered
from .result import outcome_of
from .settling import Settling


class AxisRuns(AxisInputs):
    """An axis that begins runs; `Axis` lets them go on and end.

    Attributes:
        period: the time between two updates, s.
        lead: how long before its time a setpoint is told, s.
        profile: the command.
        returning: the servo went off in a run: the command is on its way to where the axis is,
            which the controller must be told.
    """

    def __init__(
        self, name: str, parameters: AxisParameters, period: float, lead: float = 0.0
    ) -> None:
        """Make an axis at rest.

        Args:
            name: its name.
            parameters: its parameters.
            period: the period of the cycle, s.
            lead: how long before its time a setpoint is told, s (0: as the next one, alone).
        """
        super().__init__(name, parameters)
        self.period = period
        self.lead = lead
        self._settling = Settling(lead)
        self._moved = False
        self._hold_until = math.inf  # a jog stops then
        self._jog_from = 0.0
        self.returning = False
        self.configure(parameters)

    def configure(self, parameters: AxisParameters) -> None:
        """Use new parameters.

        Raises:
            RuntimeError: a run is in progress.
        """
        if self.running:
            raise RuntimeError(f'axis {self.name} is homing')
        if parameters.home_type is not self.parameters.home_type:
            self.history.forget_homes()
            self.remembered = None
        self.parameters = parameters
        self._sign = parameters.home_direction.sign
        self.readings.configure(parameters)
        self.profile = Profile(self.period, parameters.max_jerk, lead=self.lead)

    def refusal(self, now: float, verify: bool = False) -> Outcome | None:
        """Return why a run cannot start now, None if it can."""
        if self.running:
            return self._failed(Error.Busy, f'homing is in progress ({self.state})')
        if self.emergency_stop:
            return self._failed(Error.EmergencyStop, 'the emergency stop is on')
        if not self.servo_on:
            return self._failed(
                Error.ServoOff, 'the servo was switched off; switch it on by the servo service'
            )
        problems = self.parameters.cross_check()
        if problems:
            return self._failed(Error.InvalidParameter, '; '.join(problems))
        unverifiable = self.unverifiable() if verify else None
        if unverifiable is not None:
            return unverifiable
        unready = self.readings.unready(now, self.parameters.joint or self.name)
        unready = unready or self.readings.motion()
        return None if unready is None else self._failed(*unready[:2])

    def home(self, now: float, verify: bool = False) -> Outcome | None:
        """Start a run; return why it cannot start, None if it has started.

        Args:
            now: the present time, s.
            verify: only compare the home with what is found again, and keep it.
        """
        refusal = self.refusal(now, verify)
        if refusal is not None:
            return refusal
        known = self._begin_home(now, verify)
        self._hold_until = math.inf
        self._begin_run(self.parameters)
        self.machine = self._new_machine(now, known)
        self.machine.begin()
        return None

    def jog_refusal(self, now: float, jog: Jog) -> Outcome | None:
        """Return why the axis cannot jog so now, None if it can."""
        fault = fault_of(jog, self.parameters)
        if fault:
            return self._failed(Error.InvalidParameter, fault)
        return self.refusal(now)

    def jog(self, now: float, jog: Jog) -> Outcome | None:
        """Start a jog; return why it cannot start, None if it has started.

        No home is changed. With a deadman it stops if `deadman` is not called in time.
        """
        refusal = self.jog_refusal(now, jog)
        if refusal is not None:
            return refusal
        self.kind = RunKind.jog
        self._hold_until = now + DEADMAN_TIME if jog.deadman else math.inf
        self._jog_from = self.raw_position
        parameters = jog_parameters(self.parameters, jog)
        self._begin_run(parameters)
        self.machine = machine = self._machine_of(now, parameters)
        machine.movement.approach = self.profile.position + self._sign * jog.distance
        machine.begin()
        return None

    @property
    def distance_to_go(self) -> float:
        """How far a jog has to go, raw, m or rad; 0 without one."""
        if self.machine is None or self.kind is not RunKind.jog:
            return 0.0
        return self._sign * (self.machine.movement.approach - self.readings.track.position)

    def deadman(self, now: float, held: bool) -> None:
        """Take that the deadman of a jog is held, or was released."""
        if self._hold_until < math.inf:
            self._hold_until = now + DEADMAN_TIME if held else now

    @property
    def hold_position(self) -> float:
        """The raw command that keeps the axis where it rests, m or rad."""
        return self.readings.wrapped(self._sign * self._start_command())

    # ------------------------------------------------------------------------------------- inside

    def _begin_run(self, parameters: AxisParameters) -> None:
        """Prepare a run, which begins where the axis stands."""
        self.profile.reset(self._start_command())
        self.returning = False
        self._edges = EdgeQueue(parameters)
        self._settling.restart()
        self._moved = False
        self.readings.begin_run()

    def _new_machine(self, now: float, known: Remembered | None) -> Machine:
        """Return the run that begins; ``known``: where it goes quickly."""
        return self._machine_of(now, self.parameters, known)

    def _machine_of(
        self, now: float, parameters: AxisParameters, known: Remembered | None = None
    ) -> Machine:
        readings = self.readings
        return Machine(
            parameters,
            self.profile,
            readings.switches,
            now,
            readings.track.position,
            readings.series,
            known,
        )

    def _start_command(self) -> float:
        """Return the first command of a run: the last command if the axis still rests there.

        Else it is the feedback.
        """
        rest, raw = self._rest, self.raw_position
        if rest is not None and rest.holds(raw, self.parameters, self.period):
            raw = rest.command
        return self._sign * raw

    def _let_go(self, machine: Machine) -> None:
        """End a jog whose deadman is not held any more."""
        if not machine.ending.stopping:
            text = f'the deadman was not held for {DEADMAN_TIME:g} s, or released'
            machine.fail(Failure(Error.Canceled, text))

    def _outcome(self, machine: Machine) -> Outcome:
        """Return how a run has ended."""
        finest = self.readings.finest
        outcome = outcome_of(machine, self.name, finest)
        if self.kind is not RunKind.jog:
            return outcome
        text = outcome.message if outcome.error is not Error.NoError else ''
        jogged = Jogged(self.raw_position - self._jog_from, met(machine, finest))
        return outcome._replace(message=text, jogged=jogged, unit=self.parameters.unit)
