# SPDX-License-Identifier: Apache-2.0
"""`homing propose`: the values that `homing check` would call right."""

import argparse
import difflib
from collections.abc import Iterator
from pathlib import Path

from ..check import errors
from ..check.proposal import Proposal, propose
from ..parameters import yaml_file
from ..parameters.definition import InvalidParameters
from ..parameters.yaml_edit import Edit, NotEditable, edited, plain
from .common import (
    FAILED,
    OK,
    Failure,
    add_configuration,
    add_timing,
    configuration_of,
    layout_from,
    only,
    positive,
    timing_of,
    written,
)

TEXT = """\
Proposes the values that `homing check` calls right for where things are on the machine:
speeds that the room behind every switch allows, the reverse distance, polarities, bounds and
tolerances. It prints them as a diff of CONFIG with the reason above each value; patch takes it.

It proposes a higher velocity only up to --at-most: how fast the drive can go it does not know.
"""

EXAMPLES = """\
examples:
  homing propose axes.yaml --layout machine.yaml
  homing propose axes.yaml --layout machine.yaml --at-most 0.2
  homing propose axes.yaml --layout machine.yaml | patch axes.yaml
  homing propose axes.yaml --layout machine.yaml -o proposed.yaml

"""

FAILURE = 'an error is left that no value puts right'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_configuration(parser)
    parser.add_argument(
        '--layout',
        metavar='LAYOUT',
        type=Path,
        required=True,
        help='where things are along the axes (YAML), for example from `homing survey`',
    )
    add_timing(parser)
    parser.add_argument(
        '--accuracy', metavar='M', type=positive, help='how well home must be known, m or rad'
    )
    parser.add_argument(
        '--at-most',
        metavar='V',
        type=positive,
        help='how fast an axis may home, m/s or rad/s (default: as fast as it does now)',
    )
    parser.add_argument('--axis', metavar='NAME', help='only this axis')
    parser.add_argument(
        '-o',
        '--output',
        metavar='YAML',
        type=Path,
        help='write the whole file with the proposed values, instead of a diff',
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    try:
        configuration = configuration_of(arguments)
    except InvalidParameters as error:
        raise Failure(*error.faults) from None
    layout = layout_from(arguments.layout)
    assert layout is not None
    timing = timing_of(arguments, layout)._replace(
        update_rate=configuration.update_rate, lead=configuration.lead
    )
    axes = only(arguments.axis, configuration.axes)
    if missing := [axis for axis in axes if axis not in layout.layouts]:
        raise Failure(
            f'{arguments.layout}: {", ".join(missing)} is not in it, only '
            f'{", ".join(layout.layouts)}; --axis chooses one'
        )
    proposals = {
        axis: propose(axis, parameters, layout.layouts[axis], timing, arguments.at_most)
        for axis, parameters in axes.items()
    }
    old = Path(arguments.config).read_text(encoding='utf-8')
    new = _proposed(arguments, old, proposals)
    for axis, one in proposals.items():
        for remark in _remarks(axis, one):
            print(f'# {remark}')
    if arguments.output is not None:
        written(arguments.output, lambda: arguments.output.write_text(new, encoding='utf-8'))
        print(f'wrote {arguments.output}')
    elif new == old:
        print(f'{arguments.config}: nothing to propose')
    else:
        name = str(arguments.config)
        lines = old.splitlines(keepends=True), new.splitlines(keepends=True)
        print(*difflib.unified_diff(*lines, name, f'{name} (proposed)'), sep='', end='')
    findings = [left for one in proposals.values() for left in one.findings]
    return FAILED if errors(findings) else OK


def _proposed(arguments: argparse.Namespace, text: str, proposals: dict[str, Proposal]) -> str:
    """Return the text of the file with the proposed values.

    Raises:
        Failure: They cannot be written into a file of this shape; the lines tell them.
    """
    edits = [
        Edit(f'{axis}.{change.name}', change.value, change.why)
        for axis, one in proposals.items()
        for change in one.changes
    ]
    if not edits:
        return text
    path, node = arguments.config, arguments.node
    file = yaml_file.parsed(text.encode(), path, node)
    try:
        made = edited(text, file, edits)
        axes = yaml_file.checked(yaml_file.parsed(made.encode(), path, node)).axes
    except (NotEditable, InvalidParameters) as error:
        why = str(error)
    else:
        if all(axes[axis] == one.parameters for axis, one in proposals.items()):
            return made
        why = 'its lines are not one parameter each'
    values = (f'{edit.name}: {plain(edit.value)}  # {edit.why}' for edit in edits)
    raise Failure(f'{path} cannot be changed line by line ({why}); proposed are', *values)


def _remarks(axis: str, proposal: Proposal) -> Iterator[str]:
    """Yield what no value puts right, and what the room would allow."""
    parameters = proposal.parameters
    for one in proposal.findings:
        remedy = f' [{one.remedy}]' if one.remedy else ''
        yield f'{one.severity}: axis {axis}: {one.what}; {one.why}{remedy}'
    if not proposal.room:
        yield (
            f'axis {axis}: the layout does not tell where both hard stops are, so how much '
            'room there is is not known: no higher velocity is proposed'
        )
    if proposal.room > 1.05 * parameters.homing_velocity_fast:
        yield (
            f'axis {axis}: behind every switch there is room for {proposal.room:g} '
            f'{parameters.unit}/s; if the drive can go so fast: --at-most {proposal.room:g}'
        )
