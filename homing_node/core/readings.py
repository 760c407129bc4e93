# SPDX-License-Identifier: Apache-2.0
"""What an axis has received: its feedback, its switches, its servo; and whether all are fresh.

Times are in s of one monotonic clock.
"""

import math
from collections.abc import Iterable, Iterator

from ..parameters.axis import AxisParameters, switch_inputs
from ..parameters.units import Unit
from ..procedures.states import Error, Input, LimitPair
from .outcome import Failure
from .series_limits import SeriesLimits
from .signals import Edge, Mark, Switch
from .track import Track
from .two_sources import TwoSources

#: The arrival of a message that never came.
NEVER = -1e300
#: A turn, rad, and by how much of it a jump of the feedback may differ from it.
TURN, A_TURN = 2.0 * math.pi, 0.05
#: An axis rests if it has moved slower than this part of its slow velocity for this long, s.
REST_SPEED, REST_TIME = 0.1, 0.15
#: Samples that the first setpoint must agree with.
LAST_SAMPLES = 3
#: More bounces of one switch in a run are worth a warning.
MANY_BOUNCES = 10


class Readings:
    """The inputs of one axis.

    Attributes:
        moving: whether the axis is told to move.
        settled: when the feedback had settled after the last run, s.
        sources: whether two nodes publish the joint.
        top_speed: the highest speed of a run, m/s or rad/s.
        track: the recorded feedback, in the *toward* frame, m or rad.
        arrival: when the newest feedback arrived, s.
        switches: the wired switches, with their levels.
        servo_enabled: the drive's own servo state; None before its first message.
        series: the pairs of limit switches that are one input.
        unsettled: whether a level change may still wait for its debounce.
    """

    def __init__(self, parameters: AxisParameters) -> None:
        self.moving = False
        self.settled = NEVER
        self.track = Track()
        self.sources = TwoSources()
        self.arrival = NEVER
        self.switches: dict[Input, Switch] = {}
        self.servo_enabled: bool | None = None
        self.series = SeriesLimits()
        self.unsettled = False
        self._parameters = parameters
        self._sign = 1.0
        self._from_zero = False  # the driver publishes a wrapped joint from 0 on, not around 0
        self._bounces_before: dict[Input, int] = {}
        self.configure(parameters)

    def configure(self, parameters: AxisParameters) -> None:
        """Use new parameters; the known level of a switch is turned with its polarity."""
        self._parameters = parameters
        self._noise = 1e-3 * parameters.travel
        self._leap = 0.01 * parameters.travel + 2.0 * parameters.following_error_limit
        self.top_speed = max(
            parameters.homing_velocity_fast,
            parameters.home_shift_velocity,
            parameters.rehome_velocity,
        )
        sign = parameters.home_direction.sign
        if sign != self._sign:
            self.track.mirror()
            self._sign = sign
        old, self.switches = self.switches, {}
        for switch in switch_inputs(parameters.inputs):
            known = old.get(switch) or Switch(switch)
            known.turn(parameters.inverted(switch))
            known.debounce = parameters.switch_debounce
            self.switches[switch] = known

    def wire_in_series(self, pairs: Iterable[LimitPair]) -> None:
        """Set which pairs of limit switches are one input; known ends stay if nothing changes."""
        if self.series.pairs != frozenset(pairs):
            self.series = SeriesLimits(pairs)

    def is_on(self, switch: Input) -> bool:
        """Return whether a wired switch is known to be on."""
        known = self.switches.get(switch)
        return known is not None and known.level is True

    def signal(self, switch: Input) -> bool | None:
        """Return the newest level of a switch on the wire, None where it is not known."""
        known = self.switches.get(switch)
        return None if known is None else known.signal

    @property
    def levels(self) -> list[tuple[Input, bool | None]]:
        """Each wired input and its level after polarity; None: not known, or it is a latch."""
        found = []
        for one in self._parameters.inputs:
            switch = self.switches.get(one)
            level = None if switch is None else switch.level
            found.append((one, self.servo_enabled if one is Input.SERVO_ENABLED else level))
        return found

    @property
    def known(self) -> bool:
        """Whether a feedback was ever received."""
        return self.arrival > NEVER

    @property
    def unknown_inputs(self) -> tuple[Input, ...]:
        """The wired inputs that carry a level which has not been received yet."""
        unknown = [switch for switch, s in self.switches.items() if s.level is None]
        if self._servo_wired and self.servo_enabled is None:
            unknown.append(Input.SERVO_ENABLED)
        return tuple(unknown)

    # ----------------------------------------------------------------------------------- messages

    def feedback(
        self, time: float, position: float, arrival: float, doubt: float, homing: bool = False
    ) -> Failure | None:
        """Record a feedback sample, its position raw; one that is not newer is dropped.

        While the axis homes, a sample is also dropped if the axis cannot have moved so far: a stop
        must not begin at a place where the axis is not.

        Returns:
            What is wrong with the sample: it jumped by a turn, or further than the axis can move.
        """
        track = self.track
        self.sources.add(arrival, position, self._noise + 5.0 * self.top_speed * track.interval)
        if self._parameters.wrap:
            self._from_zero = self._from_zero or position > 0.5 * self._parameters.wrap
            position = self.unwrapped(position)
        step = self._sign * position - track.position
        jumped = self.known and abs(abs(step) - TURN) < A_TURN * TURN
        reach = self._leap + 10.0 * self.top_speed * (time - track.time)
        if homing and time > track.time and not jumped and abs(step) > reach:
            return self._second_source(track.position, track.position + step)
        if track.append(time, self._sign * position, doubt, self.moving):
            self.arrival = arrival
        if not jumped:
            return None
        return Failure(
            Error.FollowingError,
            f'the feedback jumped by {self._sign * step:.6g} m, about 2 pi',
            'is it published modulo a turn (wrap)?',
        )

    def _second_source(self, one: float, other: float) -> Failure:
        """Return the failure of two places for one joint, m in the *toward* frame."""
        return Failure(
            Error.PublisherConflict,
            f'the feedback says {self._sign * one:.6g} m and {self._sign * other:.6g} m',
            'does a second node publish this joint, or did its driver restart?',
        )

    def unwrapped(self, position: float) -> float:
        """Return a raw position in the turn that is nearest to the feedback."""
        wrap = self._parameters.wrap
        if not wrap or not self.known:
            return position
        return position + wrap * round((self._sign * self.track.position - position) / wrap)

    def wrapped(self, position: float) -> float:
        """Return a raw setpoint as the driver takes it."""
        wrap = self._parameters.wrap
        if not wrap or not self._parameters.wrap_setpoints:
            return position
        low = 0.0 if self._from_zero else -0.5 * wrap
        return low + (position - low) % wrap

    def switch(
        self, switch: Input, time: float, signal: bool, arrival: float, doubt: float
    ) -> Edge | None:
        """Record a level as it is on the wire; return the edge that it confirms, if any."""
        known = self.switches.get(switch)
        if known is None:
            return None
        p = self._parameters
        edge = known.set(time - p.switch_latency, signal, arrival, doubt + p.switch_stamp_error)
        self.unsettled = self.unsettled or known.unsettled
        return edge

    def repeat(
        self, switches: Iterable[Input], time: float, arrival: float, doubt: float
    ) -> Iterator[Edge]:
        """Record that switches have the levels of their last messages; yield confirmed edges."""
        p = self._parameters
        time, doubt = time - p.switch_latency, doubt + p.switch_stamp_error
        for switch in switches:
            known = self.switches.get(switch)
            if known is not None:
                edge = known.repeat(time, arrival, doubt)
                if edge is not None:
                    yield edge

    def settle(self, now: float) -> Iterator[Edge]:
        """Yield the edges whose debounce is over by now."""
        for switch in self.switches.values():
            if switch.unsettled:
                edge = switch.poll(now)
                if edge is not None:
                    yield edge
        self.unsettled = any(switch.unsettled for switch in self.switches.values())

    def time_jumped_back(self, now: float) -> None:
        """Forget the times of all that was received, because simulated time jumped back.

        The levels stay, as if just received. The feedback must arrive again.
        """
        for switch in self.switches.values():
            switch.set_back(now)
        self.track.restart()
        self.settled = NEVER
        self.arrival = NEVER

    def forget_places(self) -> None:
        """Forget where the axis was before the newest sample: its coordinates have changed."""
        track = self.track
        time, position = track.time, track.position
        track.restart()
        track.append(time, position)
        self.settled = time

    @property
    def leap(self) -> float:
        """A distance that is no noise and no lag, m."""
        return self._leap

    def begin_run(self) -> None:
        """Count the bounces of the switches anew, and learn the noise of an axis at rest."""
        self.track.note_noise(self._rested)
        self._bounces_before = {name: switch.bounces for name, switch in self.switches.items()}

    def polling_warning(self, edge: Edge) -> str:
        """Return what to say of an edge that is uncertain because its switch is polled, or ''."""
        p, gap = self._parameters, edge.opening.gap
        limit = 0.001 * p.travel if p.unit is Unit.rad else 1e-4
        if edge.uncertainty <= limit or gap * edge.speed < edge.uncertainty:
            return ''
        interval = self.switches[edge.input].messages.interval or gap
        return (
            f'{edge.input.text} is read about {1.0 / interval:.3g} times a second: at '
            f'{edge.speed:.3g} m/s home is known to {edge.uncertainty:.2g} m; at '
            f'{0.1 * edge.speed:.2g} m/s it would be known 10 times better'
        )

    @property
    def finest(self) -> float:
        """How exactly the feedback can show a place at best, m.

        That is a count of the encoder; if the feedback shows none, the travel of a feedback
        interval at the slow velocity.
        """
        track = self.track
        return track.count or self._parameters.homing_velocity_slow * track.interval

    def warnings(self, passes: Iterable[Mark]) -> list[str]:
        """Return what the user should know of the switches, when a run has ended.

        Args:
            passes: where the run has found its reference.
        """
        edges = [mark for mark in passes if isinstance(mark, Edge)]
        worst = max(edges, key=lambda edge: edge.uncertainty, default=None)
        polled = self.polling_warning(worst) if worst else ''
        return self.bounce_warnings() + ([polled] if polled else [])

    def bounce_warnings(self) -> list[str]:
        """Return a warning for each switch that has bounced often since the run began."""
        counts = {
            switch.input.text: switch.bounces - self._bounces_before.get(name, 0)
            for name, switch in self.switches.items()
        }
        return [f'{text} bounced {n} times' for text, n in counts.items() if n > MANY_BOUNCES]

    # --------------------------------------------------------------------------- known and fresh

    def motion(self) -> Failure | None:
        """Return why the axis does not rest, None if it does.

        The mean positions of both halves of the last REST_TIME (after a run, of the time since its
        end) must be the same, and the newest samples must lie where the axis can have been; but
        for the noise of a count.
        """
        track, p = self.track, self._parameters
        lasts = self._rested
        speed, count = abs(track.drift(lasts)), min(track.grain, p.settling_tolerance)
        if speed > max(REST_SPEED * p.homing_velocity_slow, count / REST_TIME):
            return Failure(Error.AxisMoving, f'the axis moves at {speed:.3g} m/s')
        apart = track.jump(lasts, LAST_SAMPLES, p.homing_velocity_fast, 2.0 * count)
        if not apart:
            return None
        return Failure(
            Error.AxisMoving,
            f'the feedback jumps between places {abs(apart):.6g} m apart, although the axis rests',
        )

    @property
    def _rested(self) -> float:
        """For how long an axis must have stood to be at rest, s: not before its last run ended."""
        return min(REST_TIME, self.track.time - self.settled)

    def conflict(self, joint: str) -> Failure | None:
        """Return the failure of a joint that two nodes publish, None if one does."""
        if self.sources.places is None:
            return None
        one, other = (self._sign * place for place in self.sources.places)
        failure = self._second_source(one, other)
        return failure._replace(
            seen=f'joint {joint!r}: {failure.seen}, in turn: does a second node publish it?'
        )

    def unready(self, now: float, joint: str) -> Failure | None:
        """Return which input keeps a run from starting, None if all are known and fresh."""
        if not self.known:
            return Failure(Error.FeedbackStale, f'no feedback yet for joint {joint!r}')
        old = self._old_feedback(now)
        if old is not None:
            return old
        conflict = self.conflict(joint)
        if conflict is not None:
            return conflict
        unknown = self.unknown_inputs
        if unknown:
            return Failure(Error.SwitchUnknown, f'no message yet from {", ".join(unknown)}')
        if self._servo_wired and not self.servo_enabled:
            return Failure(Error.ServoOff, 'the drive reports its servo off')
        return self._old_switch(now)

    def stale(self, now: float) -> Failure | None:
        """Return which input is too old for the run to go on, None if all are fresh."""
        return self._old_feedback(now) or self._old_switch(now)

    def feedback_is_fresh(self, now: float) -> bool:
        """Return whether the newest feedback is no older than ``feedback_timeout``."""
        return now - self.arrival <= self._parameters.feedback_timeout

    @property
    def servo_is_off(self) -> bool:
        """Whether the drive reports its servo off."""
        return self._servo_wired and self.servo_enabled is False

    @property
    def _servo_wired(self) -> bool:
        return Input.SERVO_ENABLED in self._parameters.inputs

    def _old_feedback(self, now: float) -> Failure | None:
        limit = self._parameters.feedback_timeout
        if self.feedback_is_fresh(now):
            return None
        return Failure(
            Error.FeedbackStale,
            f'the feedback is {now - self.arrival:.3f} s old, more than {limit:g} s '
            '(feedback_timeout)',
        )

    def _old_switch(self, now: float) -> Failure | None:
        limit = self._parameters.switch_timeout
        for switch in self.switches.values():
            if limit and now - switch.seen > limit:
                return Failure(
                    Error.SwitchStale,
                    f'{switch.input.text} is {now - switch.seen:.3f} s old, more than '
                    f'{limit:g} s (switch_timeout)',
                )
        return None
