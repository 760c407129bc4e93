# SPDX-License-Identifier: Apache-2.0
"""One axis: its inputs, its run, and its setpoints. No clock, no thread, no I/O.

Give it messages (:meth:`Axis.feedback`, :meth:`Axis.switch`, :meth:`Axis.latch`) and requests
(:meth:`Axis.home`, :meth:`Axis.cancel`), and call :meth:`Axis.update` once a cycle: it returns the
setpoint of a run. Positions are raw outside and in the *toward* frame inside: the sign of the
homing direction is applied here. SI units; times are in s of one monotonic clock.
"""

import math
from collections.abc import Mapping
from typing import Any

from ..parameters.axis import AxisParameters
from ..procedures.states import Error, Input
from .announcement import Course
from .axis_inputs import AxisInputs
from .edge_queue import EdgeQueue
from .home_watch import HomeWatch
from .jog import DEADMAN_TIME, Jog, fault_of, jog_parameters, met
from .kept_home import RunKind
from .limits import Action
from .machine import Machine
from .outcome import Failure, Jogged, Outcome
from .profile import Profile
from .remembered import Remembered
from .result import outcome_of
from .settling import Rest, Settling, jammed, never_moved

#: The velocity of an axis that does not follow is the mean over this time, s.
VELOCITY_SPAN = 0.01

#: The command of a cycle, raw: position, velocity and acceleration in m, m/s, m/s^2 (or rad ...).
Setpoint = tuple[float, float, float]


class Axis(AxisInputs):
    """One axis that can be homed.

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

    @property
    def drives(self) -> Mapping[str, Any]:
        """What receives the messages of each of its drives, by full name; one but for a gantry."""
        return {self.name: self}

    def enable(self, enabled: bool) -> None:
        """Record the drive's own servo state; a servo that goes off ends a run."""
        self.readings.servo_enabled = enabled
        if not enabled and Input.SERVO_ENABLED in self.parameters.inputs:
            self._lose_servo('the drive switched its servo off', Action(None))

    # ----------------------------------------------------------------------------------- requests

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

    def warn(self, text: str) -> None:
        """Add a warning to the run in progress, once."""
        if self.machine is not None:
            self.machine.warn(text)

    def cancel(self) -> None:
        """Stop a run in progress with the present profile."""
        if self.machine is not None:
            self.machine.cancel()
        elif self.handover is not None:
            self.handover.cancel()

    def resume(self) -> None:
        """Leave the pause of ``pause_mode``."""
        if self.machine is not None:
            self.machine.resume()

    def stop(self, error: Error, message: str, action: Action | None = None) -> None:
        """End a run in progress with an error; the axis stops by an action, else with ls_dec."""
        if self.machine is not None:
            self.machine.fail(Failure(error, message), action)
        elif self.handover is not None:
            self.handover.stop(error, message)

    def abort(self, error: Error, message: str) -> None:
        """End the run at once, without a stop: its own code has failed."""
        self._rest = None
        self._end(self._failed(error, message))

    def cycles_were_missed(self, elapsed: float) -> None:
        """Take that no cycle came for a time, s: the controller followed what it was told."""
        if self.machine is not None and self._moved:
            self.profile.skip(elapsed)

    def cycle_was_late(self, since: float, message: str) -> None:
        """End a run that was in progress at ``since``, the time of the last cycle, with CycleLate.

        A run that began later has missed no cycle.
        """
        if self.machine is not None and self.machine.now < since:
            self.stop(Error.CycleLate, message)

    def time_jumped_back(self, now: float) -> None:
        """Forget the times of all that was received, because simulated time jumped back.

        The levels of the switches stay, as if just received. The feedback must arrive again, and
        the axis is no longer homed.
        """
        for edge in self.readings.settle(math.inf):
            self._take(edge)
        self.readings.time_jumped_back(now)
        self._edges.clear()
        self._settling.restart()
        self._home_watch = HomeWatch()
        self._lose_home(Error.CycleLate, 'simulated time was set back')
        self.forget_coordinates()

    def set_emergency_stop(self, active: bool) -> None:
        """Set the emergency stop; while it is on, runs end and requests are refused."""
        self.emergency_stop = active
        if active:
            self.stop(Error.EmergencyStop, 'emergency stop')

    def set_servo(self, on: bool) -> None:
        """Set whether this node wants the servo on; off ends a run with no further setpoint."""
        self.servo_on = on
        if not on:
            self._lose_servo('the servo was switched off', Action(None, True))

    # --------------------------------------------------------------------------------- each cycle

    def update(self, now: float) -> Setpoint | None:
        """Advance by one period; return the setpoint if a run moves the axis."""
        readings = self.readings
        if self.returning:
            self._return()
        readings.moving = not self.returning and self.profile.velocity != 0.0
        if readings.unsettled:
            for edge in readings.settle(now):
                self._take(edge)
        machine = self.machine
        if machine is None:
            if self.handover is not None:
                self._hand_over(self.handover, now)
            elif self.homed:
                self._watch_age(now)
            return None
        if now > self._hold_until:
            self._let_go(machine)
        p = self.parameters
        if now - readings.arrival > p.feedback_timeout or p.switch_timeout:
            self._test_inputs(machine, now)
        track = readings.track
        stopping = machine.ending.stopping
        self._edges.update(machine, track)
        machine.update(now, track.position, track.interval, now - track.time)
        if machine.ending.error is Error.FollowingError and not stopping:
            self._stop_where_it_is(machine, now)
        if machine.finished:
            return self._finish(now)
        profile = self.profile
        if not self._moved:
            if profile.done:
                return None
            self._moved = True
        profile.update()
        return self._setpoint(now)

    def course(self, horizon: float) -> Course:
        """Return what a controller is told: called after :meth:`update`, ``horizon`` in s."""
        present, pieces = self.profile.announce(horizon)
        raw = self._sign * self.profile.position
        return Course(present, pieces, self._sign, self.readings.wrapped(raw) - raw)

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

    def _let_go(self, machine: Machine) -> None:
        """End a jog whose deadman is not held any more."""
        if not machine.ending.stopping:
            text = f'the deadman was not held for {DEADMAN_TIME:g} s, or released'
            machine.fail(Failure(Error.Canceled, text))

    def _test_inputs(self, machine: Machine, now: float) -> None:
        """End the run if an input is too old."""
        stale = self.readings.stale(now)
        if stale is None:
            return
        # Where the axis is is not known; the controller has been told how to stop.
        told = stale.error is Error.FeedbackStale and self.lead and not machine.ending.stopping
        machine.fail(stale, Action(None) if told else None)

    def _stop_where_it_is(self, machine: Machine, now: float) -> None:
        """Plan the stop of an axis that is not where its command is from where it is."""
        track, fastest = self.readings.track, self.readings.top_speed
        velocity = min(fastest, max(-fastest, track.drift(VELOCITY_SPAN)))
        position = track.position + velocity * max(0.0, now - track.time)
        machine.ending.stop_from(position, velocity, self.parameters.ls_dec)

    def _start_command(self) -> float:
        """Return the first command of a run: the last command if the axis still rests there.

        Else it is the feedback.
        """
        rest, raw = self._rest, self.raw_position
        if rest is not None and rest.holds(raw, self.parameters, self.period):
            raw = rest.command
        return self._sign * raw

    def _setpoint(self, now: float) -> Setpoint:
        profile, sign = self.profile, self._sign
        self._edges.command(now + self.lead + self.period, profile.position)
        position = self.readings.wrapped(sign * profile.position)
        return position, sign * profile.velocity, sign * profile.acceleration

    def _finish(self, now: float) -> Setpoint | None:
        """End the run as soon as the feedback has settled after the command."""
        machine = self.machine
        assert machine is not None
        p, readings, ending = self.parameters, self.readings, machine.ending
        arrived, told = self.profile.arrived, self._moved and not ending.silent
        if told:
            self.profile.update()
        behind = self.profile.position - readings.track.position
        followed = not self._moved or abs(behind) <= p.settling_tolerance
        failed = ending.error is not Error.NoError
        settled = self._settling.over(
            now, readings.track, p.homing_velocity_slow, followed or failed
        )
        watched = told and readings.feedback_is_fresh(now)
        if (told and not arrived) or (watched and not settled):
            return self._setpoint(now)
        if not (followed or failed):
            machine.fail(jammed(behind, p.settling_tolerance))
        stood = 0.0 if failed or p.homes_on_mechanical_end else machine.movement.stood
        if stood > p.settling_tolerance:
            machine.fail(never_moved(stood))
        for text in readings.warnings(machine.passes.fine):
            machine.warn(text)
        if ending.servo_off:
            self.servo_on = False
        self._end(self._outcome(machine))
        if watched:
            readings.settled = readings.track.time
        rest = Rest(self._sign * self.profile.position, self.raw_position)
        self._rest = None if ending.silent or ending.servo_off else rest
        if ending.silent:
            self._end_silently(now)
        return self._setpoint(now) if told else None

    def _outcome(self, machine: Machine) -> Outcome:
        """Return how a run has ended."""
        finest = self.readings.finest
        outcome = outcome_of(machine, self.name, finest)
        if self.kind is not RunKind.jog:
            return outcome
        text = outcome.message if outcome.error is not Error.NoError else ''
        jogged = Jogged(self.raw_position - self._jog_from, met(machine, finest))
        return outcome._replace(message=text, jogged=jogged, unit=self.parameters.unit)

    def _end_silently(self, now: float) -> None:
        """Let the command go to where the axis is, if the servo is off; else stay as it was told.

        A controller that plays the stop that it was told last would end far from the axis.
        """
        readings = self.readings
        self.returning = self._moved and not self.powered and readings.feedback_is_fresh(now)
        if self.returning:
            self.profile.update()
            self.profile.come_back(readings.track.position)
        else:
            self.profile.freeze()

    def _return(self) -> None:
        """Let the command go on to where the axis is."""
        self.profile.update()
        if self.profile.arrived:
            self.returning = False
            self.profile.freeze()

    def _lose_servo(self, text: str, action: Action) -> None:
        """End a run, and forget the home if the parameters say so, because the servo is off."""
        self._rest = None
        if self.parameters.clear_home_done_on_servo_off:
            self._lose_home(Error.ServoOff, text)
        self.stop(Error.ServoOff, text, action)
