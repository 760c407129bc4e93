# SPDX-License-Identifier: Apache-2.0
"""The points of a trajectory that tells a controller what comes: plan, horizon, stop to rest.

The points stand at the cycle's period from the present up to the horizon, and wherever the jerk
changes; quintics through them are then the path itself. The last point is at rest. Times are
relative to the present; SI units.

A later plan may leave the points of an earlier message. Both begin at the newest command of the
earlier one at the soonest; with d s from there to a point and the jerk j of the axis they differ
by no more than j d^3 / 3 (j d^3 / 6 where the axis did not accelerate).
"""

from collections.abc import Sequence
from math import ceil
from typing import NamedTuple

from .path import Piece, State, Stop, state_at

#: A point stands at a change of jerk unless another point is as near as this, s.
CLOSE = 2e-5
NS = 1_000_000_000


class Row(NamedTuple):
    """A point: the position, the velocity and the acceleration of each joint."""

    positions: Sequence[float]
    velocities: Sequence[float]
    accelerations: Sequence[float]


class Course(NamedTuple):
    """What one joint does: the present, its path, the stop after that, and how these are raw.

    Raw is ``sign`` times the position, and ``offset`` more: whole turns of a wrapped joint.
    """

    present: float
    pieces: Sequence[Piece]
    stop: Stop
    sign: float = 1.0
    offset: float = 0.0

    @property
    def path(self) -> list[Piece]:
        """The path with its stop."""
        return [*self.pieces, *self.stop.path()]

    @property
    def start(self) -> float:
        """The raw position at present."""
        return self.sign * state_at(self.pieces, self.present)[0] + self.offset

    @property
    def steady(self) -> bool:
        """Whether the velocity is constant from the present up to the stop."""
        last = self.pieces[-1]
        return last.time <= self.present and not (last.acceleration or last.jerk)


class Announcement(NamedTuple):
    """Points common to some joints: their times in ns from the present, and a row for each."""

    times: list[int]
    rows: list[Row]


def least_horizon(period: float, lead: float) -> float:
    """Return how far the plan must be told at least, s: until two messages later."""
    return lead + 3.0 * period


class Announcer:
    """Finds the points of each cycle.

    While all joints keep their velocities, every message has the shape of the one before, further
    by what they moved; a search consists of such cycles for the greatest part. Then only positions
    are computed, which takes a fifth of the time (doc/decisions/0007-cycle.md).
    """

    def __init__(self, period: float, horizon: float) -> None:
        """Keep the period of the cycle and the horizon, s."""
        self._period, self._horizon = period, horizon
        self._stops: list[tuple[Sequence[Piece], float]] = []  # that the shape was made for
        self._times: list[int] = []
        self._shape: list[Row] = []  # its positions are relative to the present

    def points(self, courses: Sequence[Course]) -> Announcement:
        """Return the points for some joints, as `announcement` does."""
        if not all(course.steady for course in courses):
            return announcement(courses, self._period, self._horizon)
        stops = [(course.stop.pieces, course.sign) for course in courses]
        starts = [course.start for course in courses]
        if stops != self._stops:
            self._times, rows = announcement(courses, self._period, self._horizon)
            self._shape = [row._replace(positions=_less(row.positions, starts)) for row in rows]
            self._stops = stops
        rows = [
            Row([start + ahead for start, ahead in zip(starts, p, strict=True)], v, a)
            for p, v, a in self._shape
        ]
        return Announcement(self._times, rows)


def announcement(courses: Sequence[Course], period: float, horizon: float) -> Announcement:
    """Return the points for some joints; none lies before the run of any has begun."""
    paths = [course.path for course in courses]
    begins = zip(courses, paths, strict=True)
    first = max(0.0, min(path[0].time - course.present for course, path in begins))
    times = _grid(first, period, horizon)
    changes = sorted(
        {
            ceil((piece.time - course.present) * NS)
            for course, path in zip(courses, paths, strict=True)
            for piece in path[1:]
            if piece.time - course.present > first
        }
    )
    times = _merged(times, changes)
    seconds = [time / NS for time in times]
    columns = [_column(course, path, seconds) for course, path in zip(courses, paths, strict=True)]
    rows = [Row._make(zip(*states, strict=True)) for states in zip(*columns, strict=True)]
    return Announcement(times, rows)


def _grid(first: float, period: float, horizon: float) -> list[int]:
    """Return the times of the plan's points, from the first to the horizon, ns."""
    begin = ceil(first / period - 1e-6)
    grid = [round(k * period * NS) for k in range(begin, ceil(horizon / period - 1e-6) + 1)]
    start = round(first * NS)
    return grid if grid[0] - start < CLOSE * NS else [start, *grid]


def _merged(grid: list[int], changes: list[int]) -> list[int]:
    """Return the grid with the changes of jerk that are not close to another point."""
    close = round(CLOSE * NS)
    times = sorted([*grid, *(c for c in changes if all(abs(c - g) > close for g in grid))])
    merged = times[:1]
    for time in times[1:]:
        if time - merged[-1] > close:
            merged.append(time)
    if changes and changes[-1] > merged[-1]:  # the last point is at rest
        merged[-1] = changes[-1]
    return merged


def _column(course: Course, path: Sequence[Piece], times: Sequence[float]) -> list[State]:
    states = [state_at(path, course.present + time) for time in times]
    sign, offset = course.sign, course.offset
    if sign > 0.0 and not offset:
        return states
    return [(sign * p + offset, sign * v, sign * a) for p, v, a in states]


def _less(positions: Sequence[float], starts: Sequence[float]) -> list[float]:
    return [position - start for position, start in zip(positions, starts, strict=True)]
