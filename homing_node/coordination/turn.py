# SPDX-License-Identifier: Apache-2.0
"""The turn of one axis within a request: follows turn_table.py, and says how it ended."""

from collections.abc import Mapping
from typing import NamedTuple

from ..core.outcome import Outcome
from ..parameters.line import cell_of
from ..procedures.states import Error
from .cells import Seen
from .turn_table import PROOFS, TABLE, UNDER_WAY, Asks, Event, Phase

#: What a turn that ends by itself says. {waits}: what was waited for; {patience} in s.
TEXTS: Mapping[Event, str] = {
    Event.Gone: 'the cell does not know the goal any more',
    Event.Silent: 'canceled',
    Event.Lost: 'cell {cell} is silent; what the axis does is not known',
    Event.Restarted: 'the node of cell {cell} has restarted in the run; its homes are gone',
    Event.Late: 'waited {patience:g} s in vain for {waits}',
}


class Ask(NamedTuple):
    """Something to ask of a cell.

    Attributes:
        kind: what.
        number: of the goal, or of the check; the answer names it.
        cell: the cell.
        axes: the axes by their names in the line; of a goal, one.
    """

    kind: Asks
    number: int
    cell: str
    axes: tuple[str, ...]


class Checked(NamedTuple):
    """The answer of a cell to a check: what it says of axes, and what would refuse their homing.

    ``missing`` is by axis; ``duration``: how long homing the axes takes, s, NaN if not known.
    """

    seen: Mapping[str, Seen]
    missing: Mapping[str, tuple[str, ...]]
    duration: float


class Turn:
    """The turn of one axis.

    Attributes:
        axis: the axis.
        phase: where it stands.
        since: when this phase began, s.
        outcome: how it ended.
        goal: the number of its goal, 0: none has left.
        checks: the numbers of the check and of its repetitions; an answer to any of them counts.
        awaited: the cells whose answer to the check has not come.
        answers: the answers to the check that have come.
        again: when the check is repeated, s: it was not answered, or met a lock.
        doubt: the lock that the check met last.
        active: when the goal or the axis was last seen to run, s.
        skipped: whether the axis was homed already, and left out.
        restless: whether the axis has not come to rest in time after a cancel: it may still move.
    """

    def __init__(self, axis: str) -> None:
        self.axis = axis
        self.phase = Phase.Waiting
        self.since = 0.0
        self.outcome = Outcome(Error.NoError)
        self.goal = 0
        self.checks: set[int] = set()
        self.awaited: set[str] = set()
        self.answers: dict[str, Checked] = {}
        self.again = 0.0
        self.doubt: Outcome | None = None
        self.active = 0.0
        self.skipped = False
        self.restless = False

    @property
    def cell(self) -> str:
        return cell_of(self.axis)

    @property
    def ended(self) -> bool:
        return self.phase is Phase.Ended

    @property
    def failed(self) -> bool:
        return self.ended and not self.outcome.success

    @property
    def waits(self) -> str:
        """What the turn waits for, in words."""
        return TABLE[self.phase].waits

    def late(self, now: float) -> bool:
        """Return whether the patience of the phase is over."""
        return now - self.since > TABLE[self.phase].patience

    def handle(
        self, event: Event, now: float, outcome: Outcome | None = None, text: str = ''
    ) -> list[Asks]:
        """Let an event happen.

        Args:
            event: What happens.
            now: The present time, s.
            outcome: How the axis ended, if the event says so.
            text: Why, if the event makes an error.

        Returns:
            What is to be asked of the cell now.
        """
        row = TABLE[self.phase]
        to = row.after.get(event)
        if to is None:
            return []
        before = self.phase
        self.restless = before is Phase.Stopping and event is Event.Late
        if outcome is not None:
            self.outcome = outcome
        elif to.error is not None and self.outcome.error in (Error.NoError, Error.Canceled):
            words = text or TEXTS[event].format(
                cell=self.cell, waits=row.waits, patience=row.patience
            )
            self.outcome = Outcome(to.error, f'{self.axis}: {words}')
        if to.phase is not before:
            self.phase, self.since = to.phase, now
        asks = TABLE[to.phase].asks
        if asks is not None:
            return [asks]
        recall = to.phase is Phase.Ended and before in UNDER_WAY and event not in PROOFS
        return [Asks.Cancel] if recall else []
