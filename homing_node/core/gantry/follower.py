# SPDX-License-Identifier: Apache-2.0
"""A follower: a drive of a gantry besides the leader's, with its own feedback and switches.

It receives messages as an axis does, and gets a setpoint in each cycle: the leader's, further by
a constant offset, or one of its own path while it squares the gantry or stops on its own.
"""

import math
from collections.abc import Iterable
from typing import Protocol

from ...parameters.axis import AxisParameters
from ...procedures.states import Error, Input
from ..announcement import Course
from ..home_watch import HomeWatch
from ..limits import Action
from ..profile import Profile
from ..readings import Readings
from ..settling import Rest, Settling
from ..signals import Edge

#: Position, velocity and acceleration, raw.
Setpoint = tuple[float, float, float]


class Leader(Protocol):
    """What a follower needs of the axis that it follows."""

    name: str
    parameters: AxisParameters
    profile: Profile
    period: float
    lead: float
    servo_on: bool

    @property
    def running(self) -> bool: ...
    @property
    def moving(self) -> bool: ...
    def warn(self, text: str) -> None: ...
    def stop(self, error: Error, message: str, action: Action | None = None) -> None: ...
    def take_from(self, follower: 'Follower', edge: Edge) -> None: ...
    def latch_from(self, follower: 'Follower', source: Input, position: float) -> None: ...
    def lose_servo_of(self, name: str, tripped: bool) -> None: ...
    def lose_home_of(self, name: str, error: Error, text: str) -> None: ...


class Follower:
    """One follower; outside positions are raw, inside they are in the *toward* frame.

    Attributes:
        name: its full name, such as y.y2.
        short: its name in `followers`, such as y2.
        parameters: its parameters.
        readings: what it has received.
        offset: its command less the leader's, as long as it has no path of its own.
        profile: its own path; None: it goes where the leader goes.
        setpoint: its setpoint in this cycle, raw; None: there is none.
        returning: its servo went off in a run: its command goes to where it is.
        handing_over: always False: a gantry hands no home over.
        settling: whether its feedback has come to rest.
    """

    handing_over = False

    def __init__(self, name: str, parameters: AxisParameters, leader: Leader) -> None:
        self.name, self.parameters, self._leader = name, parameters, leader
        self.short = name.partition('.')[2]
        self.readings = Readings(parameters)
        self.sign = parameters.home_direction.sign
        self.offset = 0.0
        self.profile: Profile | None = None
        self.setpoint: Setpoint | None = None
        self.returning = False
        self.settling = Settling(leader.lead)
        self._rest: Rest | None = None
        self._braking = 0.0  # the deceleration of its own stop that is under way
        self._watch = HomeWatch()

    def configure(self, parameters: AxisParameters) -> None:
        """Use new parameters; no run is on."""
        self.parameters, self.sign = parameters, parameters.home_direction.sign
        self.readings.configure(parameters)

    # ------------------------------------------------------------------------------------- inputs

    def feedback(
        self, time: float, position: float, arrival: float | None = None, doubt: float = 0.0
    ) -> None:
        """Record a feedback sample; the arguments are those of `Axis.feedback`."""
        arrival = time if arrival is None else arrival
        moving, track = self._leader.moving, self.readings.track
        before = track.time
        failure = self.readings.feedback(time, position, arrival, doubt, moving)
        if failure is not None and moving:
            self._leader.stop(failure.error, f'{self.name}: {failure.seen}; {failure.hint}')
        if track.time == before:
            return
        raw = self.sign * track.position
        if moving:
            self._watch.follow(time, raw)
            return
        p = self._leader.parameters
        jump = self._watch.step(time, raw, self.readings.leap, p.ls_dec)
        if jump:
            self.readings.forget_places()
            self._lose_home(f'the feedback jumped by {jump:.6g} m: did the driver restart?')

    def feedback_source_changed(self) -> None:
        """Take that another publisher sends the feedback: a driver that has restarted."""
        if self._leader.parameters.clear_home_done_on_comm_stop:
            self._lose_home('the publisher of the feedback has changed: did the driver restart?')

    def switch(
        self,
        switch: Input,
        time: float,
        signal: bool,
        arrival: float | None = None,
        doubt: float = 0.0,
    ) -> None:
        """Record the level of a switch; the arguments are those of `Axis.switch`."""
        arrival = time if arrival is None else arrival
        edge = self.readings.switch(switch, time, signal, arrival, doubt)
        if edge is not None:
            self._leader.take_from(self, edge)

    def repeat(
        self, switches: Iterable[Input], time: float, arrival: float, doubt: float = 0.0
    ) -> None:
        """Record that some switches have the levels of their last messages."""
        for edge in self.readings.repeat(switches, time, arrival, doubt):
            self._leader.take_from(self, edge)

    def latch(self, source: Input, position: float) -> None:
        """Record a latched raw position; one that is not finite or not wired is ignored."""
        if source in self.parameters.inputs and math.isfinite(position):
            self._leader.latch_from(self, source, self.sign * position)

    def enable(self, enabled: bool) -> None:
        """Record the drive's own servo state; one that goes off ends the run of the gantry."""
        tripped = self.readings.servo_enabled is True and not enabled
        self.readings.servo_enabled = enabled
        if not enabled and Input.SERVO_ENABLED in self.parameters.inputs:
            self._leader.lose_servo_of(self.name, tripped)

    def settle(self, now: float) -> None:
        """Take the edges whose debounce is over."""
        for edge in self.readings.settle(now):
            self._leader.take_from(self, edge)

    def set_emergency_stop(self, active: bool) -> None:
        """Do nothing: the leader hears of it, too."""

    def warn(self, text: str) -> None:
        """Add a warning to the run in progress, once."""
        self._leader.warn(f'{self.name}: {text}')

    def stop(self, error: Error, message: str, action: Action | None = None) -> None:
        """End the run of the gantry."""
        self._leader.stop(error, f'{self.name}: {message}', action)

    # -------------------------------------------------------------------------------- what it does

    @property
    def period(self) -> float:
        return self._leader.period

    @property
    def running(self) -> bool:
        return self._leader.running

    @property
    def moving(self) -> bool:
        return self._leader.moving

    @property
    def powered(self) -> bool:
        """Whether its drive holds it, as far as it is known."""
        return self._leader.servo_on and not self.readings.servo_is_off

    @property
    def raw_position(self) -> float:
        return self.sign * self.readings.track.position

    @property
    def command(self) -> float:
        """Its newest command."""
        if self.profile is not None:
            return self.profile.position
        return self._leader.profile.position + self.offset

    def commanded(self, age: float = 0.0) -> float:
        """Return what was commanded ``age`` s before the present."""
        if self.profile is not None:
            return self.profile.commanded(age)
        return self._leader.profile.commanded(age) + self.offset

    @property
    def hold_position(self) -> float:
        """The raw command that keeps it where it rests."""
        return self.sign * self.start_command()

    def start_command(self) -> float:
        """Return the first command of a run: the last one if it still rests there."""
        rest, raw = self._rest, self.raw_position
        if rest is not None and rest.holds(raw, self.parameters, self._leader.period):
            raw = rest.command
        return self.sign * raw

    def course(self, horizon: float) -> Course:
        """Return what a controller is told, as `Axis.course` does."""
        if self.profile is not None:
            return Course(*self.profile.announce(horizon), self.sign)
        told = self._leader.profile.announce(horizon)
        return Course(*told, self.sign, self.sign * self.offset)

    # ----------------------------------------------------------------------- for the gantry's run

    def begin(self, leaders_command: float) -> None:
        """Begin a run in which the leader's first command is this."""
        self.profile, self.returning = None, False
        self.offset = self.start_command() - leaders_command
        self._braking = 0.0
        self.readings.begin_run()
        self.settling.restart()

    def time_jumped_back(self, now: float) -> None:
        """Forget the times of all that was received, because simulated time jumped back."""
        self.settle(math.inf)
        self.readings.time_jumped_back(now)
        self.settling.restart()
        self._watch = HomeWatch()

    def take_own_path(self) -> Profile:
        """Leave the leader's path; return the own one, which goes on as it was."""
        if self.profile is None:
            self.profile = self._leader.profile.shifted(self.offset)
        return self.profile

    def rejoin(self) -> None:
        """Follow the leader again, from where both rest."""
        self.offset = self.command - self._leader.profile.position
        self.profile = None

    def advance(self) -> None:
        """Make the setpoint of this cycle; the leader's path has advanced."""
        profile, offset, own = self._leader.profile, self.offset, self.profile
        if own is not None:
            own.update()
            profile, offset = own, 0.0
        sign = self.sign
        self.setpoint = (
            sign * (profile.position + offset),
            sign * profile.velocity,
            sign * profile.acceleration,
        )

    def brake(self, demanded: float) -> None:
        """Stop on its own path, if it moves on one, unless it brakes as hard already.

        Args:
            demanded: the deceleration that an error demands; 0: that of its motion.
        """
        own = self.profile
        if own is None or (own.velocity == 0.0 and own.acceleration == 0.0):
            return
        deceleration = demanded or own.dynamics.deceleration
        if deceleration > self._braking:
            self._braking = deceleration
            own.stop(deceleration)

    def stop_from(self, position: float, velocity: float, deceleration: float) -> None:
        """Stop on its own path from where it is."""
        self._braking = deceleration
        self.take_own_path().stop_from(position, velocity, deceleration)

    def end(self, now: float, silent: bool, moved: bool) -> None:
        """Take that the run has ended; the command of a drive that is off comes back to it.

        Args:
            now: the present time, s.
            silent: no setpoint may follow.
            moved: setpoints were told in the run.
        """
        fresh, powered = self.readings.feedback_is_fresh(now), self.powered
        self._rest = None
        self.returning = moved and fresh and not powered
        if self.returning:
            own = self.take_own_path()
            if silent:
                own.update()
            own.come_back(self.readings.track.position)
        elif moved and silent:
            self.take_own_path().freeze()
        else:
            if moved and fresh:
                self.readings.settled = self.readings.track.time
            if powered:
                self._rest = Rest(self.sign * self.command, self.raw_position)
            self.rejoin()

    def come_back(self) -> None:
        """Let the command go on to where it is, with its servo off."""
        own = self.take_own_path()
        own.update()
        if own.arrived:
            self.returning = False
            own.freeze()

    def lose_rest(self) -> None:
        """Forget where the last run has left it."""
        self._rest = None

    def _lose_home(self, text: str) -> None:
        self._leader.lose_home_of(self.name, Error.HomeLost, text)
