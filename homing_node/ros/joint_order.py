# SPDX-License-Identifier: Apache-2.0
"""Holds the axes before a run, to see that position commands reach the joints that they are for.

Values of a position array go by their place. Where the joints of the controller cannot be read, a
run must not begin with a motion: every axis is told to stay where its feedback says it is, until
the feedback has agreed for 0.2 s.
"""

from collections.abc import Mapping
from math import ceil

from ..core.axis import Axis
from ..core.outcome import Outcome
from ..procedures.states import Error

#: How long the feedback must agree, s.
AGREED = 0.2
#: How long an agreement, or its failure, counts afterwards, s.
VALID = 1.0
#: An axis that moves by more than this share of its travel does not stay where it was told to.
MOVED = 0.01


class JointOrder:
    """Whether the axes stay where they are told to; the cycle and the executor hold the lock."""

    def __init__(self, axes: Mapping[str, Axis], period: float) -> None:
        self._axes = axes
        self._needed, self._valid = ceil(AGREED / period), ceil(VALID / period)
        self.held: dict[str, float] = {}  # the command of each axis while all are held
        self._begun: dict[str, float] = {}  # the feedback of each axis then; empty: not wanted
        self._cycles = 0
        self._failed = ''
        self._ran = False  # a run was on in the last cycle

    @property
    def wrong(self) -> Outcome | None:
        """Why no run may begin: an axis has left the place where it was told to stay."""
        return Outcome(Error.NoController, self._failed, final=True) if self._failed else None

    @property
    def missing(self) -> Outcome | None:
        """What a run still waits for; asking begins to hold the axes."""
        if not self._begun:
            self._begun = {name: _raw(axis) for name, axis in self._axes.items()}
            self.held = {name: axis.hold_position for name, axis in self._axes.items()}
            self._cycles = 0
        if self._cycles >= self._needed:
            return None
        return Outcome(
            Error.NoController,
            f'the axes are held for {AGREED:g} s, to see that each joint gets its own position',
        )

    def cycle(self, moving: bool) -> bool:
        """Follow the feedback for one cycle; return whether the axes must be held in it."""
        if not self._begun:
            return False
        self._cycles += 1
        if moving:  # a run is on, whose first setpoints continue from the same places
            self._cycles, self._ran = self._needed, True
            return False
        if self._ran:  # the next group of a sequence need not be held again
            self._begun, self._ran = {name: _raw(axis) for name, axis in self._axes.items()}, False
        if self._cycles > self._needed + self._valid:
            self._begun, self._failed = {}, ''
            return False
        if not self._failed:
            self._failed = self._moved()
            if self._failed:
                self._cycles = self._needed
        return not self._failed and self._cycles <= self._needed

    def _moved(self) -> str:
        for name, axis in self._axes.items():
            by = abs(_raw(axis) - self._begun[name])
            if by > min(MOVED * axis.parameters.travel, axis.parameters.following_error_limit):
                return (
                    f'axis {name} moved by {by:.3g} when all axes were told to stay: are the '
                    f'joints of the controller in the order {", ".join(self._axes)}?'
                )
        return ''


def _raw(axis: Axis) -> float:
    """Return the newest feedback of an axis in raw coordinates."""
    return axis.position + (axis.outcome.home_offset if axis.homed else 0.0)
