# SPDX-License-Identifier: Apache-2.0
"""What the coordinator knows of a cell: its axes, their last states, and when it was heard.

All times are of the coordinator's own clock at arrival: the clocks of the hosts may disagree.
"""

import math
from collections.abc import Collection, Sequence
from typing import NamedTuple

from ..core.outcome import Outcome
from ..parameters.line import Line, cell_of, unknown_cell
from ..procedures.states import Error

#: How much longer a cell may be silent in which nothing homes, s. It sends a state of each axis a
#: second then; where an axis homes, ten.
AT_REST = 1.5
#: A state may overtake another one that is older by less than this, by the clock of the cell, s.
#: One that is older by more comes from a clock that was set back.
OVERTAKES = 2.0


class Seen(NamedTuple):
    """What a cell last said of an axis. Positions are raw, m or rad; ``stamp``: its clock, s."""

    homed: bool
    idle: bool
    error: str = str(Error.NoError)
    home_position_raw: float = 0.0
    home_offset: float = 0.0
    uncertainty: float = 0.0
    stamp: float = 0.0

    def overtaken_by(self, known: 'Seen') -> bool:
        """Return whether this comes after something newer that the cell has said."""
        return 0.0 < known.stamp - self.stamp < OVERTAKES

    @property
    def words(self) -> str:
        """Say in what state the axis is."""
        failed = '' if self.error == Error.NoError else f', its last run ended with {self.error}'
        return f'{"homed" if self.homed else "not homed"}, {self._motion}{failed}'

    @property
    def _motion(self) -> str:
        return 'at rest' if self.idle else 'still moving'


class Cell:
    """One cell.

    Attributes:
        name: its name.
        node: the full name of its homing node.
        axes: the axes that it has, None while it has not said so.
        seen: what it last said of each axis, by the axis's name in the line.
        heard: when it was heard last, s; -inf: never.
        owing: the goals of which it sends feedback, ten times a second.
    """

    def __init__(self, name: str, node: str, timeout: float) -> None:
        self.name, self.node, self._timeout = name, node, timeout
        self.axes: tuple[str, ...] | None = None
        self.seen: dict[str, Seen] = {}
        self.heard = -math.inf
        self.owing: set[int] = set()

    def take(self, axis: str, seen: Seen, now: float) -> None:
        """Take the state of an axis, unless a newer one is known: a result brings one, too."""
        self.heard = now
        known = self.seen.get(axis)
        if known is None or not seen.overtaken_by(known):
            self.seen[axis] = seen

    def restart(self) -> None:
        """Forget what a node said that has ended."""
        self.seen.clear()
        self.owing.clear()
        self.axes = None

    def has(self, axes: Sequence[str]) -> None:
        """Take which axes the cell has; what was seen of others is forgotten."""
        self.axes = tuple(axes)
        self.seen = {axis: seen for axis, seen in self.seen.items() if axis in self.axes}

    @property
    def ever_heard(self) -> bool:
        """Whether the cell was heard once."""
        return self.heard > -math.inf

    def silent(self, now: float) -> bool:
        """Return whether the cell is silent for too long, or was never heard."""
        silence = now - self.heard
        if silence <= self._timeout:
            return False
        runs = bool(self.owing) or any(not seen.idle for seen in self.seen.values())
        return runs or silence > self._timeout + AT_REST

    def lost(self, now: float) -> bool:
        """Return whether the cell was heard once, and is silent now."""
        return self.ever_heard and self.silent(now)

    def knows(self, axis: str) -> bool:
        """Return whether the cell may have an axis; True while it has not said what it has."""
        return self.axes is None or axis in self.axes

    def holds(self, axis: str, now: float) -> str:
        """Return why the home of an axis cannot be relied on, '' if the axis is homed."""
        seen = self.seen.get(axis)
        if seen is None or self.silent(now):
            return f'cell {self.name} is silent, so whether {axis} is homed is not known'
        return '' if seen.homed else f'{axis} is not homed'


class Cells(dict[str, Cell]):
    """The cells of a line, by name."""

    def __init__(self, line: Line) -> None:
        super().__init__(
            {name: Cell(name, node, line.cell_timeout) for name, node in line.nodes.items()}
        )
        self._line = line

    @property
    def names(self) -> list[str]:
        """What a request without names homes: the axes in `steps`; without steps, all axes."""
        if self._line.steps:
            return [axis for step in self._line.steps for axis in step]
        return [axis for cell in self.values() for axis in cell.axes or ()]

    def unknown(self, name: str) -> Outcome | None:
        """Return why a name is no axis of the line."""
        cell = cell_of(name)
        if not cell:
            text = f'{name!r} is not an axis of a cell; an axis of the line is named cell1/x'
            return Outcome(Error.UnknownAxis, text)
        if cell not in self:
            return Outcome(Error.UnknownCell, f'{name}: {unknown_cell(cell, self)}')
        if not self[cell].knows(name):
            axes = ', '.join(self[cell].axes or ())
            return Outcome(Error.UnknownAxis, f'{name!r} is none of the axes {axes}')
        return None

    def ordered(self, names: Sequence[str]) -> list[tuple[str, ...]]:
        """Return axes in the order of the steps; the others follow, one by one."""
        listed = {axis for step in self._line.steps for axis in step}
        steps = [tuple(axis for axis in step if axis in names) for step in self._line.steps]
        return [*filter(None, steps), *((name,) for name in names if name not in listed)]

    def holds(self, axis: str, now: float) -> str:
        """Return why the home of an axis cannot be relied on, '' if the axis is homed."""
        return self[cell_of(axis)].holds(axis, now)

    def locks(self, cell: str, homing: Collection[str], now: float) -> dict[str, str]:
        """Return why axes of a cell must not home, '' where they may.

        Args:
            cell: The cell; only its axes with `requires` count.
            homing: The axes that have their turn now: their homes are about to go.
            now: The present time, s.
        """
        found = {}
        for axis, needed in self._line.requires.items():
            if cell_of(axis) == cell:
                whys = (
                    f'{one} is homing' if one in homing else self.holds(one, now) for one in needed
                )
                found[axis] = '; '.join(filter(None, whys))
        return found
