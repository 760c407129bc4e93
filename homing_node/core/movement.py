# SPDX-License-Identifier: Apache-2.0
"""The motion of the present row: it is commanded here, and its own events are found here.

A motion's own events are those that no switch reports: it has arrived, a latched position lies
behind it, the mechanical end holds it. Positions are in the *toward* frame, m or rad; times in s
are passed in.
"""

from collections.abc import Callable

from ..parameters.axis import AxisParameters
from ..procedures.events import Event
from ..procedures.motions import Kind, Motion, Pace, Way
from ..procedures.procedure import Row
from ..procedures.states import IndexMarginAction
from .latches import Latches
from .mechanical_end import MechanicalEnd
from .outcome import Failure
from .phase import Dynamics
from .profile import Profile
from .signals import Edge, Mark
from .travel import Leg

#: An axis that has traveled no more than this part of what the command did has stood.
STANDS = 0.1

#: An event, and where the axis was.
Found = tuple[Event, Mark]


class Movement:
    """Commands the motions of a run, one after another.

    Attributes:
        leg: the present stretch of travel in one way.
        latches: the latched positions since the axis turned.
        end: the search for the mechanical end.
        approach: where a quick way goes.
        index_margin: distance from the edge that armed the Z-pulse to the first pulse, in pitches;
            None while it is not known.
    """

    __slots__ = (
        'leg',
        'latches',
        'end',
        'approach',
        'index_margin',
        '_parameters',
        '_gone',
        '_traveled',
        '_profile',
        '_dynamics',
        '_warn',
        '_row',
        '_cause',
        '_own_event',
        '_further',
    )

    def __init__(
        self,
        parameters: AxisParameters,
        profile: Profile,
        now: float,
        feedback: float,
        warn: Callable[[str], None],
    ) -> None:
        self.leg = Leg(Way.NONE, feedback, profile.position, now)
        self.latches = Latches(parameters)
        self.end = MechanicalEnd(parameters)
        self.approach = feedback
        self.index_margin: float | None = None
        self._parameters = parameters
        self._profile = profile
        self._dynamics: dict[Pace, Dynamics] = {
            row.motion.pace: Dynamics(*parameters.pace(row.motion.pace))
            for table in (parameters.procedure.rows, parameters.procedure.quick)
            for row in table.values()
        }
        self._warn = warn
        self._row: Row = parameters.procedure.rows[parameters.procedure.first]
        self._cause = Mark(feedback)
        self._own_event: Callable[[float, float, float], Found | Failure | None] | None = None
        self._further = False  # the homing reverse distance has a target
        self._gone = self._traveled = 0.0  # on the longest leg that has ended

    def heading(self, motion: Motion, reference: Mark | None) -> tuple[Way, float]:
        """Return which way a motion goes, and where to if it has a target."""
        position = self._profile.position
        if motion.kind is Kind.APPROACH:
            return motion.way, self.approach
        if motion.kind is not Kind.HOME or reference is None:
            return motion.way, position
        target = reference.position + self._parameters.home_shift_distance
        return Way(int(target > position) - int(target < position)), target

    def turns(self, way: Way) -> bool:
        """Return whether a motion that way begins a new leg."""
        return way is not Way.NONE and way != self.leg.way

    def turn(self, way: Way, now: float, feedback: float) -> None:
        """Begin a new leg."""
        self._gone = max(self._gone, self.leg.gone)
        self._traveled = max(self._traveled, self.leg.traveled)
        self.leg = Leg(way, feedback, self._profile.present, now, self.leg)
        self.latches.forget()

    def start(self, row: Row, cause: Mark, target: float) -> None:
        """Command the motion of a row.

        Args:
            row: the row.
            cause: where the event that led into the row was.
            target: where a motion to the home position goes.
        """
        self._row, self._cause, self._further = row, cause, False
        self._own_event = self._own_event_of(row)
        self.end.begin()
        motion, profile = row.motion, self._profile
        dynamics = self._dynamics[motion.pace]
        if motion.kind is Kind.REST:
            profile.stop()
        elif motion.kind in (Kind.HOME, Kind.APPROACH):
            profile.move(target, dynamics)
        elif motion.kind is Kind.SEARCH:
            profile.seek(motion.way * dynamics.velocity, dynamics)

    @property
    def stood(self) -> float:
        """How far the command went while the axis stood, m or rad; 0 of an axis that has moved."""
        gone = max(self._gone, self.leg.gone)
        moved = max(self._traveled, self.leg.traveled) > STANDS * gone
        return 0.0 if moved else gone

    def follow(self, feedback: float) -> None:
        """Move the turning point as long as the axis overruns it."""
        if self.leg.update(feedback, self._profile.present):
            self.latches.forget()

    def event(self, now: float, feedback: float, interval: float) -> Found | Failure | None:
        """Return the event that the motion has brought about, or why it never will.

        Args:
            now: the present time, s.
            feedback: the newest feedback.
            interval: the time between two readings of the feedback, s.
        """
        return None if self._own_event is None else self._own_event(now, feedback, interval)

    def _own_event_of(
        self, row: Row
    ) -> Callable[[float, float, float], Found | Failure | None] | None:
        """Return what looks for the event of a row's motion; None if only switches end it."""
        if row.motion.kind is Kind.SEARCH:
            if row.latches:
                return self._latched
            return self._end_detected if Event.END_DETECTED in row.on else None
        return {
            Kind.FURTHER: self._went_further,
            Kind.REST: self._rested,
            Kind.HOME: self._arrived,
            Kind.APPROACH: self._arrived,
        }[row.motion.kind]

    def _went_further(self, now: float, feedback: float, interval: float) -> Found | None:
        """Go on by the homing reverse distance; done at once if the axis cannot stop before."""
        if self._further:
            return self._arrived(now, feedback, interval)
        target = self._cause.position - self._parameters.homing_reverse_distance
        dynamics = self._dynamics[self._row.motion.pace]
        if self._profile.stopping_position(dynamics.deceleration) <= target:
            return Event.DONE, Mark(feedback)
        self._further = True
        self._profile.move(target, dynamics)
        return None

    def _rested(self, now: float, feedback: float, interval: float) -> Found | None:
        return self._arrived(now, feedback, interval) if self._cause.resolved else None

    def _arrived(self, now: float, feedback: float, interval: float) -> Found | None:
        return (Event.DONE, Mark(feedback)) if self._profile.done else None

    def _end_detected(self, now: float, feedback: float, interval: float) -> Found | None:
        if not self.end.found(self._profile.present, feedback, now, interval):
            return None
        return Event.END_DETECTED, self.end.find(feedback)

    def _latched(self, now: float, feedback: float, interval: float) -> Found | Failure | None:
        """Return the latch beyond the row's edge or, without one, beyond the turning point."""
        cause, way = self._cause, self._row.motion.way
        if not cause.resolved:
            return None
        armed_by_edge = isinstance(cause, Edge)
        origin = cause.position if armed_by_edge else self.leg.feedback
        found = self.latches.found(self._row.latches, origin, way, feedback)
        if found is None or isinstance(found, Failure):
            return found
        if found[0] is Event.Z_PULSE and armed_by_edge:
            return self._with_doubt(found, way)
        return found

    def _with_doubt(self, found: Found, way: Way) -> Found | Failure:
        """Return a Z-pulse with the doubt that its arming edge leaves, or why it cannot count."""
        edge, latches, action = self._cause, self.latches, self._parameters.index_margin_action
        self.index_margin = margin = latches.margin(edge.position, way)
        doubt = latches.doubt(edge, way)
        failure = None if margin is None else latches.margin_failure(margin)
        if failure is None and doubt:
            failure = latches.doubt_failure(edge, doubt)
        if failure is not None and action is IndexMarginAction.Fail:
            return failure
        if failure is not None and action is IndexMarginAction.Warn:
            self._warn(f'{failure.seen}; {failure.hint}')
        event, mark = found
        return event, Mark(mark.position, mark.uncertainty + doubt)
