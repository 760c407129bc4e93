# SPDX-License-Identifier: Apache-2.0
"""The table of `homing watch`, for terminals of any size, and as plain lines."""

from collections.abc import Iterator

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from ..diagnosis.board import AxisLine, Board, InputLine
from ..procedures.states import LATCHES

#: How long an input whose level has changed stands out, s.
STANDS_OUT = 4.0
#: What stands behind it then, also where there are no colours.
MARK = ' <'
#: From these widths on, characters, there is room for the inputs' messages, and for more columns.
WIDE, MEDIUM = 100, 60
STYLES = {'on': 'bold green', 'off': 'dim', 'unknown': 'yellow'}


def table(board: Board, now: float, width: int, height: int = 1000) -> RenderableType:
    """Return the table.

    Args:
        board: What is known.
        now: The present time, s.
        width: Of the terminal, characters.
        height: Of the terminal, lines. Where an input has no line of its own, all inputs of an
            axis share one, without the ages and topics.
    """
    lines = sum(max(1, len(one.inputs)) for one in board.axes.values())
    roomy = width >= WIDE and lines + 6 <= height
    made = Table(box=None, padding=(0, 1), header_style='bold', expand=width < MEDIUM)
    made.add_column('axis', no_wrap=True)
    made.add_column('state', overflow='fold')
    if width >= MEDIUM:
        made.add_column('homed', no_wrap=True)
        made.add_column('position', justify='right', no_wrap=True)
    if width >= WIDE:
        made.add_column('raw', justify='right', no_wrap=True)
        made.add_column('uncertainty', justify='right', no_wrap=True)
    made.add_column('inputs', overflow='fold')
    for name, axis in sorted(board.axes.items()):
        state = Text(axis.state)
        if axis.error:
            state.append(f'\n{axis.error}', style='red')
        cells: list[RenderableType] = [Text(name, style='bold'), state]
        shown = axis.raw if axis.position is None else axis.position
        if width >= MEDIUM:
            cells += [axis.homed if axis.homed != 'none' else Text('no', 'yellow')]
            cells += [f'{shown:.6f}' if axis.position is not None else '-']
        if width >= WIDE:
            sure = '-' if axis.uncertainty is None else f'{axis.uncertainty:.2g}'
            cells += [f'{axis.raw:.6f}', sure]
        made.add_row(*cells, _inputs(axis, now, roomy))
    return made


def text_of(board: Board) -> list[str]:
    """Return plain lines: one for each axis, and one for each of its inputs."""
    return [line for name, axis in sorted(board.axes.items()) for line in _lines(name, axis)]


def _lines(name: str, axis: AxisLine) -> Iterator[str]:
    home = 'not homed'
    if axis.position is not None:
        home = f'homed ({axis.homed}) at {axis.position:.6f}, uncertainty {axis.uncertainty:.2g}'
    yield f'{name}: {axis.state}, {home}, raw {axis.raw:.6f}'
    if axis.error:
        yield f'  {axis.error}: {axis.message}'
    for source, one in axis.inputs.items():
        yield f'  {source}: {_level(source, one)}, {one.age}, {one.rate}, {one.source}'


def _inputs(axis: AxisLine, now: float, roomy: bool) -> RenderableType:
    """Return the cell of the inputs of an axis."""
    if not axis.inputs:
        return '-'
    text = Text()
    for number, (source, one) in enumerate(axis.inputs.items()):
        fresh = now - one.changed < STANDS_OUT
        level = _level(source, one)
        style = 'reverse bold' if fresh else STYLES.get(level, '')
        name = source if roomy else short(source)
        text.append(('\n' if roomy else '  ') if number else '')
        text.append(f'{name:<24}{level:<8}' if roomy else f'{name}:{level}', style=style)
        text.append(MARK if fresh else '  ' if roomy else '')
        if roomy:
            text.append(f' {one.age:>9}  {one.rate:<9}  {one.source}', style='dim')
    return text


def _level(source: str, one: InputLine) -> str:
    """Return the level of an input; a latch has none."""
    return 'latch' if source in LATCHES else one.level


def short(source: str) -> str:
    """Return a short name of an input: `near_positive_limit_switch` is `near+`."""
    for sign, end in (('+', 'positive_limit_switch'), ('-', 'negative_limit_switch')):
        if source.endswith(end):
            return f'{source.removesuffix(end).rstrip("_") or "lim"}{sign}'
    return {'home_switch': 'home', 'servo_enabled': 'servo', 'touch_probe': 'probe'}.get(
        source, source
    )
