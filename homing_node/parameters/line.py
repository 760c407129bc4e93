# SPDX-License-Identifier: Apache-2.0
"""The parameters of the coordinator: the cells of a line, and the order in which they home.

A cell is a homing node with its axes; its name is the namespace of that node. An axis of the line
is `<cell>/<axis>`.
"""

import re
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from ..procedures.states import TextEnum
from .configuration import bad_common
from .definition import Definition, InvalidParameters, read, suggestion, table
from .node_fields import AXIS_NAME, COMMON_DEFINITIONS

NODE_NAME = re.compile(r'(/[A-Za-z_][A-Za-z0-9_]*)+')


class OnFailure(TextEnum):
    """What a failed axis stops: all others and all later steps, the rest of its step, nothing."""

    stop_all = 'stop_all'
    stop_step = 'stop_step'
    go_on = 'go_on'


LINE_DEFINITIONS: Mapping[str, Definition] = table(
    Definition(
        'the homing nodes, each with its namespace, which is the name of its cell: '
        '["/cell1/homing_node"]',
        list,
        name='nodes',
    ),
    Definition(
        'the steps in order; the axes of a step home together, a step begins when the one before '
        'has ended: ["cell1/z, cell2/z", "cell1/x"] (empty: all axes, one after another)',
        list,
        name='steps',
        default=[],
    ),
    Definition(
        'what an axis needs homed before it may home: ["cell2/y: cell1/z, cell1/x"]',
        list,
        name='requires',
        default=[],
    ),
    Definition('how many axes home at the same time', int, '', 1, 1000, name='at_once', default=8),
    Definition(
        'what stops when an axis fails',
        OnFailure,
        name='on_failure',
        default=OnFailure.stop_all,
    ),
    Definition(
        'leave out what is homed (`force` in a goal homes it, too)',
        bool,
        name='skip_homed',
        default=True,
    ),
    Definition(
        'a cell in which an axis homes is lost after this time without a state of it',
        float,
        's',
        0.2,
        60.0,
        name='cell_timeout',
        default=1.0,
    ),
)


class Line(NamedTuple):
    """The checked parameters of the coordinator; cells and axes in their order.

    Attributes:
        nodes: the full name of each cell's homing node, by the cell's name.
        steps: the axes of each step.
        requires: what must be homed before an axis homes, by axis.
        at_once: how many axes home at the same time.
        on_failure: what a failed axis stops.
        skip_homed: whether a request leaves out what is homed.
        cell_timeout: how long a cell in which an axis homes may be silent, s.
    """

    nodes: Mapping[str, str]
    steps: tuple[tuple[str, ...], ...] = ()
    requires: Mapping[str, tuple[str, ...]] = {}
    at_once: int = 8
    on_failure: OnFailure = OnFailure.stop_all
    skip_homed: bool = True
    cell_timeout: float = 1.0

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that `steps` and `requires` name, each once."""
        named = [axis for step in self.steps for axis in step]
        for axis, needed in self.requires.items():
            named += [axis, *needed]
        return tuple(dict.fromkeys(named))


def cell_of(axis: str) -> str:
    """Return the cell of an axis of the line."""
    return axis.rpartition('/')[0]


def line(values: Mapping[str, Any]) -> Line:
    """Check a flat mapping of parameter names to plain values; None: the value is not set.

    Raises:
        InvalidParameters: Every fault, a line each.
    """
    given = {name: value for name, value in values.items() if value is not None}
    common = [name for name in given if name in COMMON_DEFINITIONS or '.' in name]
    own, faults = read({n: v for n, v in given.items() if n not in common}, LINE_DEFINITIONS)
    faults += bad_common({name: given[name] for name in common})
    nodes, found = _nodes(own.get('nodes', []), 'nodes' in own)
    steps, more = _steps(own.get('steps', []), nodes)
    requires, others = _requires(own.get('requires', []), nodes)
    faults += [*found, *more, *others, *_never(requires, steps)]
    if faults:
        raise InvalidParameters(dict.fromkeys(faults))
    own.update(nodes=nodes, steps=steps, requires=requires)
    return Line(**own)


def _nodes(names: Iterable[str], given: bool) -> tuple[dict[str, str], list[str]]:
    """Return the node of each cell, and what is wrong with their names."""
    nodes: dict[str, str] = {}
    faults = []
    for name in names:
        cell = name.rpartition('/')[0].lstrip('/')
        if not NODE_NAME.fullmatch(name) or not cell:
            faults.append(
                f'nodes: {name!r} is not the full name of a node in a namespace, such as '
                "'/cell1/homing_node': the namespace is the name of the cell"
            )
        elif nodes.get(cell) == name:
            faults.append(f'nodes: {name!r} stands there twice')
        elif cell in nodes:
            faults.append(
                f'nodes: {nodes[cell]!r} and {name!r} are both the cell {cell!r}; give each a '
                'namespace of its own'
            )
        else:
            nodes[cell] = name
    if given and not nodes and not faults:
        faults.append("nodes: no node is named: nodes: ['/cell1/homing_node']")
    return nodes, faults


def _axes(text: str, where: str, nodes: Mapping[str, str]) -> tuple[list[str], list[str]]:
    """Read `cell1/x, cell2/y`; return the axes, and what is wrong with them."""
    axes, faults = [], []
    for name in (part.strip() for part in text.split(',')):
        cell, _, axis = name.rpartition('/')
        if not cell or not AXIS_NAME.fullmatch(axis):
            faults.append(f'{where}: {name!r} is not an axis of a cell, such as cell1/x')
        elif cell not in nodes:
            faults.append(f'{where}: {name!r}: {unknown_cell(cell, nodes)}')
        else:
            axes.append(name)
    return axes, faults


def unknown_cell(cell: str, nodes: Iterable[str]) -> str:
    """Return the message for a cell that `nodes` does not have."""
    return f'{cell!r} is none of the cells {", ".join(nodes) or "(none)"}' + suggestion(
        cell, nodes
    )


def _steps(
    texts: Iterable[str], nodes: Mapping[str, str]
) -> tuple[tuple[tuple[str, ...], ...], list[str]]:
    """Return the axes of each step, and what is wrong with them."""
    steps: list[tuple[str, ...]] = []
    faults: list[str] = []
    step_of: dict[str, int] = {}
    for number, text in enumerate(texts, 1):
        axes, found = _axes(text, 'steps', nodes)
        faults += found
        for axis in axes:
            if step_of.get(axis) == number:
                faults.append(f'steps: {axis} stands twice in step {number}')
            elif axis in step_of:
                faults.append(f'steps: {axis} stands in two steps, {step_of[axis]} and {number}')
            step_of.setdefault(axis, number)
        steps.append(tuple(dict.fromkeys(axes)))
    return tuple(steps), faults


def _requires(
    texts: Iterable[str], nodes: Mapping[str, str]
) -> tuple[dict[str, tuple[str, ...]], list[str]]:
    """Return what each axis requires, and what is wrong with it."""
    requires: dict[str, tuple[str, ...]] = {}
    faults = []
    for text in texts:
        axis, colon, needed = text.partition(':')
        if not colon or not needed.strip():
            faults.append(
                f"requires: {text!r} does not say what the axis needs, as 'cell2/y: cell1/z' does"
            )
            continue
        owners, found = _axes(axis, 'requires', nodes)
        names, more = _axes(needed, 'requires', nodes)
        faults += [*found, *more]
        for owner in owners:
            if owner in names:
                faults.append(f'requires: {owner} requires itself')
            requires[owner] = tuple(dict.fromkeys([*requires.get(owner, ()), *names]))
    return requires, faults


def _never(
    requires: Mapping[str, tuple[str, ...]], steps: tuple[tuple[str, ...], ...]
) -> list[str]:
    """Return which axes can never home: what they require comes too late or in a circle."""
    step_of = {axis: number for number, step in enumerate(steps, 1) for axis in step}
    faults = [
        f'requires: {axis} (step {step_of[axis]}) requires {needed}, which homes in step '
        f'{step_of[needed]}: put {needed} into an earlier step'
        for axis, names in requires.items()
        for needed in names
        if axis != needed
        and axis in step_of
        and needed in step_of
        and step_of[needed] >= step_of[axis]
    ]
    for axis in requires:
        circle = _circle(axis, requires)
        if len(circle) > 2 and axis == min(circle):
            faults.append(
                f'requires: a circle, in which no axis can be first: {" -> ".join(circle)}'
            )
    return faults


def _circle(axis: str, requires: Mapping[str, tuple[str, ...]]) -> list[str]:
    """Return the way from an axis back to itself, [] if there is none."""
    ways = [[axis, needed] for needed in requires.get(axis, ())]
    seen: set[str] = set()
    while ways:
        way = ways.pop()
        if way[-1] == axis:
            return way
        if way[-1] not in seen:
            seen.add(way[-1])
            ways += [[*way, needed] for needed in requires.get(way[-1], ())]
    return []
