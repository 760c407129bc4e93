# SPDX-License-Identifier: Apache-2.0
"""Holds the axes before a run, to see that position commands reach the joints that they are for.

Values of a position array go by their place. Where the joints of the controller cannot be read, a
run must not begin with a motion: every joint is told to stay where its feedback says it is, until
the feedback has agreed for 0.2 s.
"""

from collections.abc import Sequence
from math import ceil

from ..core.axis import Axis
from ..core.outcome import Outcome
from ..core.position_array import Slot
from ..procedures.states import Error

#: How long the feedback must agree, s.
AGREED = 0.2
#: How long an agreement, or its failure, counts afterwards, s.
VALID = 1.0
#: An axis that moves by more than this share of its travel does not stay where it was told to.
MOVED = 0.01


class JointOrder:
    """Whether the joints stay where they are told to; the cycle and the executor hold the lock."""

    def __init__(self, slots: Sequence[Slot], period: float) -> None:
        self._slots = slots
        self._needed, self._valid = ceil(AGREED / period), ceil(VALID / period)
        self.held: dict[str, float] = {}  # the command of each joint while all are held
        self._begun: dict[str, float] = {}  # the feedback of each joint then; empty: not wanted
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
            self._begun = self._feedback()
            self.held = {slot.joint: slot.held.hold_position for slot in self._slots}
            self._cycles = 0
        if self._cycles >= self._needed:
            return None
        return Outcome(
            Error.NoController,
            f'the axes are held for {AGREED:g} s, to see that each joint gets its own position',
        )

    def forget(self) -> None:
        """Forget where the axes were: coordinates change."""
        self._begun, self._failed, self._ran = {}, '', False

    def cycle(self, moving: bool) -> bool:
        """Follow the feedback for one cycle; return whether the axes must be held in it."""
        if not self._begun:
            return False
        self._cycles += 1
        if moving:  # a run is on, whose first setpoints continue from the same places
            self._cycles, self._ran = self._needed, True
            return False
        if self._ran:  # the next group of a sequence need not be held again
            self._begun, self._ran = self._feedback(), False
        if self._cycles > self._needed + self._valid:
            self._begun, self._failed = {}, ''
            return False
        self._let_unpowered_go()
        if not self._failed:
            self._failed = self._moved()
            if self._failed:
                self._cycles = self._needed
        return not self._failed and self._cycles <= self._needed

    def _feedback(self) -> dict[str, float]:
        return {slot.joint: slot.held.raw_position for slot in self._slots}

    def _let_unpowered_go(self) -> None:
        """Take the place of a joint whose servo is off: nothing holds it, it comes to rest."""
        for slot in self._slots:
            if not slot.held.powered:
                self._begun[slot.joint] = slot.held.raw_position
                self.held[slot.joint] = slot.held.hold_position

    def _moved(self) -> str:
        """Return which joint has left its place, '' if none has."""
        limits = {slot.joint: _limit(slot.held) for slot in self._slots if slot.axis}
        least = min(limits.values())
        for joint, axis, held in self._slots:
            by = abs(held.raw_position - self._begun[joint])
            if by > limits.get(joint, least):
                return (
                    f'{f"axis {axis}" if axis else f"joint {joint}"} moved by {by:.3g} when all '
                    'were told to stay: are the joints of the controller in the order '
                    f'{", ".join(slot.joint for slot in self._slots)}?'
                )
        return ''


def _limit(axis: Axis) -> float:
    """Return by how much an axis may move while it is held."""
    return min(MOVED * axis.parameters.travel, axis.parameters.following_error_limit)
