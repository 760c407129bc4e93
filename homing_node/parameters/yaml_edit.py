# SPDX-License-Identifier: Apache-2.0
"""Changes values in the text of a ROS parameter file; all that the user wrote around them stays.

A value that stands on a line of its own is replaced there. A parameter that is not in the file is
added below the last one of its axis. The comment that says why stands above the line.
"""

import re
from collections.abc import Sequence
from enum import Enum
from textwrap import wrap
from typing import NamedTuple

from .yaml_file import ParameterFile

#: A name, its value, and the comment behind it.
LINE = re.compile(
    r"""(?P<indent>\s*)(?P<key>'[^']*'|"[^"]*"|[^\s'"#:{}]+)\s*:\s+"""
    r"""(?P<value>'[^']*'|"[^"]*"|[^\s#'"\[{&*|>][^#]*?)(?P<rest>\s*(?:\s#.*)?)"""
)
#: A line of a comment is not longer than this.
WIDTH = 96


class Edit(NamedTuple):
    """A value for a parameter, by its flat name (``x.travel``), and why it has it."""

    name: str
    value: object
    why: str


class NotEditable(ValueError):
    """A file whose parameters do not stand on lines of their own."""


def edited(text: str, file: ParameterFile, edits: Sequence[Edit]) -> str:
    """Return the text of a file with other values.

    Args:
        text: The text of the file.
        file: What was read from it.
        edits: The values; each belongs to an axis (its name has a dot).

    Raises:
        NotEditable: A value does not stand on a line of its own, or an axis has no such line.
    """
    lines = text.splitlines()
    inserted: dict[int, list[str]] = {}  # before the line with this index
    for edit in edits:
        if edit.name in file.values:
            at = file.lines[edit.name] - 1
            found = _match(lines[at], edit.name)
            old = found['value'].strip()
            head = lines[at][: found.start('value')]
            lines[at] = f'{head}{plain(edit.value)}{found["rest"]}'
            comment = _comment(found['indent'], f'was {old}: {edit.why}')
            inserted.setdefault(at, []).extend(comment)
        else:
            at, indent, prefix = _end_of(lines, file, edit.name.rpartition('.')[0])
            name = f'{prefix}{edit.name.rpartition(".")[2]}'
            inserted.setdefault(at, []).extend(
                [*_comment(indent, edit.why), f'{indent}{name}: {plain(edit.value)}']
            )
    made: list[str] = []
    for n, line in enumerate([*lines, None]):
        made += inserted.get(n, ())
        if line is not None:
            made.append(line)
    return '\n'.join(made) + '\n'


def _match(line: str, name: str) -> re.Match[str]:
    found = LINE.fullmatch(line)
    if found is None or not f'.{name}'.endswith(f'.{found["key"].strip(chr(34) + chr(39))}'):
        raise NotEditable(f'{name} does not stand on a line of its own')
    return found


def _end_of(lines: Sequence[str], file: ParameterFile, axis: str) -> tuple[int, str, str]:
    """Return after which line a parameter of an axis is added, its indent, what precedes it."""
    of_axis = {
        name: line - 1
        for name, line in file.lines.items()
        if name in file.values and name.rpartition('.')[0] == axis
    }
    for name, at in sorted(of_axis.items(), key=lambda each: -each[1]):
        found = LINE.fullmatch(lines[at])
        if found:
            key = found['key'].strip('"\'')
            if f'.{name}'.endswith(f'.{key}'):
                return at + 1, found['indent'], key.removesuffix(name.rpartition('.')[2])
    raise NotEditable(f'no parameter of axis {axis} stands on a line of its own')


def _comment(indent: str, text: str) -> list[str]:
    return [f'{indent}# {line}' for line in wrap(text, WIDTH - len(indent) - 2)]


def plain(value: object) -> str:
    """Return a value as YAML that ROS reads: a number with a point is real."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        text = f'{value:.9g}'
        return text if any(sign in text for sign in '.en') else f'{text}.0'
    if isinstance(value, Enum):
        return f"'{value}'"
    return str(value)
