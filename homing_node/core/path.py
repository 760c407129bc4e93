# SPDX-License-Identifier: Apache-2.0
"""A path of one axis over time: pieces of constant jerk, joined without a step.

Within a piece the position is a cubic polynomial of time. A quintic through the states at two
times of one piece is that same cubic, so a controller that joins points by quintics follows the
path exactly if a point stands wherever the jerk changes. Positions in m or rad, times in s.
"""

from collections.abc import Sequence
from typing import NamedTuple

#: Position, velocity and acceleration.
State = tuple[float, float, float]
#: Two times that differ by less are the same, s.
SAME_TIME = 1e-9


class Piece(NamedTuple):
    """The path from ``time`` on, until the next piece begins: a state and a constant jerk."""

    time: float
    position: float
    velocity: float
    acceleration: float
    jerk: float

    def at(self, time: float) -> State:
        """Return the state at a time."""
        t = time - self.time
        half = 0.5 * self.jerk * t
        return (
            self.position + t * (self.velocity + t * (0.5 * self.acceleration + half / 3.0)),
            self.velocity + t * (self.acceleration + half),
            self.acceleration + self.jerk * t,
        )

    def moved(self, time: float, position: float) -> 'Piece':
        """Return the piece later by a time and further by a distance."""
        start, place, velocity, acceleration, jerk = self
        return Piece(start + time, place + position, velocity, acceleration, jerk)


class Stop(NamedTuple):
    """A stop at the end of a path: when and where it begins, and how it goes on from 0.

    ``pieces`` begin at time 0 and position 0; there are none where the axis is at rest already.
    """

    time: float
    position: float
    pieces: Sequence[Piece]

    def moved(self, by: float) -> 'Stop':
        """Return the stop further by a distance."""
        return self._replace(position=self.position + by)

    def path(self) -> list[Piece]:
        """Return the pieces where they are."""
        return [piece.moved(self.time, self.position) for piece in self.pieces]


def state_at(pieces: Sequence[Piece], time: float) -> State:
    """Return the state of a path at a time; before its first piece that rests at its position."""
    for piece in reversed(pieces):
        if piece.time <= time + SAME_TIME:
            return piece.at(max(time, piece.time))
    return pieces[0].position, 0.0, 0.0


def until(pieces: Sequence[Piece], time: float) -> list[Piece]:
    """Return the pieces of a path that begin before a time."""
    return [piece for piece in pieces if piece.time < time]
