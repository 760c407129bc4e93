# SPDX-License-Identifier: Apache-2.0
"""What a configuration of another controller becomes: settings with their origin, and remarks."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from textwrap import wrap
from typing import NamedTuple, TypeAlias

Value: TypeAlias = float | int | bool | str | list[str]

#: A line of the YAML is not longer than this where it can be broken.
WIDTH = 96


class Unconvertible(ValueError):
    """A file, or an axis of it, that has no equal here; the message says why."""


class Row(NamedTuple):
    """A line of the mapping: what the file calls it, what it is here, and how it is converted.

    ``ours`` is '' where there is no equal; ``text`` then says why.
    """

    source: str
    ours: str
    text: str


class Setting(NamedTuple):
    """A parameter of ours and the lines of the file that it comes from."""

    name: str
    value: Value
    origin: str


@dataclass
class Axis:
    """An axis as it was read; ``refusal`` says why it cannot be converted ('': it can)."""

    name: str
    settings: list[Setting] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    refusal: str = ''

    def set(self, name: str, value: Value, origin: str) -> None:
        """Add a parameter."""
        self.settings.append(Setting(name, value, origin))

    def set_motion(self, acceleration: float | None, origin: str) -> None:
        """Add the accelerations of every profile, and a jerk, which no source has."""
        if not acceleration:
            return
        prefixes = ('homing_velocity_fast', 'homing_velocity_slow', 'home_shift')
        names = [f'{prefix}_{end}' for prefix in prefixes for end in ('acc', 'dec')]
        for name in (*names, 'ls_dec'):
            self.set(name, acceleration, origin)
        self.set(
            'max_jerk', 20.0 * acceleration, 'no jerk limit there: the acceleration within 0.05 s'
        )

    @property
    def values(self) -> dict[str, Value]:
        """The parameters by name."""
        return {setting.name: setting.value for setting in self.settings}


@dataclass
class Converted:
    """A whole file: its kind, its axes in order, the groups that home together, remarks."""

    kind: str
    axes: list[Axis]
    sequence: list[list[str]] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    @property
    def usable(self) -> list[Axis]:
        """The axes that could be converted."""
        return [axis for axis in self.axes if not axis.refusal]

    @property
    def parameters(self) -> Mapping[str, dict[str, Value]]:
        """The parameters of each usable axis."""
        return {axis.name: axis.values for axis in self.usable}

    @property
    def home_sequence(self) -> list[str]:
        """The groups as the parameter `home_sequence` has them, usable axes only."""
        usable = set(self.parameters)
        groups = [[name for name in group if name in usable] for group in self.sequence]
        return [', '.join(group) for group in groups if group]


def yaml_text(converted: Converted, source: str) -> str:
    """Return a parameter file of homing_node; raises Unconvertible where no axis could be read."""
    if not converted.usable:
        reasons = '; '.join(f'{axis.name}: {axis.refusal}' for axis in converted.axes)
        raise Unconvertible(reasons or 'it configures no axis')
    return '\n'.join(_lines(converted, source)) + '\n'


def _lines(converted: Converted, source: str) -> Iterator[str]:
    yield from _comment(f'Converted from {source} ({converted.kind}) by `homing convert`.', '')
    yield from _comment('In m and rad. Check it, and rehearse it, before it moves.', '')
    for remark in converted.remarks:
        yield from _comment(remark, '')
    yield '/**:'
    yield '  ros__parameters:'
    yield f'    axes: {_text([axis.name for axis in converted.usable])}'
    if len(converted.usable) > 1 and converted.home_sequence:
        yield f'    home_sequence: {_text(converted.home_sequence)}'
    for axis in converted.axes:
        yield ''
        if axis.refusal:
            yield from _comment(f'{axis.name} is not converted: {axis.refusal}', '    ')
            continue
        yield f"    '{axis.name}':"
        for setting in axis.settings:
            line = f'      {setting.name}: {_text(setting.value)}'
            yield f'{line}  # {setting.origin}' if setting.origin else line
        for remark in axis.remarks:
            yield from _comment(remark, '      ')


def _comment(text: str, indent: str) -> Iterator[str]:
    for line in wrap(text, WIDTH - len(indent)):
        yield f'{indent}# {line}'


def _text(value: Value) -> str:
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, list):
        return '[' + ', '.join(f"'{item}'" for item in value) + ']'
    if isinstance(value, float):
        return f'{value:.9g}' if value else '0.0'
    return str(value)
