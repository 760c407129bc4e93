# SPDX-License-Identifier: Apache-2.0
"""The switches of a gantry as one: levels and edges of all sides become those of the group.

A reference edge of the group is the edge of the side that comes last; home is the leader's own
edge. A switch is off when it is off on every side. Positions are in the *toward* frame, m or rad.
"""

from collections.abc import Iterable, Mapping
from typing import Generic, TypeVar

from ...procedures.states import Input
from ..signals import FINEST, Edge, Mark
from ..track import Track

#: One side of a gantry.
SideT = TypeVar('SideT')


class GroupLevel:
    """The level of an input of a gantry.

    Attributes:
        level: the level; None while that of a side is not known.
        last: whether the group is on only once every side is; else as soon as one is.
    """

    __slots__ = ('level', 'last')

    def __init__(self, levels: Iterable[bool | None], last: bool) -> None:
        """Take the levels at the start: on if any side is."""
        self.last = False
        self.level: bool | None = None
        self.update(levels)
        self.last = last

    def update(self, levels: Iterable[bool | None]) -> None:
        """Take the levels of all sides; between "all on" and "all off" the level stays."""
        known = list(levels)
        if None in known:
            self.level = None
        elif not any(known):
            self.level = False
        elif all(known) or not self.last:
            self.level = True


class GroupMark(Mark, Generic[SideT]):
    """The reference of a gantry; ``parts`` are the marks of the sides that have one."""

    __slots__ = ('parts',)

    def __init__(self, leader: Mark, parts: Mapping[SideT, Mark]) -> None:
        super().__init__(leader.position, leader.uncertainty)
        self.parts = parts


class GroupEdge(Edge, Generic[SideT]):
    """An edge of the group: the last side's time, the leader's position.

    Attributes:
        parts: the edge of each side.
    """

    __slots__ = ('parts', '_leaders')

    def __init__(
        self, source: Input, last: Edge, parts: Mapping[SideT, Edge], leader: SideT
    ) -> None:
        """Make the edge.

        Args:
            source: the input of the group.
            last: the edge that came last.
            parts: the edge of each side that has one.
            leader: the side whose place is the place of the edge. If it has no edge, the place is
                where it was at the time of the last one.
        """
        super().__init__(source, last.time, last.rises)
        self.opening, self.time, self.way = last.opening, last.time, last.way
        self.order = (self.time, last.order[1])
        self.parts = parts
        self._leaders = parts.get(leader)

    def refresh(self, track: Track) -> None:
        """Take the place from the leader's edge, or from its track if it has none."""
        own = self._leaders
        if own is None:
            self.locate(track)
            resolved = self.resolved
        else:
            self.position, self.uncertainty = own.position, own.uncertainty
            self.speed, resolved = own.speed, own.resolved
        self.resolved = resolved and all(edge.resolved for edge in self.parts.values())


class Captures(Generic[SideT]):
    """The edges of one switch that the sides have passed, going one way.

    Attributes:
        level: the level of the group, by its edges.
        sides: the sides that have this switch.
        way: the way in which the newest edge was passed.
    """

    def __init__(self, source: Input, levels: Mapping[SideT, bool], leader: SideT) -> None:
        """Begin with the levels of the sides: the group is on if any of them is."""
        self.sides = tuple(levels)
        self.level = any(levels.values())
        self._source, self._leader = source, leader
        self._on = dict(levels)
        self._rises: dict[SideT, Edge] = {}
        self._falls: dict[SideT, Edge] = {}
        self.way = 0

    def add(self, side: SideT, edge: Edge) -> GroupEdge[SideT] | None:
        """Take the edge of a side; return the edge of the group that it completes.

        The first rise of a side counts, as the edge is captured there, and the last fall: a fall
        before it was a bounce.
        """
        self._on[side] = edge.rises
        if edge.way and edge.way != self.way:
            self.way = edge.way
            self.forget()
        if edge.rises:
            self._rises.setdefault(side, edge)
            self._falls.pop(side, None)
        else:
            self._falls[side] = edge
        all_on = all(one in self._rises or self._on[one] for one in self.sides)
        if not self.level and edge.rises and all_on:
            self.level = True
            return self._group(edge, self._rises)
        if self.level and not any(self._on.values()):
            self.level = False
            group = self._group(edge, self._falls)
            self._rises.clear()
            return group
        return None

    def _group(self, last: Edge, parts: Mapping[SideT, Edge]) -> GroupEdge[SideT]:
        return GroupEdge(self._source, last, dict(parts), self._leader)

    def forget(self) -> None:
        """Forget the edges, because the axis has turned."""
        self._rises.clear()
        self._falls.clear()

    def note(self, side: SideT, edge: Edge) -> None:
        """Take the level of a side that has moved alone: its edge is none of the group."""
        self._on[side] = edge.rises
        if len(set(self._on.values())) == 1:
            self.level = edge.rises

    def not_before(self, rises: bool, way: int) -> list[SideT]:
        """Return which sides do not stand before their reference, and have not captured it.

        Args:
            rises: the reference is a rise, else a fall.
            way: which way it is passed: an edge the other way is another one.
        """
        captured = (self._rises if rises else self._falls) if self.way == way else {}
        return [one for one in self.sides if self._on[one] is rises and one not in captured]

    @property
    def agree(self) -> bool:
        """Whether no side waits for another one."""
        if self._rises or self._falls:
            return False
        return not self.level or all(self._on.values())

    def pending(self, rises: bool) -> tuple[Edge, SideT, list[SideT]] | None:
        """Return the first edge of a group's edge that is not complete, its side, who is missing.

        ``rises``: the group waits for a rise, whatever its level is.
        """
        if not self.level or (rises and self._rises):
            came, missing = self._rises, [one for one in self.sides if one not in self._rises]
        else:
            came, missing = self._falls, [one for one in self.sides if self._on[one]]
        if not came or not missing:
            return None
        first = min(came, key=lambda side: came[side].time)
        return came[first], first, missing

    @property
    def stuck(self) -> list[SideT]:
        """The sides that are on, if others are off and none has passed an edge."""
        on = [side for side in self.sides if self._on[side]]
        if not self.level or self._rises or self._falls or len(on) == len(self.sides):
            return []
        return on


def least_uncertainty(mark: Mark, resolution: float) -> float:
    """Return how far a place may be off; a latched one is no better than the feedback."""
    return max(mark.uncertainty, FINEST if isinstance(mark, Edge) else resolution)
