# SPDX-License-Identifier: Apache-2.0
"""What the coordinator says of itself and of each cell, for `/diagnostics`."""

from collections.abc import Mapping
from typing import NamedTuple

from ..parameters.line import cell_of
from ..procedures.states import Error, TextEnum
from .cells import Cell
from .coordinator import Coordinator
from .turn_table import BUSY

#: The entry of the coordinator itself.
LINE = 'line'


class Level(TextEnum):
    """How grave an entry is."""

    ok = 'ok'
    warn = 'warn'
    error = 'error'


class Health(NamedTuple):
    """One entry.

    Attributes:
        name: the cell, or `line` for the coordinator itself.
        level: how grave it is.
        text: what a person reads first.
        values: the details, by name.
    """

    name: str
    level: Level
    text: str
    values: Mapping[str, object]


def health(core: Coordinator, foreign: Mapping[str, str], now: float) -> list[Health]:
    """Return an entry for the coordinator, and one for each cell.

    Args:
        core: The coordinator.
        foreign: By cell, why the messages of its node cannot be relied on, '' if they can.
        now: The present time, s.
    """
    cells = [_of_cell(core, cell, foreign.get(name, ''), now) for name, cell in core.cells.items()]
    return [_of_line(core, now), *cells]


def _of_line(core: Coordinator, now: float) -> Health:
    turns = [turn for request in core.requests for turn in request.turns if not turn.ended]
    homing = ', '.join(turn.axis for turn in turns if turn.phase in BUSY)
    values = {
        'requests': len(core.requests),
        'homing': homing,
        'waiting': ', '.join(turn.axis for turn in turns if turn.phase not in BUSY),
    }
    other = core.claims.living(now)
    if other:
        text = f'{Error.CoordinatorConflict}: {other} guards cells of this line, too'
        return Health(LINE, Level.error, text, values)
    return Health(LINE, Level.ok, f'homing {homing}' if homing else 'nothing homes', values)


def _of_cell(core: Coordinator, cell: Cell, foreign: str, now: float) -> Health:
    axes = cell.axes or ()
    homed = [axis for axis in axes if axis in cell.seen and cell.seen[axis].homed]
    moving = [axis for axis in axes if axis in cell.seen and not cell.seen[axis].idle]
    locked = [f'{axis}: {why}' for axis, why in core.locks(cell.name, now).items() if why]
    level, text = _judged(core, cell, foreign, now)
    values = {
        'node': cell.node,
        'heard': f'{now - cell.heard:.1f} s ago' if cell.ever_heard else 'never',
        'axes': ', '.join(axes),
        'homed': ', '.join(homed),
        'moving': ', '.join(moving),
        'locked': '; '.join(locked),
    }
    return Health(cell.name, level, text, values)


def _judged(core: Coordinator, cell: Cell, foreign: str, now: float) -> tuple[Level, str]:
    """Return how grave the condition of a cell is, and what it is; the gravest one counts."""
    if foreign:
        return Level.error, foreign
    if not cell.ever_heard:
        return Level.error, f'{Error.CellLost}: {cell.node} was never heard'
    if cell.lost(now):
        return Level.error, f'{Error.CellLost}: {cell.node} is silent'
    none = [axis for axis in core.line.axes if cell_of(axis) == cell.name and not cell.knows(axis)]
    if none:
        text = f'{", ".join(none)}, which `steps` or `requires` name, it does not have'
        return Level.error, f'{Error.UnknownAxis}: {text}'
    if cell.axes is None:
        return Level.warn, 'it has not said yet which axes it has'
    rest = {axis: seen for axis in cell.axes if (seen := cell.seen.get(axis)) and not seen.homed}
    open_ = [
        axis if seen.error == Error.NoError else f'{axis} ({seen.error})'
        for axis, seen in rest.items()
        if seen.idle
    ]
    if open_:
        return Level.warn, f'not homed: {", ".join(open_)}'
    return Level.ok, f'homing {", ".join(rest)}' if rest else 'homed'
