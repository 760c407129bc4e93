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

from .path import Piece, State, state_at

#: A point stands at a change of jerk unless another point is as near as this, s.
CLOSE = 2e-5
NS = 1_000_000_000


class Course(NamedTuple):
    """What one joint does: its path, the time of the present on it, and how that is raw.

    Raw is ``sign`` times the position, and ``offset`` more: whole turns of a wrapped joint.
    """

    present: float
    pieces: Sequence[Piece]
    sign: float = 1.0
    offset: float = 0.0


class Announcement(NamedTuple):
    """Points common to some joints: times in ns from the present, and a row of states each."""

    times: list[int]
    rows: list[list[State]]


def least_horizon(period: float, lead: float) -> float:
    """Return how far the plan must be told at least, s: until two messages later."""
    return lead + 3.0 * period


def announcement(courses: Sequence[Course], period: float, horizon: float) -> Announcement:
    """Return the points for some joints; none lies before the run of any has begun."""
    first = max(0.0, min(course.pieces[0].time - course.present for course in courses))
    times = _grid(first, period, horizon)
    changes = sorted(
        {
            ceil((piece.time - course.present) * NS)
            for course in courses
            for piece in course.pieces[1:]
            if piece.time - course.present > first
        }
    )
    times = _merged(times, changes)
    seconds = [time / NS for time in times]
    columns = [_column(course, seconds) for course in courses]
    return Announcement(times, [list(row) for row in zip(*columns, strict=True)])


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


def _column(course: Course, times: Sequence[float]) -> list[State]:
    present, pieces, sign, offset = course
    states = [state_at(pieces, present + time) for time in times]
    if sign > 0.0 and not offset:
        return states
    return [(sign * p + offset, sign * v, sign * a) for p, v, a in states]
