# SPDX-License-Identifier: Apache-2.0
"""Locks that coordinators put on axes, because an axis requires others to be homed first.

A coordinator repeats its locks. One that falls silent may have died, and nobody knows then whether
what an axis requires is still homed: the axes that it guarded stay locked until it, one of its
name, or another coordinator that guards the axis speaks. No ROS, no clock.
"""

from collections.abc import Mapping
from typing import NamedTuple

from ..procedures.states import Error
from .outcome import Outcome

#: A coordinator repeats its locks this often, and is silent after that time, s.
REPEATED, SILENT = 0.5, 2.0


class Guard(NamedTuple):
    """What one coordinator said last: its name, when it was heard, why not, by guarded axis."""

    name: str
    heard: float
    reasons: Mapping[str, str]


class Locks:
    """The locks of all coordinators.

    ``coordinated``: the axes home only while a coordinator is heard.
    """

    def __init__(self, coordinated: bool = False) -> None:
        self._coordinated = coordinated
        self._guards: dict[str, Guard] = {}

    def take(self, identity: str, name: str, reasons: Mapping[str, str], now: float) -> None:
        """Take what a coordinator says.

        Args:
            identity: What tells this process of a coordinator from any other.
            name: The full name of its node.
            reasons: Why an axis must not home, '' where it may, by each axis that it guards.
            now: The present time, s.
        """
        for other, guard in list(self._guards.items()):
            if guard.name == name and now - guard.heard > SILENT:
                del self._guards[other]  # it was restarted
        self._guards[identity] = Guard(name, now, dict(reasons))

    def refusal(self, axis: str, now: float) -> Outcome | None:
        """Return why an axis must not home now, None if nothing is said against it."""
        living = [guard for guard in self._guards.values() if now - guard.heard <= SILENT]
        names = {guard.name for guard in living}  # one of them may have been restarted
        guarded = any(axis in guard.reasons for guard in living)
        for guard in self._guards.values():
            silence = now - guard.heard
            reason = guard.reasons.get(axis)
            if reason is None or (silence > SILENT and (guarded or guard.name in names)):
                continue
            if silence > SILENT:
                reason = (
                    f'{guard.name}, which knows what it requires, has been silent for '
                    f'{silence:.1f} s; start it again'
                )
            if reason:
                return self._locked(axis, reason)
        if self._coordinated and not living:
            return self._locked(axis, 'no coordinator is heard (coordinated)')
        return None

    @staticmethod
    def _locked(axis: str, reason: str) -> Outcome:
        return Outcome(Error.PrerequisiteMissing, f'axis {axis}: {reason}', final=True)
