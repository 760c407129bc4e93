# SPDX-License-Identifier: Apache-2.0
"""What a pass of a survey brings: edges, and how far the axis went and stayed behind."""

from collections.abc import Sequence
from statistics import median
from typing import NamedTuple

from ..procedures.states import Error, Input


class SeenEdge(NamedTuple):
    """A change of an input that a pass has met.

    Attributes:
        input: The input.
        level: Its level after the change, after polarity; true for a latched pulse.
        position: Where the axis was, raw, m or rad.
        uncertainty: How far that may be off, m or rad.
        velocity: How fast the axis was, with its sign, raw, m/s or rad/s.
    """

    input: Input
    level: bool
    position: float
    uncertainty: float
    velocity: float

    @property
    def way(self) -> int:
        """The sign of the motion."""
        return 1 if self.velocity > 0.0 else -1


class Pass(NamedTuple):
    """One motion of a survey.

    Attributes:
        begin: Where it began, raw, m or rad.
        end: Where the axis came to rest.
        velocity: How fast it was to go, with its sign, m/s or rad/s.
        edges: What it has met, in the order of time.
        error: Why it ended before its distance; NoError: it did not.
        message: The same in words.
        behind: How far the axis stayed behind its command while that kept its velocity, m or rad.
    """

    begin: float
    end: float
    velocity: float
    edges: tuple[SeenEdge, ...] = ()
    error: Error = Error.NoError
    message: str = ''
    behind: tuple[float, ...] = ()

    @property
    def way(self) -> int:
        """The sign of the motion."""
        return 1 if self.velocity > 0.0 else -1

    @property
    def overrun(self) -> float | None:
        """How far the axis went on behind the limit switch that has stopped it, None: none has."""
        if self.error is not Error.LSTriggered:
            return None
        rises = [one for one in self.edges if one.level and 'limit' in one.input]
        return abs(self.end - rises[-1].position) if rises else None


def lag_of(passes: Sequence[Pass]) -> float | None:
    """Return how long the axis follows behind its command, s; None where that was not seen."""
    found = [behind / abs(one.velocity) for one in passes for behind in one.behind]
    return max(0.0, median(found)) if found else None
