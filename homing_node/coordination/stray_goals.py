# SPDX-License-Identifier: Apache-2.0
"""Goals that may still run at a cell although nobody waits for them: they are canceled."""

from collections.abc import Mapping

#: So many goals of requests that have ended are remembered.
MOST = 2000
#: A goal that does not end is canceled again after this time, s.
AGAIN = 1.0


class StrayGoals:
    """The goals of requests that have ended, and the cancels of goals that go on."""

    def __init__(self) -> None:
        self._axes: dict[int, str] = {}  # by the number of the goal
        self._canceled: dict[int, float] = {}

    def remember(self, goals: Mapping[int, str]) -> None:
        """Remember the axes of goals whose requests have ended; the oldest ones are forgotten."""
        self._axes.update(goals)
        for number in list(self._axes)[:-MOST]:
            del self._axes[number]
            self._canceled.pop(number, None)

    def axis(self, number: int) -> str:
        """Return the axis of a goal, '' if it is not known."""
        return self._axes.get(number, '')

    def cancel_is_due(self, number: int, now: float) -> bool:
        """Return whether a goal that goes on is to be canceled now; a cancel may be lost."""
        if now - self._canceled.get(number, -AGAIN) < AGAIN:
            return False
        self._canceled[number] = now
        return True
