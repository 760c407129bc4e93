# SPDX-License-Identifier: Apache-2.0
"""What a request would do: its order, how long each step takes, what would refuse it."""

import math
from collections.abc import Collection, Sequence

from ..core.outcome import Outcome
from ..parameters.line import Line, cell_of
from ..procedures.states import Error
from .turn import Checked

#: How many checks are open at the same time; when one is repeated, and when a cell is given up
#: that answers none, s.
OPEN, UNANSWERED, PATIENCE = 16, 1.0, 5.0


class Preview:
    """A dry run: every cell is asked for each of its axes, then :attr:`done` is true.

    Attributes:
        steps: the axes in their order.
        refusal: why the request would be refused as a whole.
    """

    def __init__(
        self,
        line: Line,
        steps: Sequence[Sequence[str]],
        refusal: Outcome | None,
        force: bool,
    ) -> None:
        self.steps, self.refusal = steps, refusal
        self._line, self._force = line, force
        named = [axis for step in steps for axis in step]
        required = [one for axis in named for one in line.requires.get(axis, ())]
        self._left = list(dict.fromkeys([*named, *required]))
        self._numbers: dict[int, str] = {}  # axis of each question: also a late answer counts
        self._open: dict[str, float] = {}  # when each axis was asked for last
        self._since: dict[str, float] = {}  # how long each cell has answered nothing
        self._answers: dict[str, Checked | None] = {}

    @property
    def done(self) -> bool:
        return not self._left and not self._open

    def next(self) -> str:
        """Return the next axis to ask for, '' if enough are asked for."""
        return self._left[0] if self._left and len(self._open) < OPEN else ''

    def asked(self, number: int, now: float) -> None:
        """Note that a check of the next axis was sent."""
        axis = self._left.pop(0)
        self._since.setdefault(cell_of(axis), now)
        self._numbers[number], self._open[axis] = axis, now

    def checked(self, number: int, answer: Checked, now: float) -> None:
        """Take the answer to a check."""
        axis = self._numbers.get(number, '')
        if axis and axis not in self._answers:
            self._answers[axis] = answer
            self._since[cell_of(axis)] = now
            self._open.pop(axis, None)
            self._left = [one for one in self._left if one != axis]

    def tick(self, silent: Collection[str], now: float) -> None:
        """Repeat checks that are not answered; give up cells that are silent, or answer none.

        Args:
            silent: The cells that are known to be silent.
            now: The present time, s.
        """
        gone = {cell for cell, since in self._since.items() if now - since > PATIENCE} | {*silent}
        for axis, since in list(self._open.items()):
            if cell_of(axis) not in gone and now - since > UNANSWERED:
                del self._open[axis]
                self._left.insert(0, axis)
        for axis in [axis for axis in (*self._open, *self._left) if cell_of(axis) in gone]:
            self._answers[axis] = None
            self._open.pop(axis, None)
        self._left = [axis for axis in self._left if cell_of(axis) not in gone]

    # ------------------------------------------------------------------------- once it is done

    @property
    def order(self) -> list[list[str]]:
        """The axes of each step that would home: homed ones are left out, unless forced."""
        left = [
            [axis for axis in step if self._force or not self._homed(axis)] for step in self.steps
        ]
        return [step for step in left if step]

    @property
    def durations(self) -> list[float]:
        """How long each step takes, s; NaN if it is not known."""
        return [
            together([self._duration(axis) for axis in step], self._line.at_once)
            for step in self.order
        ]

    @property
    def unknown(self) -> str:
        """Say of which axes it is not known how long they take, '' if there is none."""
        names = [axis for step in self.order for axis in step if math.isnan(self._duration(axis))]
        if not names:
            return ''
        return f'how long {", ".join(names)} will take is not known (ask the node of the cell why)'

    @property
    def missing(self) -> list[str]:
        """What would refuse the request, or an axis of it: `<axis>: <ErrorName>: <text>`."""
        found = []
        if self.refusal is not None:
            found.append(f'{self.refusal.error}: {self.refusal.message}')
        before: set[str] = set()
        for step in self.order:
            for axis in step:
                found += [f'{axis}: {text}' for text in self._missing(axis, before)]
            before.update(step)
        return found

    @property
    def error(self) -> Error:
        """The first error of `missing`."""
        names = [part for text in self.missing for part in text.split(': ')[:2]]
        return next((Error(name) for name in names if name in set(Error)), Error.NoError)

    # ----------------------------------------------------------------------------------- inside

    def _homed(self, axis: str) -> bool:
        answer = self._answers.get(axis)
        seen = answer.seen.get(axis) if answer is not None else None
        return seen is not None and seen.homed

    def _duration(self, axis: str) -> float:
        answer = self._answers.get(axis)
        return math.nan if answer is None else answer.duration

    def _missing(self, axis: str, before: set[str]) -> list[str]:
        """Return what keeps one axis from homing after the steps before it."""
        answer = self._answers.get(axis)
        if answer is None:
            cell = cell_of(axis)
            return [f'{Error.CellLost}: {self._line.nodes[cell]} does not answer']
        needed = self._line.requires.get(axis, ())
        found = [
            f'{Error.PrerequisiteMissing}: it requires {one}, which is not homed'
            for one in needed
            if one not in before and not self._homed(one)
        ]
        # Our own lock says the same, and opens once the steps before have homed.
        return found + [
            text
            for text in answer.missing.get(axis, ())
            if not (needed and text.startswith(f'{Error.PrerequisiteMissing}:'))
        ]


def together(durations: Sequence[float], at_once: int) -> float:
    """Return how long axes take of which at most ``at_once`` home at the same time, s."""
    if any(math.isnan(one) for one in durations):
        return math.nan
    free = [0.0] * min(at_once, max(1, len(durations)))
    for duration in durations:
        first = free.index(min(free))
        free[first] += duration
    return max(free)
