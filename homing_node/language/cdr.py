# SPDX-License-Identifier: Apache-2.0
"""Finds where everything is in a serialized message: the one walk through CDR.

A message is walked up to the last field that is wanted. Nothing is assumed of the message before,
but for arrays of texts: one that was read before is found again by a comparison of its bytes.
Alignment leaves bytes between that mean nothing, and may be anything.

Source of the format: OMG DDS-XTypes 1.3, 7.4.1 (numbers of n bytes are aligned to n, counted from
the end of the 4-byte header; texts and sequences begin with their length; texts end with a zero).
"""

import struct
from collections.abc import Callable, Sequence
from typing import Any

from .expression import BadExpression
from .layout import SIZES, Array, Layout, Number, Structure, Text

#: The first two bytes of plain CDR, and the byte order for `struct`.
ORDERS = {b'\x00\x01': '<', b'\x00\x00': '>'}
#: What unpacks each number, by byte order and character of `struct`.
NUMBERS = {f'{order}{code}': struct.Struct(order + code) for order in '<>' for code in SIZES}
#: The header in front of what is aligned.
HEADER = 4
#: Of arrays with the same first text and as many texts, so many are remembered; so many in all.
MOST_ALIKE, MOST_KNOWN = 8, 64
#: A message with more elements (names, structures) than this is not walked: it would be late.
MOST_ELEMENTS = 8192


class Broken(ValueError):
    """The bytes are no message of the type that was expected."""


#: Where an array of numbers is: its first byte, and the number of its elements.
Numbers = tuple[int, int]


class Texts:
    """An array of texts.

    Attributes:
        names: the texts.
        elements: the elements that have each text.
        size: how many bytes it has behind its count.
        pattern: unpacks the texts with their lengths, without what lies between them.
        words: what it unpacks.
        notes: what others have found out of the texts, by who they are.
    """

    __slots__ = ('names', 'elements', 'size', 'notes', 'pattern', 'words')

    def __init__(self, data: bytes, order: str, count: int, begin: int) -> None:
        """Read an array whose texts begin at a byte; raises struct.error where the data end."""
        length = NUMBERS[f'{order}I'].unpack_from
        end, pattern = begin, '='
        self.names = []
        for _ in range(count):
            at = end + -end % 4
            pattern += f'{at - end}x'
            end = at + 4 + length(data, at)[0]
            if end > len(data):
                raise struct.error
            pattern += f'{end - at}s'
            self.names.append(data[at + 4 : end - 1])
        self.size = end - begin
        self.elements: dict[Any, list[int]] = {}
        for number, name in enumerate(self.names):
            self.elements.setdefault(name, []).append(number)
        self.notes: dict[Any, Any] = {}
        self.pattern = struct.Struct(pattern)
        self.words = self.pattern.unpack_from(data, begin)


class TextArrays:
    """The arrays of texts that were read before."""

    def __init__(self) -> None:
        # By byte order, number of texts, and first text.
        self._known: dict[tuple[str, int, bytes], list[Texts]] = {}

    def read(self, data: bytes, order: str, count: int, begin: int) -> Texts:
        """Return the array whose texts begin at a byte; raises struct.error where the data end."""
        if not count:
            return Texts(data, order, 0, begin)
        first = begin + -begin % 4
        end = first + 4 + NUMBERS[f'{order}I'].unpack_from(data, first)[0]
        alike = self._known.setdefault((order, count, data[first:end]), [])
        for texts in alike:
            if texts.size <= len(data) - begin and (
                texts.pattern.unpack_from(data, begin) == texts.words
            ):
                return texts
        texts = Texts(data, order, count, begin)
        alike.insert(0, texts)
        del alike[MOST_ALIKE:]
        if len(self._known) > MOST_KNOWN:
            self._known.clear()
        return texts


#: Where a field is. A number: its first byte; numbers: `Numbers`; a text: its bytes; texts:
#: `Texts`; a structure, an array of structures: a list of places.
Place = Any


class Walk:
    """A message on the way through its fields.

    Attributes:
        data: the message.
        order: its byte order, as `struct` writes it.
        end: the first byte behind what was walked through.
        left: how many elements it may still have.
        known: the arrays of texts that were read before.
        length: unpacks a length that stands at a byte.
    """

    __slots__ = ('data', 'order', 'end', 'left', 'known', 'length')

    def __init__(self, data: bytes, known: TextArrays) -> None:
        """Stand at the beginning of a message; raises Broken where it is no plain CDR."""
        order = ORDERS.get(data[:2])
        if order is None:
            raise Broken(f'the encoding {data[:2].hex()} is not plain CDR')
        self.data, self.order, self.end = data, order, HEADER
        self.left, self.known = MOST_ELEMENTS, known
        self.length = NUMBERS[f'{order}I'].unpack_from

    def number(self, begin: int, code: str) -> Any:
        """Return a number, by its first byte and its character of `struct`."""
        return NUMBERS[self.order + code].unpack_from(self.data, begin)[0]

    def take(self, elements: int) -> None:
        """Count more elements; raises Broken where they are too many."""
        self.left -= elements
        if self.left < 0:
            raise Broken(f'it has more than {MOST_ELEMENTS} elements')


class Fields:
    """The first fields of the messages of a type."""

    def __init__(self, layout: Structure, count: int) -> None:
        """Prepare the walk through some fields of a layout."""
        self._places = [_place_of(one) for one in layout.fields[:count]]

    def walk(self, data: bytes, known: TextArrays) -> tuple[Walk, Sequence[Place]]:
        """Walk through the fields of a message; return their places, in their order.

        Args:
            data: the message.
            known: arrays of texts that were read before; the walk adds those that are new.

        Raises:
            Broken: it ends too early, has another encoding, or more elements than MOST_ELEMENTS.
        """
        walk = Walk(data, known)
        try:
            places = [place(walk) for place in self._places]
        except struct.error:
            walk.end = len(data) + 1
        if walk.end > len(data):
            raise Broken(f'its {len(data)} bytes are too few')
        return walk, places


def _place_of(layout: Layout) -> Callable[[Walk], Place]:
    """Return what walks through a field of a layout, and returns its place."""
    if isinstance(layout, Number):
        return _number(layout.size)
    if isinstance(layout, Structure):
        return _structure(layout)
    if isinstance(layout, Text):
        return _text
    if isinstance(layout, Array):
        return _array(layout)
    raise BadExpression(f'{layout.kind} cannot be read')


def _number(size: int) -> Callable[[Walk], int]:
    def place(walk: Walk) -> int:
        begin = walk.end + (HEADER - walk.end) % size
        walk.end = begin + size
        return begin

    return place


def _text(walk: Walk) -> bytes:
    length, begin = _count(walk)
    walk.end = begin + length
    return walk.data[begin : walk.end - 1]


def _count(walk: Walk) -> tuple[int, int]:
    """Return the number of elements of what begins here, and the first byte behind it."""
    begin = walk.end + -walk.end % 4
    return walk.length(walk.data, begin)[0], begin + 4


def _structure(layout: Structure) -> Callable[[Walk], list[Place]]:
    fields = [_place_of(one) for one in layout.fields]

    def place(walk: Walk) -> list[Place]:
        return [field(walk) for field in fields]

    def empty(walk: Walk) -> list[Place]:
        walk.end += 1  # a structure is never empty
        return []

    return place if fields else empty


def _array(layout: Array) -> Callable[[Walk], Place]:
    of, fixed = layout.of, layout.count
    count_of = _count if fixed is None else (lambda walk: (fixed, walk.end))
    if isinstance(of, Number):
        size = of.size

        def numbers(walk: Walk) -> Numbers:
            count, begin = count_of(walk)
            if count:
                begin += (HEADER - begin) % size
            walk.end = begin + count * size
            return begin, count

        return numbers
    if isinstance(of, Text):

        def texts(walk: Walk) -> Texts:
            count, begin = count_of(walk)
            walk.take(count)
            found = walk.known.read(walk.data, walk.order, count, begin)
            walk.end = begin + found.size
            return found

        return texts
    element = _place_of(of)

    def elements(walk: Walk) -> list[Place]:
        count, walk.end = count_of(walk)
        walk.take(count)
        return [element(walk) for _ in range(count)]

    return elements
