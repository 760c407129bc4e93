# SPDX-License-Identifier: Apache-2.0
"""Rehearses one axis: a run and what it says, or runs from everywhere."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import isfinite
from time import perf_counter
from typing import NamedTuple

from ..course import Course
from ..parameters.axis import AxisParameters
from ..plant.geometry import Geometry, true_home
from ..plant.layout import AxisLayout
from ..plant.timing import Timing
from ..procedures.states import Input, State
from .run import PLANT_STEP, Rehearsal, Transport

#: What computing rounds, m or rad: a home that is off by less than this is right.
ROUNDING = 1e-9


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
    """

    start: float
    course: Course
    true_home: float | None
    hits: float | None
    took: float

    @property
    def success(self) -> bool:
        homed = bool(self.course.outcome and self.course.outcome.success)
        return homed and self.hits is None and not self.wrong_home

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
) -> Trial:
    """Rehearse one run; its servo is on, and ``pause_mode`` does not pause it.

    The drivers of the switches publish as the layout (``switch_rate``) and the parameters
    (``switch_latency``) say. ``axis`` is what messages call the axis.

    Raises ValueError for a start beyond a hard stop.
    """
    begin = perf_counter()
    transport = replace(
        transport,
        poll_rate=layout.switch_rate or transport.poll_rate,
        stamp_late=transport.stamp_late + parameters.switch_latency,
    )
    rehearsal = Rehearsal(replace(parameters, pause_mode=False), layout, transport, start)
    rehearsal.axis.name = axis
    if Input.SERVO_ENABLED in parameters.inputs:
        rehearsal.axis.enable(True)
    course = rehearsal.home()
    took = perf_counter() - begin
    start = layout.start if start is None else start
    hits = None if parameters.homes_on_mechanical_end else _hard_stop(course, layout)
    return Trial(start, course, true_home(Geometry(parameters, layout), start), hits, took)


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
    between = [low + (high - low) * n / (count - 1) for n in range(count - 1)]
    return [*between, high]


def sweep(
    parameters: AxisParameters,
    layout: AxisLayout,
    transport: Transport,
    positions: Sequence[float],
    axis: str = 'x',
    done: Callable[[], None] = lambda: None,
) -> Iterator[Trial]:
    """Rehearse a run from every start position; ``done`` is called after each."""
    for position in positions:
        yield rehearse_from(parameters, layout, transport, position, axis)
        done()
