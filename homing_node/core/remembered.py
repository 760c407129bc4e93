# SPDX-License-Identifier: Apache-2.0
"""What a run may know from earlier runs, and what it has seen itself."""

from typing import NamedTuple

from ..procedures.events import Event
from ..procedures.procedure import Procedure
from ..procedures.states import Input
from ..procedures.steps import Step
from .signals import Edge, Mark

#: A run keeps no more edges than these, and no more latches: a contact may bounce for ever.
MOST_SEEN = 100


class QuickWay(NamedTuple):
    """How a quick run begins.

    Attributes:
        step: its first step.
        approach: where it goes quickly, m or rad.
        expected: the home that its slow pass should find, None if it has none to compare with.
    """

    step: Step
    approach: float
    expected: Mark | None


class Remembered(NamedTuple):
    """Where earlier runs have found things; m or rad.

    Attributes:
        approach: where the search for the switch ended: a quick run goes to a margin before it.
        home: where home was.
        uncertainty: how far that may be off.
    """

    approach: float
    home: float
    uncertainty: float

    def mirrored(self, sign: float) -> 'Remembered':
        """Return the same in the other frame: raw, or *toward*."""
        return Remembered(sign * self.approach, sign * self.home, self.uncertainty)

    def way(self, procedure: Procedure, margin: float, position: float) -> QuickWay | None:
        """Return how a quick run begins, in the *toward* frame; None if the type has no quick one.

        Args:
            procedure: the table of the home type.
            margin: how far before the switch the quick way ends.
            position: where the axis is.
        """
        if not procedure.quick:
            return None
        ahead, back = procedure.quick
        approach = self.approach - margin
        step = ahead if approach >= position else back
        rows = {**procedure.rows, **procedure.quick}
        compares = Event.REPEAT in rows[rows[step].on[Event.DONE]].on
        expected = Mark(self.home, self.uncertainty) if compares else None
        return QuickWay(step, approach, expected)


class SeenLatch(NamedTuple):
    """A latched position of a run.

    Attributes:
        input: the Z-pulse or the touch probe.
        position: the position that was latched, m or rad.
        time: when it arrived, s.
        velocity: the velocity of the command then, m/s or rad/s.
    """

    input: Input
    position: float
    time: float
    velocity: float


class Seen:
    """The edges and latches of one run, in the *toward* frame.

    Attributes:
        edges: every edge whose way of travel is known; their places may still be refined.
        latches: every latched position.
        approach: where the last search for a switch going toward ended, None if there was none.
    """

    __slots__ = ('edges', 'latches', 'approach')

    def __init__(self) -> None:
        self.edges: list[Edge] = []
        self.latches: list[SeenLatch] = []
        self.approach: Mark | None = None

    def edge(self, edge: Edge) -> None:
        if len(self.edges) < MOST_SEEN:
            self.edges.append(edge)

    def latch(self, source: Input, position: float, time: float, velocity: float) -> None:
        if len(self.latches) < MOST_SEEN:
            self.latches.append(SeenLatch(source, position, time, velocity))
