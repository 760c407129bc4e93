# SPDX-License-Identifier: Apache-2.0
"""The layout of a message type: its fields in their order, as their types are written.

ROS tells the fields of a type as text: ``float64``, ``sequence<string>``, ``std_msgs/Header``.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from .expression import BadExpression

#: The numbers of a message: the character of `struct`. A name of ROS and a name of IDL are one.
NUMBERS: Mapping[str, str] = {
    'boolean': 'B',
    'octet': 'B',
    'uint8': 'B',
    'int8': 'b',
    'char': 'B',
    'uint16': 'H',
    'int16': 'h',
    'uint32': 'I',
    'int32': 'i',
    'uint64': 'Q',
    'int64': 'q',
    'float': 'f',
    'double': 'd',
}
BITS = {'B': 8, 'b': 8, 'H': 16, 'h': 16, 'I': 32, 'i': 32, 'Q': 64, 'q': 64}
SIZES = {**{code: bits // 8 for code, bits in BITS.items()}, 'f': 4, 'd': 8}

ARRAY = re.compile(r'(?P<of>.+)\[(?P<count>\d+)\]')
SEQUENCE = re.compile(r'sequence<(?P<of>.+?)(, *(?P<bound>\d+))?>')
TEXT = re.compile(r'string(<\d+>)?')

#: Returns the fields of a message type `package/Name`, in their order: the type of each by its
#: name. Raises LookupError if the type is not installed.
FieldsOf = Callable[[str], Mapping[str, str]]


@dataclass(frozen=True)
class Number:
    """A number: its type, and its character of `struct`."""

    kind: str
    code: str

    @property
    def size(self) -> int:
        return SIZES[self.code]


@dataclass(frozen=True)
class Text:
    """A text of bytes."""

    kind: str = 'string'


@dataclass(frozen=True)
class Opaque:
    """What this program cannot read; nothing behind it can be found in a message."""

    kind: str


@dataclass(frozen=True)
class Structure:
    """A message: the names and the layouts of its fields."""

    kind: str
    names: tuple[str, ...]
    fields: tuple['Layout', ...]

    def field(self, name: str) -> 'Layout | None':
        """Return the layout of a field, None if there is none of this name."""
        return self.fields[self.names.index(name)] if name in self.names else None

    @property
    def listed(self) -> str:
        """The fields that there are, with their types."""
        return ', '.join(
            f'{name} ({field.kind})' for name, field in zip(self.names, self.fields, strict=True)
        )


@dataclass(frozen=True)
class Array:
    """Elements of one layout; ``count`` is None where each message says how many."""

    kind: str
    of: 'Number | Text | Opaque | Structure'
    count: int | None = None


Layout = Number | Text | Opaque | Structure | Array


def layout_of(kind: str, fields_of: FieldsOf) -> Structure:
    """Return the layout of a message type ``package/Name`` or ``package/msg/Name``.

    Raises:
        BadExpression: the type, or the type of a field, is not installed.
    """
    name = kind.replace('/msg/', '/')
    try:
        fields = fields_of(name)
    except LookupError as error:
        raise BadExpression(f'the type {kind} is not installed here: {error.args[0]}') from None
    return Structure(
        name, tuple(fields), tuple(_layout(one, fields_of) for one in fields.values())
    )


def _layout(kind: str, fields_of: FieldsOf) -> Layout:
    if kind in NUMBERS:
        return Number(kind, NUMBERS[kind])
    if TEXT.fullmatch(kind):
        return Text(kind)
    found = SEQUENCE.fullmatch(kind) or ARRAY.fullmatch(kind)
    if found is not None:
        of = _layout(found['of'], fields_of)
        if isinstance(of, Array):
            return Opaque(kind)
        count = found.groupdict().get('count')
        return Array(kind, of, None if count is None else int(count))
    if '/' in kind:
        return layout_of(kind, fields_of)
    return Opaque(kind)
