# SPDX-License-Identifier: Apache-2.0
"""Which way a survey goes: over every switch both ways, fast and slow, and back to its start."""

from typing import NamedTuple

from ..procedures.states import Error
from .passes import Pass

#: The slow passes have this part of the velocity.
SLOW = 0.5
#: The ends of the passes, as parts of `within`, and their velocities, as parts of the velocity.
LEGS = ((1, 1.0), (-1, 1.0), (1, SLOW), (-1, SLOW), (1, 1.0), (0, 1.0))
#: A pass that ends so is one that has come to the end of its way.
ENDS = frozenset([Error.NoError, Error.LSTriggered])


class Move(NamedTuple):
    """A motion to ask for: how far, with its sign, m or rad, and how fast, m/s or rad/s."""

    distance: float
    velocity: float

    @property
    def way(self) -> int:
        """The sign of the motion."""
        return 1 if self.distance > 0.0 else -1


class Plan:
    """The motions of a survey, one after another.

    Attributes:
        passes: The motions that were made.
    """

    def __init__(self, start: float, within: float, velocity: float, travel: float) -> None:
        """Plan a survey.

        Args:
            start: Where the axis is, raw, m or rad.
            within: How far from there it may go, both ways.
            velocity: How fast it may go, m/s or rad/s.
            travel: The longest single motion.

        Raises:
            ValueError: A number is not > 0.
        """
        for name, value in (('within', within), ('velocity', velocity), ('travel', travel)):
            if not 0.0 < value < float('inf'):
                raise ValueError(f'{name}: {value:g} must be > 0')
        self.passes: list[Pass] = []
        self._start, self._within, self._velocity, self._travel = start, within, velocity, travel
        self._position = start
        self._leg = 0
        self._least = 1e-6 * travel

    def next(self) -> Move | None:
        """Return the next motion, None where the survey has ended."""
        while self._leg < len(LEGS):
            part, pace = LEGS[self._leg]
            distance = self._start + part * self._within - self._position
            if abs(distance) > self._least:
                distance = max(-self._travel, min(self._travel, distance))
                return Move(distance, pace * self._velocity)
            self._leg += 1
        return None

    def add(self, one: Pass) -> None:
        """Take what a motion has brought; the survey ends with an error that is not a limit's."""
        self.passes.append(one)
        left = self._start + LEGS[self._leg][0] * self._within - one.end
        self._position = one.end
        if one.error not in ENDS:
            self._leg = len(LEGS)
        elif one.error is not Error.NoError or abs(left) < self._least + 1e-3 * self._within:
            self._leg += 1

    @property
    def failure(self) -> Pass | None:
        """The motion that has ended the survey early, None: none has."""
        last = self.passes[-1] if self.passes else None
        return last if last is not None and last.error not in ENDS else None
