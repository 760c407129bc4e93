# SPDX-License-Identifier: Apache-2.0
"""Rehearses one axis: a run and what it says, or runs from everywhere."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import isfinite
from time import perf_counter
from types import MappingProxyType
from typing import NamedTuple

from ..course import Course
from ..parameters.axis import AxisParameters
from ..plant.geometry import Geometry, true_home
from ..plant.layout import AxisLayout
from ..plant.timing import Timing
from ..procedures.states import Input, State
from .gantry import Followers, GantryRehearsal
from .link import PLANT_STEP, Transport
from .run import Rehearsal

#: What computing rounds, m or rad: a home that is off by less than this is right.
ROUNDING = 1e-9

NOT_A_GANTRY: Mapping[str, float] = MappingProxyType({})
NO_FOLLOWERS: Followers = MappingProxyType({})


class Stretch(NamedTuple):
    """What the axis did in one home state: times in s since the run began, raw positions."""

    state: str
    begin: float
    end: float
    origin: float
    target: float


class Trial(NamedTuple):
    """A rehearsed run.

    ``start`` and ``true_home`` are raw positions (None: not known), ``hits`` the hard stop that
    the axis ran into with the command going on (None: none), ``took`` what the rehearsal took, s.
    ``askew``: how far each follower of a gantry is ahead of where it is square, at the end, by
    full names, as far as that is known.
    """

    start: float
    course: Course
    true_home: float | None
    hits: float | None
    took: float
    askew: Mapping[str, float] = NOT_A_GANTRY

    @property
    def success(self) -> bool:
        homed = bool(self.course.outcome and self.course.outcome.success)
        return homed and self.hits is None and not self.wrong_home and not self.not_square

    @property
    def not_square(self) -> bool:
        """Whether a follower that is told to be square is further off than that may be."""
        outcome = self.course.outcome
        if outcome is None or not outcome.success:
            return False
        told = {member.name: member for member in outcome.members}
        return any(
            abs(off + told[short].squareness) > told[short].uncertainty + ROUNDING
            for short, off in ((name.rpartition('.')[2], off) for name, off in self.askew.items())
        )

    @property
    def wrong_home(self) -> bool:
        """Whether home is further from the true one than its uncertainty."""
        outcome, off = self.course.outcome, self.off
        if outcome is None or off is None:
            return False
        return abs(off) > outcome.uncertainty + ROUNDING

    @property
    def error(self) -> str:
        """Why it failed, '' where it did not."""
        if self.hits is not None:
            return 'hard stop'
        if self.wrong_home:
            return 'wrong home'
        if self.not_square:
            return 'not square'
        return '' if self.success or not self.course.outcome else str(self.course.outcome.error)

    @property
    def off(self) -> float | None:
        """How far the home position is from the true one, along raw; None where unknown."""
        outcome = self.course.outcome
        if outcome is None or not outcome.success or self.true_home is None:
            return None
        return outcome.home_position_raw - self.true_home

    @property
    def speed(self) -> float:
        """How many times faster than the real thing the rehearsal was."""
        return self.course.duration / self.took if self.took else 0.0

    @property
    def stretches(self) -> list[Stretch]:
        """The home states in order."""
        found: list[Stretch] = []
        begin = self.course.samples[0].time if self.course.samples else 0.0
        for sample in self.course.samples:
            time = sample.time - begin
            if not found or found[-1].state != sample.state:
                found.append(Stretch(sample.state, time, time, sample.feedback, sample.feedback))
            found[-1] = found[-1]._replace(end=time, target=sample.feedback)
        return [stretch for stretch in found if stretch.state != State.Idle]


def transport_of(timing: Timing) -> Transport:
    """Return how messages travel in a rehearsal; rates become divisors of the plant's 1 kHz."""
    return Transport(
        _divisor(timing.update_rate),
        _divisor(timing.feedback_rate or timing.update_rate),
        timing.latency,
        timing.latency,
        timing.latency,
    )


def _divisor(rate: float) -> float:
    return 1.0 / (PLANT_STEP * max(1, round(1.0 / (rate * PLANT_STEP))))


def rehearse_from(
    parameters: AxisParameters,
    layout: AxisLayout,
    transport: Transport,
    start: float | None = None,
    axis: str = 'x',
    followers: Followers = NO_FOLLOWERS,
) -> Trial:
    """Rehearse one run; its servos are on, and ``pause_mode`` does not pause it.

    The drivers of the switches publish as the layout (``switch_rate``) and the parameters
    (``switch_latency``) say. ``axis`` is what messages call the axis; ``followers`` has the
    parameters of those of a gantry, by full names.

    Raises ValueError for a start beyond a hard stop.
    """
    begin = perf_counter()
    own = {
        name: _as_told(transport, layout.followers[name], followers[name]) for name in followers
    }
    transport = _as_told(transport, layout, parameters)
    parameters = replace(parameters, pause_mode=False)
    made = (
        GantryRehearsal(axis, parameters, followers, layout, transport, start, own)
        if followers
        else Rehearsal(parameters, layout, transport, start)
    )
    made.axis.name = axis
    for drive in made.drives.values():
        if Input.SERVO_ENABLED in drive.parameters.inputs:
            drive.enable(True)
    course = made.home()
    took = perf_counter() - begin
    start = layout.start if start is None else start
    home = true_home(Geometry(parameters, layout), start)
    hits = None if parameters.homes_on_mechanical_end else _hard_stop(course, layout)
    if not isinstance(made, GantryRehearsal):
        return Trial(start, course, home, hits, took)
    for name, other in course.followers.items():
        hits = _hard_stop(other, layout.followers[name]) if hits is None else hits
    return Trial(start, course, home, hits, took, dict(_askew(made, followers, layout, home)))


def _as_told(transport: Transport, layout: AxisLayout, parameters: AxisParameters) -> Transport:
    """Return how the messages of a drive travel, as its layout and its parameters say."""
    return replace(
        transport,
        poll_rate=layout.switch_rate or transport.poll_rate,
        stamp_late=transport.stamp_late + parameters.switch_latency,
    )


def _askew(
    made: GantryRehearsal, followers: Followers, layout: AxisLayout, home: float | None
) -> Iterator[tuple[str, float]]:
    """Yield how far each follower is ahead of where its switch says that it is square."""
    leader = made.plant.position
    for name, parameters in followers.items():
        side, where = made.gantry.sides[name], layout.followers[name]
        own = true_home(Geometry(parameters, where), where.start)
        if home is not None and own is not None:
            apart = side.sign * own - home - parameters.switch_offset
            yield name, side.sign * side.position - leader - apart


def _hard_stop(course: Course, layout: AxisLayout) -> float | None:
    """Return the hard stop at which the axis stood while its command went on."""
    low, high = layout.hard_stops
    for sample in course.samples:
        if sample.feedback <= low and sample.position < low:
            return low
        if sample.feedback >= high and sample.position > high:
            return high
    return None


def starts(parameters: AxisParameters, layout: AxisLayout, count: int) -> list[float]:
    """Return start positions over the travel, raw; where it is not known, around the start."""
    low, high = layout.hard_stops
    if not isfinite(low):
        low = (
            high - parameters.travel if isfinite(high) else (layout.start - parameters.travel / 2)
        )
    if not isfinite(high):
        high = low + parameters.travel
    for other in layout.followers.values():  # it moves along, as skewed as it is
        sign = -1.0 if other.mirrored else 1.0
        ends = sorted(layout.start + sign * (stop - other.start) for stop in other.hard_stops)
        low, high = max(low, ends[0]), min(high, ends[1])
    between = [low + (high - low) * n / (count - 1) for n in range(count - 1)]
    return [*between, high]


def sweep(
    parameters: AxisParameters,
    layout: AxisLayout,
    transport: Transport,
    positions: Sequence[float],
    axis: str = 'x',
    done: Callable[[], None] = lambda: None,
    followers: Followers = NO_FOLLOWERS,
) -> Iterator[Trial]:
    """Rehearse a run from every start position; ``done`` is called after each."""
    for position in positions:
        yield rehearse_from(parameters, layout, transport, position, axis, followers)
        done()
