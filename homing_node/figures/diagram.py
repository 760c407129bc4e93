# SPDX-License-Identifier: Apache-2.0
"""Draws a home type's state diagram from its table.

Rows of one home state that lead into each other are one box. An arrow that leaves a box leaves it
from those of its rows that know the event, and enters the next box at its first row. An arrow
that bears the name of a bound leads to the error that ends the run there.
"""

from collections.abc import Collection, Iterator
from typing import NamedTuple

from ..procedures.motions import Kind
from ..procedures.procedure import Procedure
from ..procedures.states import State
from ..procedures.steps import HOMED, Step


class Box(NamedTuple):
    """Rows that are drawn as one home state; ``name`` is what arrows call it."""

    name: str
    title: str
    steps: tuple[Step, ...]


class Arrow(NamedTuple):
    """An arrow between two boxes, or from a box to an error, by their names."""

    source: str
    target: str
    label: str


END = 'Homed'


def boxes(procedure: Procedure) -> list[Box]:
    """Return the boxes of a home type in the order of its table."""
    rows = procedure.rows
    chains: list[list[Step]] = []
    for step in rows:
        for chain in chains:
            if any(step in rows[other].on.values() for other in chain if other[0] is step.state):
                chain.append(step)
                break
        else:
            chains.append([step])
    states = [chain[0].state for chain in chains]
    made = []
    for first, *further in chains:
        alone = states.count(first.state) == 1
        phase = '' if alone else first.phase
        name = f'{first.state}{phase.title().replace(" ", "")}'
        made.append(Box(name, str(first.state if alone else first), (first, *further)))
    return made


def arrows(procedure: Procedure) -> list[Arrow]:
    """Return the arrows between the boxes of a home type."""
    drawn = boxes(procedure)
    names = {step: box.name for box in drawn for step in box.steps} | {HOMED: END}
    return list(
        dict.fromkeys(
            Arrow(box.name, names[target], str(event))
            for box in drawn
            for step in box.steps
            for event, target in procedure.rows[step].on.items()
            if target not in box.steps
        )
    )


def bounds(procedure: Procedure) -> list[Arrow]:
    """Return the arrows from the boxes of a home type to the errors that its bounds give."""
    return list(
        dict.fromkeys(
            Arrow(box.name, str(row.bound.error), str(row.bound))
            for box in boxes(procedure)
            for row in (procedure.rows[step] for step in box.steps)
            if row.motion.kind is Kind.SEARCH
        )
    )


def mermaid(procedure: Procedure, only: Collection[State] = ()) -> str:
    """Return the state diagram of a home type in Mermaid's language.

    ``only`` leaves nothing but these home states and what is between them.
    """
    drawn = [box for box in boxes(procedure) if not only or box.steps[0].state in only]
    names = {box.name for box in drawn} | ({END} if not only else set())
    lines = ['stateDiagram-v2', f'    [*] --> {drawn[0].name}']
    for box in drawn:
        lines += _mermaid_box(procedure, box)
    if END in names:
        lines.append(f'    state "homed" as {END}')
    failing = [arrow for arrow in bounds(procedure) if arrow.source in names]
    errors = dict.fromkeys(arrow.target for arrow in failing)
    for source, target, label in (*arrows(procedure), *failing):
        if source in names and target in {*names, *errors}:
            lines.append(f'    {source} --> {target} : {label}')
    if END in names:
        lines.append(f'    {END} --> [*]')
    if errors:
        lines.append('    classDef error fill:#fbe3d6,stroke:#d55e00,color:#7a3000')
        lines += [f'    class {error} error' for error in errors]
    return '\n'.join(lines) + '\n'


def _mermaid_box(procedure: Procedure, box: Box) -> Iterator[str]:
    texts = motions(procedure, box)
    if len(box.steps) == 1:
        yield f'    state "{box.title}<br>{texts[0]}" as {box.name}'
        return
    names = {step: f'{box.name}_{n}' for n, step in enumerate(box.steps, 1)}
    yield f'    state "{box.title}" as {box.name} {{'
    for name, text in zip(names.values(), texts, strict=True):
        yield f'        state "{text}" as {name}'
    yield f'        [*] --> {names[box.steps[0]]}'
    for step, name in names.items():
        for event, target in procedure.rows[step].on.items():
            if target in names:
                yield f'        {name} --> {names[target]} : {event}'
    yield '    }'


def motions(procedure: Procedure, box: Box) -> list[str]:
    """Return what the axis does in each row of a box; rows that do the same tell their phase."""
    texts = [procedure.rows[step].motion.text for step in box.steps]
    return [
        f'{text} ({step.phase})' if step.phase and texts.count(text) > 1 else text
        for step, text in zip(box.steps, texts, strict=True)
    ]
