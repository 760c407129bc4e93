# SPDX-License-Identifier: Apache-2.0
"""Where the edges of one switch are, and how late its driver is, from passes at two velocities.

An edge that is met at velocity v is seen at ``place + v * delay``, give or take its uncertainty;
v has a sign, and the delay is the same for all edges of a switch. Every pair (place, delay) that
fits all passes is possible. An edge that is met while the velocity changes is seen somewhere
between its place and that; it counts where no better one is. The intervals here are all possible
values. Units: m or rad, s.
"""

from collections.abc import Mapping, Sequence
from math import inf
from typing import NamedTuple

from .passes import SeenEdge

#: The driver of a switch is no later than this, s.
LONGEST_DELAY = 0.1
#: Halvings of an interval.
HALVINGS = 40


class Range(NamedTuple):
    """All possible values of a number."""

    low: float
    high: float

    @property
    def middle(self) -> float:
        return 0.5 * (self.low + self.high)

    @property
    def half(self) -> float:
        """How far the middle may be off."""
        return 0.5 * (self.high - self.low)

    def minus(self, other: 'Range') -> 'Range':
        return Range(self.low - other.high, self.high - other.low)

    def hull(self, other: 'Range') -> 'Range':
        return Range(min(self.low, other.low), max(self.high, other.high))

    def common(self, other: 'Range') -> 'Range | None':
        low, high = max(self.low, other.low), min(self.high, other.high)
        return Range(low, high) if low <= high else None


class Kind(NamedTuple):
    """An edge's level after the change, and the way on which it was met (1 or -1)."""

    level: bool
    way: int


class Fit(NamedTuple):
    """What fits all passes over one switch.

    Attributes:
        places: Where each edge is.
        delay: How late its driver is, beyond what the node takes off already, s.
        spread: By which factor the edges are less exact than they say; 1: they are not.
    """

    places: Mapping[Kind, Range]
    delay: Range
    spread: float


def kinds_of(edges: Sequence[SeenEdge]) -> dict[Kind, list[SeenEdge]]:
    """Sort edges by their kind."""
    found: dict[Kind, list[SeenEdge]] = {}
    for edge in edges:
        found.setdefault(Kind(edge.level, edge.way), []).append(edge)
    return found


def fit(
    edges: Sequence[SeenEdge], ramps: Sequence[SeenEdge] = (), least_delay: float = 0.0
) -> Fit:
    """Return what fits all edges of one switch.

    Args:
        edges: The edges; those of one kind are met at one place.
        ramps: Edges that were met while the velocity changed; theirs is the largest of the pass.
        least_delay: The smallest delay, s; < 0 where the node takes off one that may be too long.
    """
    kinds = kinds_of(edges)
    low, high = 1.0, 1.0
    while (delay := _delay(kinds, least_delay, high)) is None:
        low, high = high, 2.0 * high
    for _ in range(HALVINGS if high > 1.0 else 0):
        middle = 0.5 * (low + high)
        found = _delay(kinds, least_delay, middle)
        if found is None:
            low = middle
        else:
            high, delay = middle, found
    places = {
        kind: _place(seen, delay.low, high).hull(_place(seen, delay.high, high))
        for kind, seen in kinds.items()
    }
    for kind, seen in kinds_of(ramps).items():
        if kind not in places:
            ends = [_place(seen, late, high) for late in (delay.low, 0.0, delay.high)]
            places[kind] = Range(min(one.low for one in ends), max(one.high for one in ends))
    return Fit(places, delay, high)


def _delay(kinds: Mapping[Kind, Sequence[SeenEdge]], least: float, spread: float) -> Range | None:
    """Return the delays with which all edges fit, None if there is none."""
    delay = Range(least, LONGEST_DELAY)
    for seen in kinds.values():
        for first in seen:
            for second in seen:
                faster = abs(first.velocity) - abs(second.velocity)
                doubt = spread * (first.uncertainty + second.uncertainty)
                later = (first.position - second.position) * first.way
                if faster == 0.0 and abs(later) > doubt:
                    return None
                if faster > 0.0:
                    possible = Range((later - doubt) / faster, (later + doubt) / faster)
                    common = delay.common(possible)
                    if common is None:
                        return None
                    delay = common
    return delay


def _place(seen: Sequence[SeenEdge], delay: float, spread: float) -> Range:
    """Return where an edge can be, with a delay."""
    low, high = -inf, inf
    for edge in seen:
        place, doubt = edge.position - edge.velocity * delay, spread * edge.uncertainty
        low, high = max(low, place - doubt), min(high, place + doubt)
    return Range(min(low, high), max(low, high))
