# SPDX-License-Identifier: Apache-2.0
"""Takes one axis through the table of its home type: arrows, rules of every row, pause, stop.

The machine reads a table of procedures/ (whose __init__.py has the theory of operation) and
commands a profile. All positions are in the *toward* frame, m or rad; times in s are passed in.

Sources: WMX3 manual, "Limit Switches During Homing"; doc/homing.md for what is decided here.
"""

from collections.abc import Mapping

from ..parameters.axis import AxisParameters
from ..procedures.events import CONDITIONS, Event
from ..procedures.motions import Kind, Way
from ..procedures.procedure import Row
from ..procedures.states import Error, Input, Role, State
from ..procedures.steps import ENDS, HOME_SHIFT, HOME_SHIFT_MOVE, JOGGING, Step
from . import limits
from .ending import Ending
from .latches import EVENTS
from .movement import Movement
from .outcome import Failure
from .passes import Passes
from .profile import Profile
from .remembered import Remembered, Seen
from .series_limits import SeriesLimits
from .signals import Edge, HasLevel, Mark
from .switch_events import SwitchEvents
from .track import Track
from .travel import Rules
from .undo import Undo

#: The edges that end the search for a switch.
SEARCHED = (Event.HS_RISES, Event.HS_FALLS, Event.LS_RISES)


class Machine:
    """One run through the table of a home type.

    Attributes:
        step: the present step, and ``row`` its row.
        ending: why and how the run ends before it is homed.
        finished: the command is at rest, and nothing more will come.
        paused: the axis waits before a turn (``pause_mode``).
        movement: the motion of the present row.
        reference: the home position, None until it was found.
        reversed: the one reversal is used up.
        rules: the bounds of every motion.
        passes: the passes over the reference so far.
        arrows: every arrow taken so far.
        warnings: what the user should know of the run.
        seen: the edges and latches of the run.
    """

    __slots__ = (
        'parameters',
        'procedure',
        'profile',
        'now',
        'feedback',
        'step',
        'row',
        'finished',
        'paused',
        'ending',
        'movement',
        'reference',
        'reversed',
        'arrows',
        'passes',
        'warnings',
        'seen',
        '_known',
        '_rows',
        '_switches',
        '_limits',
        'rules',
        '_cause',
        '_undo',
        '_paused_at',
    )

    def __init__(
        self,
        parameters: AxisParameters,
        profile: Profile,
        switches: Mapping[Input, HasLevel],
        now: float,
        feedback: float,
        series: SeriesLimits | None = None,
        known: Remembered | None = None,
    ) -> None:
        self.parameters = parameters
        self.procedure = parameters.procedure
        self.profile = profile
        self.now = now
        self.feedback = feedback
        self.seen = Seen()
        self._known = known  # in the toward frame; None: an ordinary run
        self._rows = {**self.procedure.rows, **self.procedure.quick}
        self._set_row(self.procedure.first)
        self.ending = Ending(profile)
        self.finished = False
        self.paused = False
        self.reference: Mark | None = None
        self.arrows: list[tuple[Step, Event]] = []

        self._limits = limits.LimitSwitches(parameters, switches, series)
        self._switches = SwitchEvents(parameters, switches, self._limits)
        self.movement = Movement(parameters, profile, now, feedback, self.warn)
        self.rules = Rules(parameters, now)
        self._cause = Mark(feedback)
        self._undo: Undo | None = None  # None: no edge took the last arrow
        self.reversed = False
        self.passes = Passes(parameters)
        self.warnings: list[str] = []
        self._paused_at = now

    @property
    def state(self) -> State:
        """The published home state."""
        return State.Cancel if self.ending.error is Error.Canceled else self.step.state

    @property
    def torque_limit(self) -> float:
        """The torque limit that the mechanical end asks for, %; 0: none."""
        return self.movement.end.torque_limit(searching=Event.END_DETECTED in self.row.on)

    @property
    def awaits_latch(self) -> bool:
        """Whether the present row ends with a latched position, or a jog looks for one."""
        waits = self.step is JOGGING or any(event in self.row.on for event in EVENTS.values())
        return waits and not self.ending.stopping

    @property
    def traveled(self) -> tuple[float, float]:
        """Distance from the turning point, and what bounds it, m."""
        return abs(self.feedback - self.movement.leg.feedback), self.rules.distance

    def way_at(self, time: float, track: Track) -> int | None:
        """Return the sign of the travel at a time that the track covers, None if not yet known."""
        return self.movement.leg.way_at(time, track)

    # --------------------------------------------------------------------------- what happens

    def begin(self) -> None:
        """Enter the first row; its conditions decide what the start position changes."""
        # CurrentPos does not move, and needs no limit.
        if not (self.procedure.moves and self._limits_contradict()):
            self._enter(self._first_step(), Mark(self.feedback))

    def _first_step(self) -> Step:
        """Return the step in which the run begins: a quick one, if it knows where to go."""
        quick = self._known and self._known.way(
            self.procedure, self.parameters.margin_before_switch, self.profile.position
        )
        if not quick:
            return self.procedure.first
        self.movement.approach, self.passes.expected = quick.approach, quick.expected
        return quick.step

    def edge(self, edge: Edge) -> None:
        """Take an edge whose way of travel is known.

        If an edge of a later time has already ended a row that would have taken this edge, its
        arrow is undone: the earlier edge decides, however late its message arrives.
        """
        self._switches.remember(edge)
        self.seen.edge(edge)
        if self.ending.stopping:
            return
        rises, falls, on = self._switches.events_of(edge.input)
        event = rises if edge.rises else falls
        undo = self._undo
        if (
            undo
            and event in undo.row.on
            and edge.order < undo.edge.order
            and self._switches.counts(edge, undo.row)
        ):
            undo.take_back(self)
        if event and event in self.row.on and self._switches.counts(edge, self.row):
            if not edge.rises:
                self._limits.cleared(edge.input)
            self._advance(event, edge)
        elif edge.rises and on and on in self.row.on and self._switches.on(edge.input):
            self._advance(on, edge)
        elif edge.rises and on is Event.LIMIT_AHEAD:
            self.limit_rises(edge.input)  # the row that would have taken it has just ended

    def limit_rises(self, switch: Input) -> None:
        """Respond to a limit's rise at once, before its position is known (limits.py)."""
        way = self.profile.velocity or self.movement.leg.way
        limit = self._limits.rising(switch, way, self.feedback)
        if limit is None:
            return
        self._limits_contradict()
        action, response = limit.action, limits.response_to(limit, self._rise_of(limit))
        if response is limits.Response.ACT and action:
            self.ending.stop(action)
        elif response is limits.Response.BRAKE_HARDER and action:
            self.profile.brake_harder(action.deceleration or self.parameters.ls_dec)
        elif response in limits.FAILS:
            second = self.reversed and limit.way is Way.TOWARD
            hint = self._switches.bounce_hint
            self.fail(limits.failure_of(response, limit, second, hint), action)

    def limit_falls(self, switch: Input) -> None:
        """Remember where a limit fell, so that its bounce is not taken for a rise."""
        self._limits.left(switch, self.feedback)

    def latch(self, source: Input, position: float) -> None:
        """Record a latched position of the Z-pulse or the touch probe."""
        self.seen.latch(source, position, self.now, self.profile.velocity)
        self.movement.latches.add(source, position)

    def fail(self, failure: Failure, action: limits.Action | None = None) -> None:
        """End the run with an error; the axis stops by an action, by default with ``ls_dec``.

        The first error stays. A harder stop that comes later takes over.
        """
        if not self.ending.stopping:
            hint = self._stuck_hint(failure.error) or failure.hint
            hint = hint and f'; {hint}'
            self._give_up(failure.error, f'{failure.seen} in {self.state}{hint}')
        self.ending.stop(action or limits.Action(self.parameters.ls_dec))

    def warn(self, text: str) -> None:
        """Add a warning for the user, once."""
        if text not in self.warnings:
            self.warnings.append(text)

    def cancel(self) -> None:
        """Stop with the deceleration of the present motion."""
        if not self.ending.stopping:
            self._give_up(Error.Canceled, f'canceled in {self.state}')
            self.ending.stop_gently()

    def resume(self) -> None:
        """Leave the pause of ``pause_mode``."""
        if self.paused:
            self._end_pause()
            self._start_motion(resumed=True)

    # ------------------------------------------------------------------------------- each cycle

    def update(self, now: float, feedback: float, interval: float = 0.0, age: float = 0.0) -> None:
        """Test the bounds, then follow the arrows of the motion's own events.

        Called once a cycle, before the profile's update.

        Args:
            now: the present time, s.
            feedback: the newest feedback.
            interval: the time between two readings of the feedback, s.
            age: how old the newest feedback is, s.
        """
        self.now, self.feedback = now, feedback
        if self.finished or self.paused:
            return
        if self.ending.stopping:
            self.finished = self.profile.done or self.ending.silent
            return
        movement = self.movement
        movement.follow(feedback)
        failure = self.rules.broken(
            movement.leg, self.profile.commanded, feedback, now, interval, age
        ) or movement.end.passed(feedback)
        if failure is not None:
            self.fail(failure)
            return
        while not (self.paused or self.ending.stopping or self.finished):
            found = movement.event(now, feedback, interval)
            if found is None:
                return
            if isinstance(found, Failure):
                self.fail(found)
            else:
                self._advance(*found)

    # ------------------------------------------------------------------------------ transitions

    def _advance(self, event: Event, cause: Mark) -> None:
        """Follow an arrow."""
        self._undo = Undo.of(self, cause)
        step = self.row.on[event]
        if step is HOME_SHIFT and self.passes.add(cause):
            event = Event.REPEAT
            step = self.row.on[event]
        self.arrows.append((self.step, event))
        if event in SEARCHED and self.row.motion.way is Way.TOWARD:
            self.seen.approach = cause
        if event is Event.LIMIT_AHEAD:
            if self.reversed:
                self.fail(limits.ahead_again(self._switches.bounce_hint))
                return
            self.reversed = True
            self.passes.forget()
        if (
            event in (Event.LIMIT_AHEAD, Event.LS_RISES)
            and self.parameters.immediate_stop_at_ls
            and self.profile.velocity * self.row.motion.way > 0.0
        ):  # else it has turned
            self.profile.freeze()
        if step in ENDS:
            self.finished = True
            return
        if step is HOME_SHIFT_MOVE and self.passes.fine:
            failure = self.passes.disagreement()
            if failure is not None:
                self.fail(failure)
                return
            self.reference = self.passes.mean
        elif event in (Event.HS_RISES, Event.LS_RISES) and step is not HOME_SHIFT:
            self.passes.coarse = cause
        self._enter(step, cause)

    def _set_row(self, step: Step) -> None:
        """Make a row the present one."""
        self.step: Step = step
        self.row: Row = self._rows[step]

    def _enter(self, step: Step, cause: Mark) -> None:
        """Enter a row; go on to the next if one of its conditions holds, else start its motion."""
        self._cause = cause
        self._set_row(step)
        if step is HOME_SHIFT:
            self.reference = cause
        for condition in CONDITIONS:
            if condition in self.row.on and self._switches.holds(condition, self.feedback):
                self._advance(condition, Mark(self.feedback))
                return
        self._start_motion()

    def _start_motion(self, resumed: bool = False) -> None:
        """Command the present row's motion, or pause before it if it turns the axis."""
        if self.paused:
            return
        movement = self.movement
        way, target = movement.heading(self.row.motion, self.reference)
        if movement.turns(way):
            if movement.leg.way and self.parameters.pause_mode and not resumed:
                self.paused, self._paused_at = True, self.now
                self.profile.stop()
                return
            movement.turn(way, self.now, self.feedback)
        limit = self._limits.blocking(way, self.row.motion.kind is Kind.HOME, self.feedback)
        if limit is not None:
            if not self._may_be_there(limit, target):
                seen = f'the {limit.name} is on; a motion into it is not started'
                self.fail(Failure(Error.LSTriggered, seen), limit.action)
                return
            target = self.profile.position
        self.rules.enter(self.row, self.profile.velocity, self.now)
        movement.start(self.row, self._cause, target)

    # ------------------------------------------------------------------------------- the switches

    def _rise_of(self, limit: limits.Limit) -> limits.Rise:
        """Return what the axis does at the moment when a limit rises."""
        motion, cause = self.row.motion, self._cause
        rests = self.paused or motion.kind is Kind.REST
        jogs, just_left = self.step is JOGGING, self._limits.bounces(limit.input, self.feedback)
        there = max(self.feedback, self.profile.position)  # a feedback may be old
        return limits.Rise(
            velocity=self.profile.velocity,
            heading=Way.NONE if rests else self.movement.leg.way,
            stopping=self.ending.stopping,
            braking=rests or motion.way is Way.AWAY,
            to_home=motion.kind is Kind.HOME,
            at_its_edge=self.passes.near_edge_of(there) is limit.input,
            awaited=self._switches.awaits(self.row, limit, self.reversed),
            turned_by_it=isinstance(cause, Edge) and cause.input is limit.input,
            just_left=just_left,
            all_ls=self.parameters.all_ls_during_homing and not (just_left and jogs),
        )

    def _may_be_there(self, limit: limits.Limit, target: float) -> bool:
        """Return whether the axis rests at home, as far as home is known, on the limit of home."""
        if limit.role is not Role.REFERENCE or self.reference is None:
            return False
        return abs(target - self.profile.position) <= self.reference.uncertainty

    def _limits_contradict(self) -> bool:
        """Fail if the levels of a pair of limits contradict each other; return whether they do."""
        failure = self._limits.contradiction()
        if failure is not None:
            self.fail(failure)
        return failure is not None

    def _stuck_hint(self, error: Error) -> str:
        """Return a hint at a home switch that was never off, or ''."""
        return self._switches.stuck_hint(error, self.row)

    # ------------------------------------------------------------------------------------ endings

    def _give_up(self, error: Error, message: str) -> None:
        self.ending.begin(error, self.parameters.unit.in_message(message))
        self._end_pause()

    def _end_pause(self) -> None:
        if self.paused:
            self.paused = False
            self.rules.deadline += self.now - self._paused_at
