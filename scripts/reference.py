# SPDX-License-Identifier: Apache-2.0
"""Makes doc/parameters.md from the specifications that the node itself declares and checks."""

from collections.abc import Iterable, Mapping
from pathlib import Path

from homing_node.parameters.axis import DEFINITIONS
from homing_node.parameters.connections import (
    COMMAND_DEFINITIONS,
    SERVICE_DEFINITIONS,
    TOPIC_DEFINITIONS,
    TYPE_DEFINITIONS,
)
from homing_node.parameters.definition import Definition
from homing_node.parameters.line import LINE_DEFINITIONS
from homing_node.parameters.node_fields import NODE_DEFINITIONS
from homing_node.procedures.states import LSType

PAGE = Path(__file__).resolve().parent.parent / 'doc' / 'parameters.md'

#: The first parameter of each section.
SECTIONS: Mapping[str, str] = {
    'home_type': 'The axis',
    'homing_velocity_fast': 'How it moves',
    'invert_hs_polarity': 'Polarity',
    'multiple_z_pulse': 'Z-pulse',
    'max_hs_on_at_start_reverse_distance': 'Bounds',
    'immediate_stop_at_ls': 'Variants',
    'ls_type': 'Limit switches',
    'mechanical_end_detection_pos_diff': 'Mechanical end',
    'switches': 'Inputs',
    'following_error': 'Supervision',
    'clear_home_done_on_servo_off': 'Loss of home',
    'encoder': 'Memory',
    'apply': 'Hand-over',
    'travel_min': 'Soft limits',
    'followers': 'Gantry',
}

HEAD = """\
<!-- Made by `make docs` from homing_node/parameters/. -->

# Parameters

Units are SI. An axis with `unit: rad` is rotary: read rad for m, as its messages do. An integer is
accepted for every real parameter.

Parameters come from a YAML file (`--params-file`). A bad file stops the node at its start with all
faults listed and exit status 1; an unknown name is a fault too. At runtime `ros2 param set` checks
the value; it takes effect at the next run of that axis and is refused while the axis is homing.

What must fit together is checked when the file is read, when several parameters are set at once,
and when a run starts:

- `homing_velocity_slow` ≤ `homing_velocity_fast`;
- no ramp from rest to a velocity takes longer than 1000 s, with its acceleration and `max_jerk`;
  no move over `homing_reverse_distance` or `home_shift_distance` takes longer than an hour;
- `homing_reverse_distance` < `travel`, |`home_shift_distance`| ≤ `travel`;
- `max_search_distance` ≤ 2 × `travel`; `max_ls_reverse_distance` and
  `max_hs_on_at_start_reverse_distance` ≤ the search bound;
- `home_shift_distance` ≤ 0 for the types that home on a limit switch, and for
  `MechanicalEndDetection`;
- `max_z_pulse_distance`, if set, > `z_pulse_arm_delay`;
- the inputs that `home_type` needs are in `switches`, and a near or external limit that it homes
  on has a type other than `None`;
- `mechanical_end_detection_pos_diff` > 0 for the types that home on the mechanical end.

## The node

"""
AXIS = """
# Parameters of an axis

Each stands under the axis's name: `x.travel`.
"""
TOPICS = """
## Topics

The topic of each input, and what in its messages it is, behind a `#` ([inputs.md](inputs.md)).
Empty means `~/<axis>/<input>`; for the feedback, `joint_states`.

"""
TYPES = """
## Types

The message type of the topic of each input; empty means: as its publisher says.

"""
COMMANDS = """
## Outputs

What follows an output besides its topic: [by other ways](inputs.md#outputs-by-other-ways).

"""

LINE = """
# Parameters of the coordinator

`homing_coordinator` homes the axes of many nodes: [many cells](cells.md). An axis is named
`<cell>/<axis>`. All are read at the start only; a bad file stops it with all faults listed.

"""


def page() -> str:
    """Return the whole page."""
    parts = [HEAD, table(NODE_DEFINITIONS.values()), AXIS]
    names = list(DEFINITIONS)
    starts = [names.index(name) for name in SECTIONS]
    for title, start, end in zip(SECTIONS.values(), starts, [*starts[1:], None], strict=True):
        rows = table(DEFINITIONS[name] for name in names[start:end])
        parts.append(f'\n## {title}\n\n{rows}')
    parts += [TOPICS, ', '.join(f'`{name}`' for name in TOPIC_DEFINITIONS), '\n']
    parts += [TYPES, ', '.join(f'`{name}`' for name in TYPE_DEFINITIONS), '\n']
    parts += [COMMANDS, table([*COMMAND_DEFINITIONS.values(), *SERVICE_DEFINITIONS.values()])]
    parts += [LINE, table(LINE_DEFINITIONS.values())]
    return ''.join(parts)


def table(definitions: Iterable[Definition]) -> str:
    """Return a table of parameters."""
    rows = ['| parameter | default | unit | allowed | meaning |', '|---|---|---|---|---|']
    for definition in definitions:
        cells = (
            f'`{definition.name}`',
            default(definition),
            definition.unit,
            allowed(definition),
            definition.text,
        )
        rows.append('| ' + ' | '.join(cell.replace('|', r'\|') for cell in cells) + ' |')
    return '\n'.join(rows) + '\n'


def default(definition: Definition) -> str:
    """Return the default as it is written in YAML."""
    if definition.required:
        return '**required**'
    value = definition.default
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return ', '.join(f'`{item}`' for item in value)
    if isinstance(value, float):
        return f'{value:g}'
    return f'`{value}`' if value else {str: '`""`', list: '`[]`'}.get(definition.kind, '0')


def allowed(definition: Definition) -> str:
    """Return the bounds or the choices."""
    if definition.name == 'home_type':
        return '[home types](types/README.md)'
    if definition.name == 'switches':
        return 'the names under [Topics](#topics)'
    if definition.kind is LSType:
        return '[LS Type](homing.md#limit-switches)'
    choices = ', '.join(f'`{choice}`' for choice in definition.choices)
    return choices or definition.bounds.replace('<=', '≤').replace('>=', '≥')


if __name__ == '__main__':
    PAGE.write_text(page())
