# SPDX-License-Identifier: Apache-2.0
"""What the node says of itself: what it is ready for, and what was changed."""

from collections.abc import Mapping, Sequence
from typing import Any

from ..parameters.configuration import AXIS_DEFINITIONS, Configuration
from ..parameters.node_fields import NODE_DEFINITIONS


def ready(
    checked: Configuration,
    setpoints: str,
    sources: Mapping[str, Mapping[str, str]],
    feedback: Mapping[str, str],
    records: str,
) -> list[str]:
    """Return the lines that say what the node is ready for.

    Args:
        checked: The configuration of the node.
        setpoints: The full name of the topic of the setpoints.
        sources: Where each input of each axis comes from.
        feedback: The full name of the topic of the feedback of each axis.
        records: Where runs are recorded, '' if they are not.
    """
    axes = ', '.join(checked.axes)
    lines = [
        f'ready to home {axes} at {checked.update_rate:g} Hz; setpoints '
        f'({checked.setpoint_interface}) on {setpoints}; '
        + (f'records in {records}' if records else 'runs are not recorded')
    ]
    for name, p in checked.axes.items():
        inputs = ', '.join(f'{source} from {where}' for source, where in sources[name].items())
        lines.append(
            f'axis {name}: {p.home_type} toward {str(p.home_direction).lower()}; joint '
            f'{checked.joints[name]} from {feedback[name]}; {inputs or "no input"}'
        )
    return lines


def changed(name: str, value: Any) -> str:
    """Return what to say of a parameter that was set."""
    definition = NODE_DEFINITIONS.get(name) or AXIS_DEFINITIONS.get(name.partition('.')[2])
    unit = definition.unit if definition else ''
    listed = isinstance(value, Sequence) and not isinstance(value, str)
    text = f'[{", ".join(map(str, value))}]' if listed else f'{value!r}'
    return f'{name} is now {text} {unit}'.rstrip()
