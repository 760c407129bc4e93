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

from ..procedures.states import Error, Input
from .announcement import Course
from .axis_runs import AxisRuns
from .home_watch import HomeWatch
from .limits import Action
from .machine import Machine
from .outcome import Failure
from .remembered import Seen
from .settling import Rest, jammed, never_moved

#: The velocity of an axis that does not follow is the mean over this time, s.
VELOCITY_SPAN = 0.01

#: The command of a cycle, raw: position, velocity and acceleration in m, m/s, m/s^2 (or rad ...).
Setpoint = tuple[float, float, float]


class Axis(AxisRuns):
    """One axis that can be homed.

    What it receives stands in axis_inputs.py, the runs that it begins in axis_runs.py.
    """

    @property
    def drives(self) -> Mapping[str, Any]:
        """What receives the messages of each of its drives, by full name; one but for a gantry."""
        return {self.name: self}

    @property
    def seen_by_drive(self) -> Mapping[str, Seen]:
        """The edges and latches of each drive in the run in progress, by full name."""
        return {} if self.machine is None else {self.name: self.machine.seen}

    def enable(self, enabled: bool) -> None:
        """Record the drive's own servo state; a servo that goes off ends a run."""
        self.readings.servo_enabled = enabled
        if not enabled and Input.SERVO_ENABLED in self.parameters.inputs:
            self._lose_servo('the drive switched its servo off', Action(None))

    # ----------------------------------------------------------------------------------- requests

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
        raw = self._sign * self.profile.position
        turns = self.readings.wrapped(raw) - raw
        return Course(*self.profile.announce(horizon), self._sign, turns)

    # ------------------------------------------------------------------------------------- inside

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
        stood = 0.0 if failed else machine.movement.stood
        if stood > p.settling_tolerance and p.homes_on_mechanical_end:
            machine.warn(
                f'{never_moved(stood).seen}: only an axis that began at its end does that'
            )
        elif stood > p.settling_tolerance:
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
