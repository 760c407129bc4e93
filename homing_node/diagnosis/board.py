# SPDX-License-Identifier: Apache-2.0
"""What `homing watch` knows of a running node: the newest state of each axis, and of its inputs.

No ROS: messages are read by the names of their fields, and times are passed in, s.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any, NamedTuple

from ..procedures.states import Error, State

#: The words for the levels of AxisState.
LEVELS = ('off', 'on', 'unknown')


class InputLine(NamedTuple):
    """One input of an axis.

    Attributes:
        level: on, off or unknown, after polarity.
        age: how old its newest message is; '-': not known.
        rate: how often it comes; '-': not known.
        source: its topic, and what in a message it is; '-': not known.
        changed: when its level has changed last, s; -inf: not yet.
    """

    level: str = 'unknown'
    age: str = '-'
    rate: str = '-'
    source: str = '-'
    changed: float = -inf


@dataclass
class AxisLine:
    """One axis; positions in m or rad.

    Attributes:
        heard: when its newest state arrived, s.
        state: the state of its run, and whether it pauses.
        homed: whether it is homed, and how it knows that.
        raw: its raw position.
        position: its homed position; None: it is not homed.
        uncertainty: how far its home may be off; None: it is not homed.
        error: its last error, '' if it has none, and `message` in words.
        inputs: its inputs.
    """

    heard: float
    state: str = ''
    homed: str = 'none'
    raw: float = 0.0
    position: float | None = None
    uncertainty: float | None = None
    error: str = ''
    message: str = ''
    inputs: dict[str, InputLine] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain values."""
        inputs = {
            name: {'level': one.level, 'age': one.age, 'rate': one.rate, 'source': one.source}
            for name, one in self.inputs.items()
        }
        return {
            'state': self.state,
            'homed': self.homed != 'none',
            'home_source': self.homed,
            'position_raw': self.raw,
            'position': self.position,
            'uncertainty': self.uncertainty,
            'error': self.error,
            'message': self.message,
            'inputs': inputs,
        }


class Change(NamedTuple):
    """Something that has changed, for who reads lines."""

    axis: str
    text: str


class Board:
    """The newest of each axis."""

    def __init__(self) -> None:
        self.axes: dict[str, AxisLine] = {}
        self._told: dict[str, Mapping[str, str]] = {}  # of inputs, before the axis was heard

    @property
    def heard(self) -> float:
        """When the newest state arrived, s; -inf: none has."""
        return max((one.heard for one in self.axes.values()), default=-inf)

    def take_state(self, name: str, message: Any, now: float) -> list[Change]:
        """Take an `AxisState`; return what has changed."""
        before = self.axes.get(name)
        line = AxisLine(
            now,
            state=f'{message.state}, paused' if message.paused else str(message.state),
            homed=str(message.home_source) if message.homed else 'none',
            raw=message.position + (message.home_offset if message.homed else 0.0),
            position=message.position if message.homed else None,
            uncertainty=message.uncertainty if message.homed else None,
            error='' if message.error == Error.NoError else str(message.error),
            message=str(message.message),
            inputs=before.inputs if before else {},
        )
        self.axes[name] = line
        changes = [] if before is None else _changes(name, before, line)
        known, line.inputs = line.inputs, {}
        for source, code in zip(message.inputs, message.levels, strict=False):
            level = LEVELS[code] if code < len(LEVELS) else LEVELS[-1]
            one = known.get(source)
            if one is None:
                line.inputs[source] = InputLine(level)
            elif one.level != level:
                line.inputs[source] = one._replace(level=level, changed=now, age='0.000 s')
                changes.append(Change(name, f'{source} {level}'))
            else:
                line.inputs[source] = one
        if before is None:
            self.take_inputs(name, self._told.pop(name, {}))
        return changes

    def take_inputs(self, name: str, values: Mapping[str, str]) -> None:
        """Take what the diagnostics say of an axis: a line for each input, see input_status.py."""
        axis = self.axes.get(name)
        if axis is None:
            self._told[name] = values
            return
        for source, one in axis.inputs.items():
            told = values.get(source, '').split(', ', 3)
            if len(told) == 4:
                axis.inputs[source] = one._replace(age=told[1], rate=told[2], source=told[3])


def _changes(name: str, before: AxisLine, after: AxisLine) -> list[Change]:
    found = []
    if after.state != before.state:
        found.append(Change(name, after.state))
    if after.homed != before.homed:
        found.append(Change(name, 'homed' if after.homed != 'none' else 'no longer homed'))
    if after.error != before.error and after.error and after.state == State.Idle:
        found.append(Change(name, f'{after.error}: {after.message}'))
    return found
