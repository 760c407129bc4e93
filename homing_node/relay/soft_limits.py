# SPDX-License-Identifier: Apache-2.0
"""Whether a trajectory stays within soft limits, between its points too.

A controller joins two points by a line, by a cubic where they have velocities, by a quintic where
they also have accelerations. Such a curve lies within the hull of its Bezier points; where the
hull crosses a limit the curve is cut in two, until that is decided. Positions in m or rad, times
in s.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from ..parameters.definition import Interval

#: So often a curve is cut in two: its parts are then a millionth of it.
CUTS = 20
#: A position so far beyond a limit is none, m or rad: a planner computes its points with rounding.
SLACK = 1e-9


class Knot(NamedTuple):
    """A point of one joint: its time, position, and what is known of velocity, acceleration."""

    time: float
    position: float
    velocity: float | None = None
    acceleration: float | None = None


def beyond(knots: Sequence[Knot], limits: Interval) -> float | None:
    """Return a position of a course that is beyond the limits, None if it stays within them.

    What is beyond by no more than SLACK is rounded.
    """
    limits = Interval(limits.low - SLACK, limits.high + SLACK)
    for knot in knots:
        if not limits.low <= knot.position <= limits.high:
            return knot.position
    for one, other in pairwise(knots):
        found = _beyond(bezier(one, other), limits, CUTS)
        if found is not None:
            return found
    return None


def bezier(one: Knot, other: Knot) -> list[float]:
    """Return the Bezier points of the curve by which a controller joins two points."""
    p, q, t = one.position, other.position, other.time - one.time
    if one.velocity is None or other.velocity is None or t <= 0.0:
        return [p, q]
    v, w = one.velocity * t, other.velocity * t
    if one.acceleration is None or other.acceleration is None:
        return [p, p + v / 3.0, q - w / 3.0, q]
    a, b = one.acceleration * t * t, other.acceleration * t * t
    return [
        p,
        p + v / 5.0,
        p + 2.0 * v / 5.0 + a / 20.0,
        q - 2.0 * w / 5.0 + b / 20.0,
        q - w / 5.0,
        q,
    ]


def _beyond(points: list[float], limits: Interval, cuts: int) -> float | None:
    if limits.low <= min(points) and max(points) <= limits.high:
        return None
    for end in (points[0], points[-1]):
        if not limits.low <= end <= limits.high:
            return end
    if not cuts:
        return None
    left, right, row = [], [], points
    while row:
        left.append(row[0])
        right.append(row[-1])
        row = [0.5 * (a + b) for a, b in pairwise(row)]
    found = _beyond(left, limits, cuts - 1)
    return _beyond(right[::-1], limits, cuts - 1) if found is None else found
