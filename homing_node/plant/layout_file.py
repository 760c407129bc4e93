# SPDX-License-Identifier: Apache-2.0
"""Reads where things are along the axes: the parameter file of `simulated_axes`, or a plain one.

A plain file holds axis names and below each the keys of layout_reader.layouts_from; beside the
names it may hold what is true of all axes (`OF_ALL_AXES`). What is not known is left out, or null:
a switch, the hard stops or one of them, ``index_offset``. The keys of a follower of a gantry stand
below its full name, ``y.y2``.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, nan
from os import PathLike
from pathlib import Path
from typing import Any

import yaml

from ..parameters.configuration import AXIS_DEFINITIONS
from ..parameters.definition import InvalidParameters, read, table
from ..parameters.yaml_file import OnceLoader
from .layout import (
    DEAD_TIME,
    FEEDBACK_RATE,
    LAYOUT,
    SWITCH_RATE,
    SWITCHES,
    AxisLayout,
    with_switch_rate,
)
from .layout_reader import layouts_from

PARAMETERS = 'ros__parameters'

#: The keys that tell two ends.
ENDS = ('hard_stops', *SWITCHES)

#: What a layout file says about all axes, under the names of the parameters of `simulated_axes`.
OF_ALL_AXES = table(FEEDBACK_RATE, DEAD_TIME, SWITCH_RATE)


def _is_joint(key: str) -> bool:
    """Return whether a key of `simulated_axes` names a joint; a layout has none."""
    return key.rpartition('.')[2] == 'joint'


class InvalidLayout(InvalidParameters):
    """A layout file that cannot be used; ``faults`` lists why, a line each."""


@dataclass(frozen=True)
class LayoutFile:
    """What a layout file holds.

    ``feedback_rate`` (Hz) and ``dead_time`` (s) are true of all axes; None: not given.
    """

    layouts: Mapping[str, AxisLayout]
    feedback_rate: float | None = None
    dead_time: float | None = None


class _Loader(OnceLoader):
    """YAML without its surprises: y and no are names, 1e-3 is a number."""


_Loader.yaml_implicit_resolvers = {
    first: [
        (tag, pattern)
        for tag, pattern in known
        if tag.rpartition(':')[2] not in ('bool', 'float', 'timestamp')
    ]
    for first, known in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_Loader.add_implicit_resolver(
    'tag:yaml.org,2002:bool', re.compile(r'(?:true|True|TRUE|false|False|FALSE)$'), list('tTfF')
)
_Loader.add_implicit_resolver(
    'tag:yaml.org,2002:float',
    re.compile(
        r'[-+]?(?:(?:[0-9]+\.[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|[0-9]+[eE][-+]?[0-9]+'
        r'|\.(?:inf|Inf|INF|nan|NaN|NAN))$'
    ),
    list('-+.0123456789'),
)


def _whole(loader: _Loader, node: yaml.ScalarNode) -> int:
    """Return a whole number; Python reads none with thousands of digits."""
    try:
        return int(loader.construct_yaml_int(node))
    except ValueError:
        raise yaml.constructor.ConstructorError(
            problem='a whole number that is too long', problem_mark=node.start_mark
        ) from None


_Loader.add_constructor('tag:yaml.org,2002:int', _whole)


@dataclass
class _Reader:
    """Collects the entries of the axes, and the lines where they stand."""

    entries: dict[str, Any] = field(default_factory=dict)
    lines: dict[tuple[str, str], int] = field(default_factory=dict)

    def take(self, node: yaml.Node, loader: _Loader, plain: bool) -> None:
        """Take the axes of a plain file or of a node's parameters."""
        assert isinstance(node, yaml.MappingNode)
        for key, value in node.value:
            axis, dot, rest = str(key.value).partition('.')
            line = key.start_mark.line + 1
            if isinstance(value, yaml.MappingNode):
                self._take_block(axis, rest, value, loader, plain)
            elif dot and not plain:  # x.lag: is lag: below x:
                if not _is_joint(rest):
                    self._own(axis)[rest] = loader.construct_object(value, deep=True)
                    self.lines[axis, rest] = line
            elif plain and axis not in OF_ALL_AXES:
                self.entries[str(key.value)] = loader.construct_object(value, deep=True)
            else:
                continue
            self.lines.setdefault((axis, rest), line)
            if axis in self.entries:
                self.lines.setdefault((axis, ''), line)

    def _take_block(
        self, axis: str, follower: str, node: yaml.MappingNode, loader: _Loader, plain: bool
    ) -> None:
        """Take the entries below the name of an axis or of a follower."""
        own, known = self._own(axis), loader.construct_mapping(node, deep=True)
        for key, value in node.value:
            name = '.'.join(filter(None, (follower, str(key.value))))
            self.lines[axis, name] = key.start_mark.line + 1
            if isinstance(value, yaml.MappingNode) and '.' not in name:
                self._take_block(axis, name, value, loader, plain)
            elif plain or not _is_joint(name):
                own[name] = known[loader.construct_object(key)]

    def _own(self, axis: str) -> dict[str, Any]:
        own: dict[str, Any] = self.entries.setdefault(axis, {})
        return own

    def located(self, path: Path, fault: str) -> str:
        """Put the file and the line before a fault, which begins with the axis and the key."""
        axis, _, key = fault.partition(': ')[0].partition('.')
        block = key.partition('.')[0]
        line = next(filter(None, (self.lines.get((axis, k)) for k in (key, block, ''))), None)
        return f'{path}:{line}: {fault}' if line else f'{path}: {fault}'


def load(path: str | PathLike[str]) -> LayoutFile:
    """Read a layout file.

    Raises:
        InvalidLayout: Every fault, each with the file's name and, where it is known, the line.
    """
    path = Path(path)
    reader, general = _contents(path)
    if not reader.entries:
        raise InvalidLayout([f'{path}: no axis in it'])
    known = {axis: _filled(entries) for axis, entries in reader.entries.items()}
    faults: list[str] = []
    layouts: dict[str, AxisLayout] = {}
    try:
        layouts = layouts_from(known)
    except InvalidParameters as error:
        faults += [reader.located(path, fault) for fault in error.faults]
    general = {key: value for key, value in general.items() if value is not None}
    about_all, found = read(general, OF_ALL_AXES)
    faults += [f'{path}: {fault}' for fault in found]
    if faults:
        raise InvalidLayout(faults)
    for axis, entries in reader.entries.items():
        layout = with_switch_rate(layouts[axis], about_all['switch_rate'])
        unknown = [key for key in entries if key.endswith('index_offset') and entries[key] is None]
        layouts[axis] = _without_index_offset(axis, layout, unknown)
    given = {name: about_all[name] for name in general if name != 'switch_rate'}
    return LayoutFile(layouts, **given)


def _without_index_offset(axis: str, layout: AxisLayout, unknown: Sequence[str]) -> AxisLayout:
    """Return the layout with no index offset where it is not known, on each side."""
    followers = {
        name: one._replace(index_offset=nan)
        if f'{name.removeprefix(f"{axis}.")}.index_offset' in unknown
        else one
        for name, one in layout.followers.items()
    }
    if 'index_offset' in unknown:
        layout = layout._replace(index_offset=nan)
    return layout._replace(followers=followers)


def is_layout(path: str | PathLike[str]) -> bool:
    """Return whether a file holds keys that only a layout has, be they right or wrong."""
    try:
        reader, _ = _contents(Path(path))
    except InvalidLayout:
        return False
    return any(
        key in LAYOUT and key not in AXIS_DEFINITIONS
        for own in reader.entries.values()
        if isinstance(own, dict)
        for key in own
    )


def _contents(path: Path) -> tuple[_Reader, dict[str, Any]]:
    """Return the entries of the axes as they stand in a file, and what is said about all axes."""
    reader = _Reader()
    general: dict[str, Any] = {}
    try:
        loader = _Loader(path.read_text(encoding='utf-8'))
        root = loader.get_single_node()
        if not isinstance(root, yaml.MappingNode):
            raise InvalidLayout([f'{path}: expected the names of axes, and below each its keys'])
        blocks = list(_blocks(root))
        for block in blocks or [root]:
            reader.take(block, loader, plain=not blocks)
        for block in blocks or [root]:
            general |= {
                key.value: loader.construct_object(value, deep=True)
                for key, value in block.value
                if key.value in OF_ALL_AXES and (blocks or not isinstance(value, yaml.MappingNode))
            }
    except OSError as error:
        raise InvalidLayout([f'{path}: {error.strerror}']) from None
    except UnicodeDecodeError:
        raise InvalidLayout([f'{path}: not UTF-8']) from None
    except RecursionError:
        raise InvalidLayout([f'{path}: nested too deeply']) from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        text = ', '.join(filter(None, (error.context, error.problem)))
        raise InvalidLayout([f'{path}:{mark.line + 1 if mark else 1}: {text}']) from None
    except yaml.YAMLError as error:
        raise InvalidLayout([f'{path}: {error}']) from None
    return reader, general


def _blocks(node: yaml.Node) -> Iterator[yaml.MappingNode]:
    """Yield the parameters of the nodes that a ROS parameter file has some for."""
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            if key.value != PARAMETERS:
                yield from _blocks(value)
            elif isinstance(value, yaml.MappingNode):
                yield value


def _filled(entries: object) -> object:
    """Put something in the place of what is not known."""
    if not isinstance(entries, dict):
        return entries
    filled = {
        key: value
        for key, value in entries.items()
        if value is not None or _of_follower(key) in SWITCHES  # that side has no such switch
    }
    for name, ends in filled.items():
        if (_of_follower(name) or name) in ENDS and isinstance(ends, list) and len(ends) == 2:
            filled[name] = [
                unknown if end is None else end
                for end, unknown in zip(ends, (-inf, inf), strict=True)
            ]
    stops = filled.setdefault('hard_stops', [-inf, inf])
    if (
        'start' not in filled
        and isinstance(stops, list)
        and len(stops) == 2
        and all(isinstance(end, int | float) for end in stops)
    ):
        finite = [end for end in stops if abs(end) < inf]
        if len(finite) == 2 and not min(finite) <= 0.0 <= max(finite):
            filled['start'] = sum(finite) / 2
        elif len(finite) == 1 and not (stops[0] <= 0.0 <= stops[1]):
            filled['start'] = finite[0]
    return filled


def _of_follower(key: str) -> str:
    """Return the key without the name of the follower, '' where it is the axis's own."""
    return key.partition('.')[2]
