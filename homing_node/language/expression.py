# SPDX-License-Identifier: Apache-2.0
"""The grammar: what a user writes for an input, as a tree.

::

    source    = topic [ "#" value [ "@" value ] ]
    value     = ( path | lookup ) [ "&" integer ] [ "==" integer ]
    path      = part { "." part }
    part      = field [ "[" ( integer | condition { "," condition } ) "]" ]
    condition = field "=" name
    lookup    = name "/" name

A field is a word of letters, digits and ``_``. An integer is decimal, hexadecimal (``0x``) or
binary (``0b``). A name is any text without the marks of the grammar, or any text in quotes.
"""

import re
from dataclasses import dataclass

FIELD = re.compile(r'[A-Za-z][A-Za-z0-9_]*')
#: A name that needs no quotes, outside and inside of brackets.
NAME = re.compile(r'[^/&@=#\[\]\'"]+')
SELECTED = re.compile(r'[^,=\[\]\'"]+')
NUMBER = re.compile(r'[+-]?[0-9][0-9A-Za-z_]*')


class BadExpression(ValueError):
    """What the user wrote is not in the grammar, or does not fit the type of the message."""


@dataclass(frozen=True)
class Condition:
    """What a field must be, as it is written; ``quoted`` text is no number."""

    field: str
    text: str
    quoted: bool = False

    def __str__(self) -> str:
        return (
            f'{self.field}={_quoted(self.text, SELECTED) if not self.quoted else repr(self.text)}'
        )


@dataclass(frozen=True)
class Part:
    """A field, and which of its elements: by index, or the one for which conditions hold."""

    field: str
    index: int | None = None
    where: tuple[Condition, ...] = ()

    def __str__(self) -> str:
        if self.index is not None:
            return f'{self.field}[{self.index}]'
        return f'{self.field}[{",".join(map(str, self.where))}]' if self.where else self.field


@dataclass(frozen=True)
class Path:
    """The way to a value through the fields of a message."""

    parts: tuple[Part, ...]

    def __str__(self) -> str:
        return '.'.join(map(str, self.parts))


@dataclass(frozen=True)
class Lookup:
    """A value by two names: of a group (or of a joint), and of an interface in it."""

    group: str
    name: str

    def __str__(self) -> str:
        return f'{_quoted(self.group, NAME)}/{_quoted(self.name, NAME)}'


@dataclass(frozen=True)
class Value:
    """A number of a message.

    Attributes:
        place: where it is.
        mask: the bits that count, None: the whole number.
        equals: on is the number (or its bits) that is this one; None: any from 0.5 on, any bit.
    """

    place: Path | Lookup
    mask: int | None = None
    equals: int | None = None

    @property
    def is_level(self) -> bool:
        """Whether the value is on or off, and no number."""
        return self.mask is not None or self.equals is not None

    def __str__(self) -> str:
        mask = '' if self.mask is None else f' & 0x{self.mask:02X}'
        equals = '' if self.equals is None else f' == {self.equals:#x}'
        return f'{self.place}{mask}{equals}'


#: What a message without a `#` stands for.
DATA = Value(Path((Part('data'),)))


@dataclass(frozen=True)
class Source:
    """What a user wrote for an input.

    Attributes:
        topic: the name of the topic.
        value: what in its messages is the input; None: what its type has for it.
        counter: what changes with each new value of a latch; None: each message is a new one.
    """

    topic: str
    value: Value | None = None
    counter: Value | None = None

    @property
    def expression(self) -> str:
        """What stands behind the topic, in one spelling; '' for the field `data` alone."""
        if self.value is None or (self.value == DATA and self.counter is None):
            return ''
        return f'{self.value}' + ('' if self.counter is None else f' @ {self.counter}')

    def at(self, topic: str) -> str:
        """Return the source as text, with another name of its topic: what identifies a signal."""
        return f'{topic}#{self.expression}' if self.expression else topic

    def __str__(self) -> str:
        return self.at(self.topic)


def parse(text: str) -> Source:
    """Parse what a user wrote for an input; the topic's name is not checked.

    Raises:
        BadExpression: it is not in the grammar; the message says where, and what should be there.
    """
    topic, mark, expression = text.partition('#')
    if not mark:
        return Source(topic.strip())
    scanner = _Scanner(expression)
    value, counter = scanner.value(), None
    if scanner.takes('@'):
        counter = scanner.value()
    scanner.end()
    return Source(topic.strip(), value, counter)


class _Scanner:
    """Reads an expression from left to right."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._at = 0
        self._skip()

    def value(self) -> Value:
        place = self._lookup() if self._is_lookup() else self._path()
        mask = equals = None
        if self.takes('&'):
            mask = self._integer('a mask, such as 0x04,')
            if mask <= 0:
                raise self._bad(f'the mask {mask} must be > 0')
        if self.takes('=='):
            equals = self._integer('a number')
            if mask is not None and equals & ~mask:
                raise self._bad(f'{equals:#x} has bits that the mask {mask:#x} has not')
        return Value(place, mask, equals)

    def takes(self, mark: str) -> bool:
        """Go on behind a mark, if it stands here; return whether it does."""
        if not self._text.startswith(mark, self._at):
            return False
        self._at += len(mark)
        self._skip()
        return True

    def end(self) -> None:
        if self._at < len(self._text):
            raise self._bad("the end, '&', '==' or '@' is expected")

    def _is_lookup(self) -> bool:
        """Return whether a '/' stands before the end of the place, outside of brackets."""
        plain = re.sub(r'\'[^\']*\'|"[^"]*"|\[[^\]]*\]', '', self._text[self._at :])
        return '/' in re.split('[&@=]', plain)[0]

    def _lookup(self) -> Lookup:
        names = [self._name(NAME, 'the name of a group')]
        while self.takes('/'):
            names.append(self._name(NAME, 'the name of an interface'))
        if len(names) < 2:
            raise self._bad("'/' is expected between the names of a group and an interface")
        return Lookup('/'.join(names[:-1]), names[-1])

    def _path(self) -> Path:
        parts = [self._part()]
        while self.takes('.'):
            parts.append(self._part())
        return Path(tuple(parts))

    def _part(self) -> Part:
        field = self._field()
        if not self.takes('['):
            return Part(field)
        if NUMBER.match(self._text, self._at):
            index = self._integer('an index')
            if index < 0:
                raise self._bad(f'the index {index} must be >= 0')
            self._closes()
            return Part(field, index)
        conditions = [self._condition()]
        while self.takes(','):
            conditions.append(self._condition())
        self._closes()
        return Part(field, None, tuple(conditions))

    def _condition(self) -> Condition:
        field = self._field('an index, or a field and its value such as pin=3,')
        if not self.takes('='):
            raise self._bad(f"'=' and a value are expected behind {field}")
        quoted = self._text[self._at : self._at + 1] in ("'", '"')
        return Condition(field, self._name(SELECTED, f'the value of {field}'), quoted)

    def _closes(self) -> None:
        if not self.takes(']'):
            raise self._bad("']' is expected")

    def _field(self, what: str = 'the name of a field') -> str:
        found = FIELD.match(self._text, self._at)
        if found is None:
            raise self._bad(f'{what} is expected')
        return self._take(found.end())

    def _name(self, plain: re.Pattern[str], what: str) -> str:
        mark = self._text[self._at : self._at + 1]
        if mark in ('"', "'") and mark:
            end = self._text.find(mark, self._at + 1)
            if end < 0:
                raise self._bad(f'the quote {mark} is not closed')
            return self._take(end + 1)[1:-1]
        found = plain.match(self._text, self._at)
        if found is None:
            raise self._bad(f'{what} is expected')
        return self._take(found.end()).strip()

    def _integer(self, what: str) -> int:
        found = NUMBER.match(self._text, self._at)
        if found is None:
            raise self._bad(f'{what} is expected')
        try:
            number = int(found[0], 0)
        except ValueError:
            raise self._bad(f'{found[0]!r} is no integer') from None
        self._take(found.end())
        return number

    def _take(self, end: int) -> str:
        text = self._text[self._at : end]
        self._at = end
        self._skip()
        return text

    def _skip(self) -> None:
        while self._text[self._at : self._at + 1].isspace():
            self._at += 1

    def _bad(self, what: str) -> BadExpression:
        here = self._text[self._at :]
        place = f'before {here!r}' if here else 'at the end'
        return BadExpression(f'{self._text.strip()!r}: {what} {place}')


def _quoted(text: str, plain: re.Pattern[str]) -> str:
    """Return a name as it must be written."""
    if plain.fullmatch(text) and text == text.strip():
        return text
    return f'"{text}"' if "'" in text else f"'{text}'"
