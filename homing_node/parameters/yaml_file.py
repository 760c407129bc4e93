# SPDX-License-Identifier: Apache-2.0
"""Reads a ROS parameter file without ROS: the names and values that rcl would give to a node.

rcl reads YAML in its own way: an unquoted ``y`` is a boolean, ``1e-3`` a number, a date a string,
a number out of its range, too; a list holds one type. An empty list, which rcl does not set, is
one here, as for the node. What rcl refuses is refused here too, with the line.
"""

import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from .axis import DEFINITIONS
from .configuration import Configuration, configuration
from .definition import InvalidParameters

NODE = '/homing_node'

TRUE = frozenset(['y', 'Y', 'yes', 'Yes', 'YES', 'true', 'True', 'TRUE', 'on', 'On', 'ON'])
FALSE = frozenset(['n', 'N', 'no', 'No', 'NO', 'false', 'False', 'FALSE', 'off', 'Off', 'OFF'])
#: A whole number of 64 bits is no longer, characters.
LONGEST_INTEGER = 40
OCTAL = re.compile(r'[-+]?0[0-7]+')
INTEGER = re.compile(r'[-+]?(0[xX][0-9a-fA-F]+|0|[1-9][0-9]*)')
REAL = re.compile(
    r'[-+]?(([0-9]+\.?[0-9]*|\.[0-9]+)(e[-+]?[0-9]+)?|(?P<named>\.?(inf|nan)))', re.IGNORECASE
)
ZERO = re.compile(r'[-+]?[0.]+(e[-+]?[0-9]+)?', re.IGNORECASE)


@dataclass
class ParameterFile:
    """What a file gives to one node: values by flat name (``x.travel``), and where they stand."""

    path: Path
    values: dict[str, Any] = field(default_factory=dict)
    lines: dict[str, int] = field(default_factory=dict)

    def located(self, fault: str) -> str:
        """Put the file and the line before a fault that begins with a parameter's name.

        A parameter that is not in the file is placed at what it would stand under.
        """
        name = fault.partition(':')[0]
        while name and name not in self.lines:
            name = name.rpartition('.')[0]
        return f'{self.path}:{self.lines[name]}: {fault}' if name else f'{self.path}: {fault}'


def load(path: Path | str, node: str = NODE) -> Configuration:
    """Read and check a parameter file, as the node does at its start.

    Raises InvalidParameters with every fault, each with the file's name and line.
    """
    return checked(read(path, node))


def checked(file: ParameterFile) -> Configuration:
    """Check what was read from a file; raises InvalidParameters as `load` does."""
    try:
        return configuration(file.values)
    except InvalidParameters as error:
        raise InvalidParameters(map(file.located, error.faults)) from None


def is_configuration(path: Path | str) -> bool:
    """Return whether a file holds parameters of an axis for some node, right or wrong."""
    file = ParameterFile(Path(path))
    try:
        for document in _documents(_content(file.path), file.path):
            for _, parameters in _blocks(document):
                for key, value in parameters.value:
                    _flatten(file, _text(key), value, 0)
    except (_Fault, InvalidParameters):
        return False
    return any(name.partition('.')[2] in DEFINITIONS for name in file.values)


def read(path: Path | str, node: str = NODE) -> ParameterFile:
    """Read what a parameter file gives to a node, named with its namespace.

    Where two blocks fit the node, the last one wins, value by value. Raises InvalidParameters
    where rcl could not read the file, or where no block fits the node.
    """
    return parsed(_content(Path(path)), path, node)


def parsed(data: bytes, path: Path | str, node: str = NODE) -> ParameterFile:
    """Read the contents of a parameter file as `read` does; ``path`` is for the messages."""
    file = ParameterFile(Path(path))
    node = f'/{node.lstrip("/")}'
    others = []
    try:
        for document in _documents(data, file.path):
            for name, parameters in _blocks(document):
                if _fits(name, node):
                    for key, value in parameters.value:
                        _flatten(file, _text(key), value, key.start_mark.line + 1)
                else:
                    others.append(name)
    except _Fault as fault:
        raise InvalidParameters([f'{file.path}:{fault}']) from None
    if not file.values:
        found = f', only for {", ".join(others)}' if others else ''
        raise InvalidParameters([f'{file.path}: no parameters for {node}{found}'])
    return file


def written(node: str, values: Mapping[str, object]) -> str:
    """Return a parameter file that gives some values to a node.

    Args:
        node: The full name of the node.
        values: The values, by flat name (``x.travel``).
    """
    nested: dict[str, Any] = {}
    for name, value in values.items():
        first, _, rest = name.partition('.')
        if rest:
            nested.setdefault(first, {})[rest] = value
        else:
            nested[first] = value
    contents = {f'/{node.strip("/")}': {'ros__parameters': nested}}
    return yaml.dump(contents, Dumper=_Dumper, sort_keys=False)


class _Dumper(yaml.SafeDumper):
    """YAML in which rcl reads each text as a text."""


def _represent_text(dumper: _Dumper, text: str) -> yaml.Node:
    other = text in TRUE | FALSE or any(
        kind.fullmatch(text) for kind in (OCTAL, INTEGER, REAL, ZERO)
    )
    style = '"' if other else None
    return dumper.represent_scalar('tag:yaml.org,2002:str', text, style)


_Dumper.add_representer(str, _represent_text)


class _Fault(Exception):
    """What is wrong in a file, and at which line."""

    def __init__(self, line: int, text: str) -> None:
        super().__init__(f'{line}: {text}')


class OnceLoader(yaml.SafeLoader):
    """YAML where no name stands twice; elsewhere the last one would win unseen."""

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        node = super().compose_mapping_node(anchor)
        names = [key.value for key, _ in node.value]
        for n, (key, _) in enumerate(node.value):
            if key.value in names[:n]:
                raise yaml.composer.ComposerError(
                    problem=f'{key.value} stands there twice', problem_mark=key.start_mark
                )
        return node


class _Loader(OnceLoader):
    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            line = self.get_event().start_mark.line + 1  # type: ignore[no-untyped-call]
            raise _Fault(line, 'ROS reads no aliases (*name)')
        return super().compose_node(parent, index)


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InvalidParameters([f'{path}: {error.strerror}']) from None


def _documents(data: bytes, path: Path) -> Iterator[yaml.Node]:
    try:
        yield from yaml.compose_all(data.decode(), _Loader)
    except RecursionError:
        raise InvalidParameters([f'{path}: nested too deeply']) from None
    except UnicodeDecodeError as error:
        raise _Fault(data.count(b'\n', 0, error.start) + 1, 'not UTF-8') from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        text = ', '.join(filter(None, (error.context, error.problem)))
        raise _Fault(mark.line + 1 if mark else 1, text) from None
    except yaml.reader.ReaderError as error:
        line = data.decode().count('\n', 0, error.position) + 1
        raise _Fault(line, f'the character {error.character!r} is not allowed') from None


def _blocks(node: yaml.Node, name: str = '') -> Iterator[tuple[str, yaml.MappingNode]]:
    """Yield the name of each node that the file has parameters for, and the parameters."""
    line = node.start_mark.line + 1
    if not isinstance(node, yaml.MappingNode):
        raise _Fault(line, "expected a node's name, then ros__parameters, then its parameters")
    for key, value in node.value:
        if _text(key) != 'ros__parameters':
            yield from _blocks(value, f'{name}/{_text(key)}')
        elif isinstance(value, yaml.MappingNode):
            yield name, value
        else:
            raise _Fault(line, 'ros__parameters: expected names and values below it')


def _fits(name: str, node: str) -> bool:
    """Tell whether a block's name, with * for one part and ** for any number, fits a node."""
    wild = {'*': r'/\w+', '**': r'(/\w+)*'}
    parts = filter(None, name.split('/'))
    return re.fullmatch(''.join(wild.get(p, f'/{re.escape(p)}') for p in parts), node) is not None


def _flatten(file: ParameterFile, name: str, node: yaml.Node, line: int) -> None:
    """Take a value, or every value below a mapping."""
    file.lines[name] = line
    if isinstance(node, yaml.MappingNode):
        if not node.value:
            raise _Fault(line, f'{name}: no value')
        for key, value in node.value:
            _flatten(file, f'{name}.{_text(key)}', value, key.start_mark.line + 1)
    elif isinstance(node, yaml.ScalarNode):
        file.values[name] = _scalar(name, node)
    else:
        if any(isinstance(item, yaml.SequenceNode) for item in node.value):
            raise _Fault(line, f'{name}: a list holds no lists; {_joined(node.value)}')
        items = [_scalar(name, item) for item in node.value]
        kinds = sorted({type(item).__name__ for item in items})
        if len(kinds) > 1:
            quote = '; quote the names, an unquoted y or n is a boolean' if 'str' in kinds else ''
            raise _Fault(line, f'{name}: a list of {" and ".join(kinds)}{quote}')
        file.values[name] = items


def _joined(items: list[yaml.Node]) -> str:
    """Return how groups of names are written in a list."""
    groups = [item.value if isinstance(item, yaml.SequenceNode) else [item] for item in items]
    names = [', '.join(str(each.value) for each in group) for group in groups]
    return f'write each as one string: {names}'


def _scalar(name: str, node: yaml.Node) -> Any:
    text, line = node.value, node.start_mark.line + 1
    if not isinstance(node, yaml.ScalarNode):
        raise _Fault(line, f'{name}: a list holds single values only')
    if node.style is not None:
        return text
    if not text:
        raise _Fault(line, f'{name}: no value')
    if text in TRUE or text in FALSE:
        return text in TRUE
    octal = OCTAL.fullmatch(text)
    if len(text) <= LONGEST_INTEGER and (octal or INTEGER.fullmatch(text)):
        whole = int(text, 8 if octal else 0)
        if -(2**63) <= whole < 2**63:
            return whole
    if not (found := REAL.fullmatch(text)):
        return text
    real = float(re.sub(r'\.(?=[in])', '', text.lower()))
    exact = (
        found['named']
        or ZERO.fullmatch(text)
        or (sys.float_info.min <= abs(real) <= sys.float_info.max)
    )
    return real if exact else text


def _text(key: yaml.Node) -> str:
    if not isinstance(key, yaml.ScalarNode):
        raise _Fault(key.start_mark.line + 1, 'a name must be a single word')
    return str(key.value)
