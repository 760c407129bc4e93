# SPDX-License-Identifier: Apache-2.0
"""One axis: signals + machine + profile. No clock, no thread, no I/O: time is passed in.

Feed it (:meth:`Axis.feedback`, :meth:`Axis.switch`, :meth:`Axis.latch`), ask it
(:meth:`Axis.home`, :meth:`Axis.cancel`) and update it once a cycle: :meth:`Axis.update` returns
the setpoint while a run is on. Raw positions outside, the *toward* frame inside: the sign of the
homing direction is applied here, once. SI units; times in s of one monotonic clock.
"""

import math

from ..parameters.axis import AxisParameters, switch_inputs
from ..procedures.motions import Way
from ..procedures.states import LIMIT_SWITCHES, Error, HomeType, Input, State
from .history import History
from .limits import Action
from .machine import Machine
from .outcome import Fault, Outcome
from .profile import Profile
from .signals import Edge, Switch, Track

#: Longest wait for the feedback to settle after the command has come to rest, s.
SETTLE_TIMEOUT = 0.5
#: The feedback has settled once it moved less than slow velocity x SETTLE_TRAVEL in SETTLE_TIME,
#: and in no fewer than SETTLE_SAMPLES samples, all of them taken with the command at rest.
SETTLE_TIME = 0.008
SETTLE_TRAVEL = 1e-4
SETTLE_SAMPLES = 3
#: More bounces of one switch in a run are worth a warning.
MANY_BOUNCES = 10

#: What the axis shall do in a cycle, raw: position, velocity and acceleration in m, m/s, m/s^2.
Setpoint = tuple[float, float, float]


class Axis:
    """One axis that can be homed.

    ``machine`` is the run while one is on, ``outcome`` how the last one ended, ``homed`` whether
    the axis knows its home, ``servo_on`` the servo that we want.
    """

    def __init__(self, name: str, parameters: AxisParameters, period: float) -> None:
        self.name = name
        self.period = period
        self.machine: Machine | None = None
        self.outcome = Outcome(Error.NoError)
        self.history = History()
        self.homed = False
        self.servo_on = True
        self.servo_enabled: bool | None = None
        self.emergency_stop = False
        self.arrival = -1e300  # of the newest feedback
        self._track = Track()
        self._commands = Track()
        self._switches: dict[Input, Switch] = {}
        self._unsettled = False  # whether a switch may wait for its debounce
        self._waiting: list[Edge] = []  # edges that the machine has not taken yet
        self._unresolved: list[Edge] = []  # taken, but their position is still extrapolated
        self._rest: tuple[float, float] | None = None  # last command and the feedback there, raw
        self._settling_since: float | None = None
        self._moved = False
        self._bounces: dict[Input, int] = {}  # when the run began
        self._sign = 1.0
        self.parameters = parameters
        self.configure(parameters)

    def configure(self, parameters: AxisParameters) -> None:
        """Take new parameters; raises RuntimeError while a run is on."""
        if self.machine is not None:
            raise RuntimeError(f'axis {self.name} is homing')
        if parameters.home_type is not self.parameters.home_type:
            self.history.forget_homes()
        self.parameters = parameters
        sign = parameters.home_direction.sign
        if sign != self._sign:
            self._track.mirror()
            self._sign = sign
        old = self._switches
        self._switches = {}
        for switch in switch_inputs(parameters.inputs):
            inverted = parameters.inverted(switch)
            known = old.get(switch)
            if known is None or known.inverted != inverted:
                known = Switch(switch, inverted)
            known.debounce = parameters.switch_debounce
            self._switches[switch] = known
        self.profile = Profile(self.period, parameters.max_jerk)

    # ------------------------------------------------------------------------------------- inputs

    def feedback(
        self, time: float, position: float, arrival: float | None = None, doubt: float = 0.0
    ) -> None:
        """Take a feedback sample: its sampling time, raw position, and when it arrived.

        ``doubt`` is how far the time may be wrong, s (0: it is a stamp that is believed).
        """
        if self._track.append(time, self._sign * position, doubt):
            self.arrival = time if arrival is None else arrival

    def switch(
        self,
        switch: Input,
        time: float,
        signal: bool,
        arrival: float | None = None,
        doubt: float = 0.0,
    ) -> None:
        """Take a level as it is on the wire, and its time; an input not wired is ignored.

        ``doubt`` is how far the time may be wrong, s (0: it is a stamp that is believed).
        """
        known = self._switches.get(switch)
        if known is None:
            return
        p = self.parameters
        edge = known.set(
            time - p.switch_latency,
            signal,
            time if arrival is None else arrival,
            doubt or p.switch_stamp_error,
            not doubt,
        )
        self._unsettled = self._unsettled or known.unsettled
        if edge is not None:
            self._take(edge)

    def latch(self, source: Input, position: float) -> None:
        """Take a latched raw position of the Z-pulse or the touch probe; nonsense is ignored."""
        wired = source in self.parameters.inputs
        if self.machine is not None and wired and math.isfinite(position):
            self.machine.latch(source, self._sign * position)

    def enable(self, enabled: bool) -> None:
        """Take the drive's own servo state."""
        self.servo_enabled = enabled
        if not enabled and Input.SERVO_ENABLED in self.parameters.inputs:
            self._rest = None
            if self.parameters.clear_home_done_on_servo_off:
                self.homed = False
            self._fail(Error.ServoOff, 'the drive switched its servo off', Action(None))

    # ----------------------------------------------------------------------------------- requests

    @property
    def known(self) -> bool:
        """Whether a feedback was ever received."""
        return self.arrival > -1e200

    @property
    def running(self) -> bool:
        return self.machine is not None

    @property
    def unknown_inputs(self) -> tuple[Input, ...]:
        """Wired inputs that carry a level, but none was seen yet."""
        unknown = [switch for switch, s in self._switches.items() if s.level is None]
        if Input.SERVO_ENABLED in self.parameters.inputs and self.servo_enabled is None:
            unknown.append(Input.SERVO_ENABLED)
        return tuple(unknown)

    def refusal(self, now: float) -> Outcome | None:
        """Return why a run cannot start now, None where it can."""
        p = self.parameters
        if self.machine is not None:
            return self._refused(Error.Busy, f'homing is in progress ({self.machine.state})')
        if self.emergency_stop:
            return self._refused(Error.EmergencyStop, 'the emergency stop is on')
        if not self.servo_on:
            return self._refused(
                Error.ServoOff, 'the servo was switched off; switch it on by the servo service'
            )
        faults = p.cross_check()
        if faults:
            return self._refused(Error.InvalidParameter, '; '.join(faults))
        if not self.known:
            return self._refused(
                Error.FeedbackStale, f'no feedback yet for joint {p.joint or self.name!r}'
            )
        age = now - self.arrival
        if age > p.feedback_timeout:
            return self._refused(
                Error.FeedbackStale,
                f'the feedback is {age:.3f} s old, more than {p.feedback_timeout:g} s '
                '(feedback_timeout)',
            )
        if self.unknown_inputs:
            names = ', '.join(self.unknown_inputs)
            return self._refused(Error.SwitchUnknown, f'no message yet from {names}')
        if Input.SERVO_ENABLED in p.inputs and not self.servo_enabled:
            return self._refused(Error.ServoOff, 'the drive reports its servo off')
        stale = self._stale_switch(now)
        if stale is not None:
            return self._refused(Error.SwitchStale, stale)
        return None

    def home(self, now: float) -> Outcome | None:
        """Start a run; return why it cannot start, None where it has."""
        refusal = self.refusal(now)
        if refusal is not None:
            return refusal
        p = self.parameters
        feedback = self._track.position
        self.profile.reset(self._start_command())
        self.homed = False
        self.outcome = Outcome(Error.NoError)
        self._waiting.clear()
        self._unresolved.clear()
        self._commands = Track()
        self._moved = False
        self._settling_since = None
        self._bounces = {name: switch.bounces for name, switch in self._switches.items()}
        self.machine = Machine(p, self.profile, self._switches, now, feedback)
        self.machine.begin()
        return None

    def warn(self, text: str) -> None:
        """Note what the user should know of the run that is on, once."""
        if self.machine is not None:
            self.machine.warn(text)

    def cancel(self) -> None:
        """Stop the run, if one is on, with the active profile."""
        if self.machine is not None:
            self.machine.cancel()

    def resume(self) -> None:
        """Leave the pause of ``pause_mode``."""
        if self.machine is not None:
            self.machine.resume()

    def stop(self, error: Error, message: str) -> None:
        """End the run, if one is on, with a fault: a stop with ls_dec."""
        self._fail(error, message)

    def held_up(self, since: float, message: str) -> None:
        """Take that no cycle came since a time; a run that began later has missed none."""
        if self.machine is not None and self.machine.now < since:
            self.stop(Error.CycleLate, message)

    def set_back(self, now: float) -> None:
        """Forget what was known at times that come once more, for time was set back.

        The levels stay, as if told now. The feedback has to come anew; the home is lost with it.
        """
        self._settle_switches(math.inf)
        for switch in self._switches.values():
            switch.set_back(now)
        self._waiting.clear()
        self._unresolved.clear()
        self._track.restart()
        self._settling_since = None
        self.arrival = -1e300
        self.homed = False

    def set_emergency_stop(self, active: bool) -> None:
        """Take the emergency stop: true ends a run and refuses requests; false moves nothing."""
        self.emergency_stop = active
        if active:
            self._fail(Error.EmergencyStop, 'emergency stop')

    def set_servo(self, on: bool) -> None:
        """Set the servo that we want; off ends a run without a further setpoint."""
        self.servo_on = on
        if not on:
            self._rest = None
            if self.parameters.clear_home_done_on_servo_off:
                self.homed = False
            self._fail(Error.ServoOff, 'the servo was switched off', Action(None, True))

    # --------------------------------------------------------------------------------- each cycle

    def update(self, now: float) -> Setpoint | None:
        """Advance by one period; return the setpoint while a run is on and the axis moves."""
        if self._unsettled:
            self._settle_switches(now)
        machine = self.machine
        if machine is None:
            if self.homed and self.parameters.clear_home_done_on_comm_stop:
                self.homed = now - self.arrival <= self.parameters.feedback_timeout
            return None
        p = self.parameters
        if now - self.arrival > p.feedback_timeout or p.switch_timeout:
            self._test_inputs(now)
        if self._unresolved:
            track = self._edge_track
            for edge in self._unresolved:
                edge.locate(track)
            self._unresolved = [edge for edge in self._unresolved if not edge.resolved]
        if self._waiting:
            self._hand_over(machine)
        machine.update(now, self._track.position)
        if machine.finished:
            return self._finish(now)
        profile = self.profile
        if not self._moved:
            if profile.done:
                return None
            self._moved = True
        profile.update()
        return self._setpoint(now)

    @property
    def state(self) -> State:
        return State.Idle if self.machine is None else self.machine.state

    @property
    def error(self) -> Error:
        """Why the axis is stopping, or how its last run ended."""
        return self.outcome.error if self.machine is None else self.machine.error

    @property
    def message(self) -> str:
        """What to say of the error."""
        return self.outcome.message if self.machine is None else self.machine.message

    @property
    def torque_limit(self) -> float:
        """The torque limit that the drive shall keep, %; 0: none."""
        return 0.0 if self.machine is None else self.machine.torque_limit

    @property
    def shown(self) -> tuple[object, ...]:
        """What differs wherever something changes that others watch; each end of a run does."""
        machine = self.machine
        if machine is None:
            return self.history.runs, self.homed, self.servo_on
        return machine.step, machine.error, machine.paused, machine.end.touched, self.servo_on

    @property
    def hold_position(self) -> float:
        """The raw command that keeps the axis where it rests."""
        return self._sign * self._start_command()

    @property
    def paused(self) -> bool:
        return self.machine is not None and self.machine.paused

    @property
    def position(self) -> float:
        """The newest feedback: in homed coordinates once homed, else raw."""
        raw = self._sign * self._track.position
        return raw - self.outcome.home_offset if self.homed else raw

    @property
    def raw_position(self) -> float:
        return self._sign * self._track.position

    @property
    def home_position_raw(self) -> float:
        """Where the reference was taken, raw: in the run that is on, else in the last one."""
        machine = self.machine
        if machine is not None and machine.reference is not None:
            return self._sign * machine.reference.position
        return self.outcome.home_position_raw

    # ------------------------------------------------------------------------------------- inside

    @property
    def _edge_track(self) -> Track:
        return self._commands if self.parameters.open_loop_homing else self._track

    def _settle_switches(self, now: float) -> None:
        """Take the edges that their debounce confirms by now."""
        for switch in self._switches.values():
            if switch.unsettled:
                edge = switch.poll(now)
                if edge is not None:
                    self._take(edge)
        self._unsettled = any(switch.unsettled for switch in self._switches.values())

    def _take(self, edge: Edge) -> None:
        """Queue an edge by its time, a limit before another switch; act on a limit at once."""
        machine = self.machine
        if machine is None:
            return
        if edge.input in LIMIT_SWITCHES:
            if edge.rises:
                machine.limit_rises(edge.input)
            else:
                machine.limit_falls(edge.input)
        self._waiting.append(edge)
        self._waiting.sort(key=lambda waiting: waiting.order)

    def _hand_over(self, machine: Machine) -> None:
        """Give the machine the edges whose way of travel is known, in order."""
        track = self._edge_track
        while self._waiting:
            edge = self._waiting[0]
            located = edge.locate(track)
            way = machine.way_at(min(edge.time, track.time), track)
            if way is None:
                return
            # While the axis plainly goes toward, an edge need not wait for the feedback.
            if not located and not way == machine.row.motion.way == Way.TOWARD:
                return
            if not edge.resolved:
                self._unresolved.append(edge)
            edge.way = way
            del self._waiting[0]
            machine.edge(edge)

    def _test_inputs(self, now: float) -> None:
        """End the run where an input is too old."""
        p = self.parameters
        age = now - self.arrival
        if age > p.feedback_timeout:
            self.homed = False
            self._fail(
                Error.FeedbackStale,
                f'the feedback is {age:.3f} s old, more than '
                f'{p.feedback_timeout:g} s (feedback_timeout)',
            )
        elif p.switch_timeout:
            stale = self._stale_switch(now)
            if stale is not None:
                self._fail(Error.SwitchStale, stale)

    def _stale_switch(self, now: float) -> str | None:
        limit = self.parameters.switch_timeout
        for switch in self._switches.values():
            if limit and now - switch.seen > limit:
                return (
                    f'{switch.input.text} is {now - switch.seen:.3f} s old, more than '
                    f'{limit:g} s (switch_timeout)'
                )
        return None

    def _start_command(self) -> float:
        """Return where the command begins: the feedback, or our last command where it rests."""
        feedback = self._track.position
        p = self.parameters
        if self._rest is not None and p.home_type is not HomeType.CurrentPos:
            command, rest = self._rest
            moved = abs(self._sign * feedback - rest)
            behind = abs(command - rest)
            if moved <= p.homing_velocity_slow * self.period and behind <= p.following_error_limit:
                return self._sign * command
        return feedback

    def _setpoint(self, now: float) -> Setpoint:
        profile, sign = self.profile, self._sign
        if self.parameters.open_loop_homing:
            self._commands.append(now + self.period, profile.position)
        return sign * profile.position, sign * profile.velocity, sign * profile.acceleration

    def _finish(self, now: float) -> Setpoint | None:
        """End the run once the feedback has settled, too, where there is one."""
        machine = self.machine
        assert machine is not None
        if self._settling_since is None:
            self._settling_since = now
        follows = (
            self._moved
            and not machine.silent
            and (now - self.arrival <= self.parameters.feedback_timeout)
        )
        if (
            follows
            and now - self._settling_since < SETTLE_TIMEOUT
            and not self._settled(self._settling_since)
        ):
            return self._setpoint(now)
        self.outcome = self._outcome(machine)
        self.history.add(self.outcome.error, self.outcome.home_position_raw)
        self.homed = self.outcome.success
        self.machine = None
        if machine.servo_off:
            self.servo_on = False
        self._rest = (
            None
            if machine.silent or machine.servo_off
            else (self._sign * self.profile.position, self.raw_position)
        )
        return self._setpoint(now) if self._moved and not machine.silent else None

    def _settled(self, since: float) -> bool:
        """Tell whether the feedback has stopped changing, the command being at rest since then."""
        track = self._track
        begin = track.time - max(SETTLE_TIME, SETTLE_SAMPLES * track.interval)
        travel = SETTLE_TRAVEL * self.parameters.homing_velocity_slow
        return begin >= since and track.spread(begin) <= travel

    def _outcome(self, machine: Machine) -> Outcome:
        if machine.error is not Error.NoError or machine.reference is None:
            return Outcome(
                machine.error,
                f'axis {self.name}: {machine.message}',
                warnings=self._warnings(machine),
            )
        p, mark = self.parameters, machine.reference
        raw = self._sign * mark.position
        offset = raw + self._sign * p.home_shift_distance - p.home_position
        passes = machine.passes
        return Outcome(
            Error.NoError,
            '',
            raw,
            offset,
            mark.uncertainty,
            len(passes.fine),
            passes.range,
            passes.deviation,
            machine.index_margin,
            self._warnings(machine),
        )

    def _warnings(self, machine: Machine) -> tuple[str, ...]:
        """Return what the run's user should know, bouncing switches included."""
        for switch in self._switches.values():
            bounces = switch.bounces - self._bounces.get(switch.input, 0)
            if bounces > MANY_BOUNCES:
                machine.warn(f'{switch.input.text} bounced {bounces} times')
        return tuple(machine.warnings)

    def _refused(self, error: Error, text: str) -> Outcome:
        return Outcome(error, f'axis {self.name}: {text}')

    def _fail(self, error: Error, text: str, action: Action | None = None) -> None:
        if self.machine is not None:
            self.machine.fail(Fault(error, text), action)
