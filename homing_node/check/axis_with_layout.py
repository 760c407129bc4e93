# SPDX-License-Identifier: Apache-2.0
"""One axis with its layout: what stops each search, where, and how far the axis goes on.

Everything is in the toward frame and along the way of a search; see geometry.py.
"""

from collections.abc import Callable, Iterator
from functools import partial
from math import inf
from typing import NamedTuple

from ..core.limits import Limit, limits_of
from ..parameters.axis import AxisParameters
from ..plant.geometry import Geometry, place_of
from ..plant.layout import AxisLayout
from ..plant.timing import Timing
from ..procedures.events import Event
from ..procedures.motions import Kind, Way
from ..procedures.procedure import Row
from ..procedures.states import HomeType, Input, LimitPair, Role
from ..procedures.steps import Step
from .axis_check import AxisCheck
from .finding import Finding, Severity, down
from .stopping import fastest, reaction_distance, stopping_distance, turning_distance

Distance = Callable[[float], float]

SIDES = {Way.TOWARD: 'ahead', Way.AWAY: 'behind'}


class Stop(NamedTuple):
    """What stops or turns the axis in a search: where, and how far it goes on at a velocity.

    ``name`` tells what happens there, ``limit`` is None where it is not a limit switch. ``braked``
    is how far an axis goes on that another stop already brakes; None: this one does not brake it.
    """

    name: str
    place: float
    overrun: Distance
    limit: Limit | None = None
    braked: Distance | None = None

    @property
    def coasts(self) -> bool:
        """Whether it switches the servo off and leaves the axis to itself."""
        limit = self.limit
        return (
            limit is not None
            and limit.role is Role.NORMAL
            and limit.action is not None
            and limit.action.deceleration is None
        )

    def velocity(self, room: float, at_most: float) -> float:
        """Return the largest velocity whose overrun stays within a room."""
        return fastest(self.overrun, room, at_most)


class AxisWithLayout(AxisCheck):
    """A check of one axis with its layout; each check that needs the layout derives from it."""

    def __init__(
        self, axis: str, parameters: AxisParameters, layout: AxisLayout, timing: Timing
    ) -> None:
        super().__init__(axis, parameters, timing)
        self.layout = layout
        self.at = Geometry(parameters, layout)
        self.limits = limits_of(parameters)
        self.delay = timing.reaction(parameters, layout.lag) + layout.switch_period

    def found(
        self,
        severity: Severity,
        check: str,
        what: str,
        why: str,
        parameter: str = '',
        value: float | str | None = None,
        right: float | str | bool | None = None,
        unit: str = 'm',
    ) -> Finding:
        """Return a finding about this axis; most are about a position or a distance."""
        return super().found(severity, check, what, why, parameter, value, right, unit)

    def shorter(self, row: Row, one: Stop, room: float) -> tuple[str, float | None, str]:
        """Return what makes a stop end within a room: the parameter, its value and unit."""
        slower = down(one.velocity(room, self.p.pace(row.motion.pace)[0]))
        if slower or room <= 0.0:
            return str(row.motion.pace), slower or None, 'm/s'
        return 'homing_reverse_distance', down(room), 'm'

    def with_home_switch(self, home_type: HomeType) -> str | None:
        """Return a home type that needs a home switch, where there is one."""
        return str(home_type) if Input.HOME_SWITCH in self.p.switches else None

    def raw(self, place: float, way: Way) -> float:
        """Return a place along a way as a raw position."""
        return self.at.raw(way * place)

    def first_limits(self, way: Way) -> list[float]:
        """Return where the limit switches that steer or stop a search rise, along a way."""
        return [
            flag.enters(way)
            for name, limit in self.limits.items()
            if limit.way is way
            and self.acts(limit)
            and (flag := self.at.flags.get(name)) is not None
        ]

    @staticmethod
    def acts(limit: Limit) -> bool:
        """Tell whether a limit switch steers or stops a search toward it."""
        return limit.role is not Role.IGNORED and bool(
            limit.action or limit.role is not Role.NORMAL
        )

    def limit_stops(self, row: Row) -> Iterator[Stop]:
        """Yield where the limit switches on a row's way stop or turn the axis."""
        p, way = self.p, row.motion.way
        for name, limit in self.limits.items():
            flag = self.at.flags.get(name)
            if limit.way is not way or flag is None or not self.acts(limit):
                continue
            target = p.procedure.target is limit.pair
            event = Event.LS_RISES if target else Event.LIMIT_AHEAD
            place = flag.enters(way)
            steers = event in row.on and limit.role in (Role.REFERENCE, Role.REVERSAL)
            stopped = self.late(row, place, self._stopped(limit))
            stops: list[Distance] = []
            if steers and not p.immediate_stop_at_ls:
                stops.append(self.late(row, place, self.braking(row, row.on[event])))
            elif steers:
                stops.append(self._frozen)
            if limit.role is not Role.REFERENCE:  # a second reversal ends the run, too
                stops.append(stopped)
            yield Stop(
                f'{name.text} rises',
                place,
                partial(_longest, stops),
                limit,
                self.late(row, place, self._braked(limit)) if limit.action else None,
            )

    def event_stops(self, step: Step, row: Row) -> Iterator[Stop]:
        """Yield where the edges that a row waits for stop or turn the axis."""
        way, p = row.motion.way, self.p
        for event, then in row.on.items():
            if event in (Event.LS_RISES, Event.LS_ON, Event.HS_ON):
                continue
            motion = p.procedure.rows[then].motion
            goes_on = motion.kind is Kind.SEARCH and motion.way is way
            place = place_of(self.at, event, step, row)
            if place is not None and not goes_on:
                further = motion.kind is Kind.FURTHER
                # Where the edge was is known when the feedback behind it has come.
                wait = self.timing.feedback_period if further else 0.0
                overrun = self.late(row, place, self.braking(row, then), wait)
                if further:
                    done = p.procedure.rows[then].on[Event.DONE]
                    turn = self.late(row, place, self.braking(row, done), wait)
                    overrun = partial(_further, p.homing_reverse_distance, overrun, turn)
                yield Stop(str(event), place, overrun)

    def braking(self, row: Row, step: Step) -> Distance:
        """Return how far the axis goes on, for its velocity, on the way into a step."""
        p, motion, pace = self.p, self.p.procedure.rows[step].motion, row.motion.pace
        _, acceleration, deceleration = p.pace(pace)
        if motion.kind is not Kind.SEARCH or motion.way is row.motion.way:
            return partial(stopping_distance, deceleration=deceleration, jerk=p.max_jerk)
        back, back_acceleration, _ = p.pace(motion.pace)
        return lambda v: turning_distance(
            v,
            v if motion.pace is pace else back,
            acceleration,
            deceleration,
            p.max_jerk,
            back_acceleration,
        )

    def late(self, row: Row, place: float, stop: Distance, wait: float = 0.0) -> Distance:
        """Return how far a stop goes from a place along a row's way if it begins late.

        ``wait`` is what passes besides the time to react, s.
        Going toward, a run may begin anywhere, so that the axis still accelerates when it comes
        to the place; going away, it begins at a switch.
        """
        _, acceleration, _ = self.p.pace(row.motion.pace)
        jerk, delay = self.p.max_jerk, self.delay + wait
        room = place - self._begin_away if row.motion.way is Way.AWAY else 0.0

        def distance(velocity: float) -> float:
            steady = room >= stopping_distance(velocity, acceleration, jerk)
            gone = (
                velocity * delay
                if steady
                else reaction_distance(velocity, acceleration, jerk, delay)
            )
            return gone + stop(velocity)

        return distance

    @property
    def _begin_away(self) -> float:
        """The furthest place away, along that way, where the axis turns to it."""
        used = self.p.procedure.inputs
        begins = [
            flag.low
            for flag in (self.at.target, self.at.flags.get(Input.HOME_SWITCH))
            if flag and (flag is self.at.target or Input.HOME_SWITCH in used)
        ]
        if self.p.homes_on_mechanical_end:
            begins = [self.at.stops[Way.TOWARD]]
        return -min(begins, default=-inf)

    def _stopped(self, limit: Limit) -> Distance:
        """Return how far the action of a limit switch lets the axis go on."""
        deceleration = limit.action.deceleration if limit.action else self.p.ls_dec
        if deceleration is None:  # the servo is off
            return lambda v: 0.0
        return partial(stopping_distance, deceleration=deceleration, jerk=self.p.max_jerk)

    def _braked(self, limit: Limit) -> Distance:
        """Return how far a limit switch lets an axis go on that brakes already."""
        assert limit.action is not None
        deceleration = limit.action.deceleration or self.p.ls_dec
        return partial(stopping_distance, deceleration=deceleration, jerk=self.p.max_jerk)

    def _frozen(self, velocity: float) -> float:
        return velocity * self.delay


def _further(reverse: float, stop: Distance, turn: Distance, velocity: float) -> float:
    """Return how far the axis goes to go on by the homing reverse distance.

    Where it cannot rest within that, it turns at once.
    """
    return reverse if stop(velocity) < reverse else max(stop(velocity), turn(velocity))


def _longest(distances: list[Distance], velocity: float) -> float:
    return max(distance(velocity) for distance in distances)


def ls_type_of(limit: Limit) -> str:
    """Return the parameter that tells what a limit switch does."""
    return 'ls_type' if limit.pair is LimitPair.HARDWARE else f'{limit.pair}_ls_type'
