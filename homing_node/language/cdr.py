# SPDX-License-Identifier: Apache-2.0
"""Finds where everything is in a serialized message: the one walk through CDR.

A message is walked up to the last field that is wanted. What the walk depends on (lengths, and
texts) is noted as spans of bytes: a message with the same bytes there has everything at the same
places. Alignment leaves bytes between that mean nothing, and may be anything.

Source of the format: OMG DDS-XTypes 1.3, 7.4.1 (numbers of n bytes are aligned to n, counted from
the end of the 4-byte header; texts and sequences begin with their length; texts end with a zero).
"""

import struct
from typing import Any, NamedTuple

from .layout import SIZES, Array, Layout, Number, Structure, Text

#: The first two bytes of plain CDR, and the byte order for `struct`.
ORDERS = {b'\x00\x01': '<', b'\x00\x00': '>'}
#: What unpacks each number, by byte order and character of `struct`.
NUMBERS = {f'{order}{code}': struct.Struct(order + code) for order in '<>' for code in SIZES}
#: The header in front of what is aligned.
HEADER = 4
LENGTH_MASK = b'\xff' * 4
#: Arrays of texts are looked up by this many of their first bytes; of those that begin alike, so
#: many are remembered; and so many in all.
KEY, MOST_ALIKE, MOST_KNOWN = 24, 8, 64
#: A message with more elements (names, structures) than this is not walked: it would be late.
MOST_ELEMENTS = 8192


class Broken(ValueError):
    """The bytes are no message of the type that was expected."""


class Numbers(NamedTuple):
    """Where an array of numbers is: its first byte, and the number of its elements."""

    begin: int
    elements: int


class Texts:
    """An array of texts, as it stands in a message.

    Attributes:
        names: the texts.
        elements: the elements that have each text.
        block: the bytes of the array, behind its count.
        mask: 0xff for each of these bytes that means something.
    """

    __slots__ = ('names', 'elements', 'block', 'mask')

    def __init__(self, data: bytes, order: str, count: int, at: int) -> None:
        """Read an array that begins at a byte; raises struct.error where the data end."""
        length = struct.Struct(f'{order}I').unpack_from
        names, mask, end = [], bytearray(), at
        for _ in range(count):
            begin = end + -end % 4
            mask += bytes(begin - end)
            end = begin + 4 + length(data, begin)[0]
            if end > len(data):
                raise struct.error
            mask += b'\xff' * (end - begin)
            names.append(data[begin + 4 : end - 1])
        self.names = names
        self.block, self.mask = data[at:end], bytes(mask)
        self.elements: dict[bytes, list[int]] = {}
        for number, name in enumerate(names):
            self.elements.setdefault(name, []).append(number)


#: The arrays of texts that were read before, by their count and first bytes.
Known = dict[tuple[str, int, bytes], list[Texts]]

#: Where a field is. A number: its first byte; numbers: `Numbers`; a text: its bytes; texts:
#: `Texts`; a structure, an array of structures: a list of places.
Place = Any


class Walk:
    """One message: the places of its first fields.

    Attributes:
        data: the message.
        order: its byte order, as `struct` writes it.
        fields: the places of the fields of the message, in their order.
        spans: the bytes that the places depend on: the first one, and a mask for it and the next
            ones.
        end: the first byte behind.
    """

    def __init__(self, data: bytes, layout: Structure, fields: int, known: Known) -> None:
        """Walk through the first fields of a message.

        Args:
            data: the message.
            layout: the layout of its type.
            fields: how many of its fields are wanted.
            known: arrays of texts that were read before; the walk adds those that are new.

        Raises:
            Broken: it ends too early, has another encoding, or more elements than MOST_ELEMENTS.
        """
        self.data = data
        order = ORDERS.get(bytes(data[:2]))
        if order is None:
            raise Broken(f'the encoding {bytes(data[:2]).hex()} is not plain CDR')
        self.order = order
        self.spans = [(0, b'\xff\xff')]
        self.end = HEADER
        self._known = known
        self._left = MOST_ELEMENTS
        self._length = struct.Struct(f'{order}I').unpack_from
        try:
            self.fields = [self._place(one) for one in layout.fields[:fields]]
        except struct.error:
            self._ends_early()
        self._check_end()

    def number(self, begin: int, code: str) -> Any:
        """Return a number, by its first byte and its character of `struct`."""
        return NUMBERS[self.order + code].unpack_from(self.data, begin)[0]

    def _check_end(self) -> None:
        if self.end > len(self.data):
            self._ends_early()

    def _ends_early(self) -> None:
        raise Broken(f'its {len(self.data)} bytes are too few')

    def _place(self, layout: Layout) -> Place:
        if isinstance(layout, Number):
            begin = self.end + (HEADER - self.end) % layout.size
            self.end = begin + layout.size
            return begin
        if isinstance(layout, Text):
            begin = self.end + -self.end % 4
            self.end = end = begin + 4 + self._length(self.data, begin)[0]
            self._check_end()
            self.spans.append((begin, b'\xff' * (end - begin)))
            return self.data[begin + 4 : end - 1]
        if isinstance(layout, Structure):
            if not layout.fields:
                self.end += 1  # a structure is never empty
            return [self._place(one) for one in layout.fields]
        if isinstance(layout, Array):
            return self._array(layout)
        raise Broken(f'{layout.kind} cannot be read')

    def _array(self, layout: Array) -> Place:
        count, of = layout.count, layout.of
        if count is None:
            begin = self.end + -self.end % 4
            (count,) = self._length(self.data, begin)
            self.end = begin + 4
            self.spans.append((begin, LENGTH_MASK))
        if isinstance(of, Number):
            begin = self.end + (HEADER - self.end) % of.size if count else self.end
            self.end = begin + count * of.size
            self._check_end()
            return Numbers(begin, count)
        self._left -= count
        if self._left < 0:
            raise Broken(f'it has more than {MOST_ELEMENTS} elements')
        if isinstance(of, Text):
            return self._texts(count)
        places = []
        for _ in range(count):
            places.append(self._place(of))
            self._check_end()
        return places

    def _texts(self, count: int) -> Texts:
        """Return an array of texts; most were read before."""
        begin = self.end
        key = self.order, count, self.data[begin : begin + KEY]
        known = self._known.setdefault(key, [])
        for texts in known:
            if self.data.startswith(texts.block, begin):
                break
        else:
            texts = Texts(self.data, self.order, count, begin)
            known.insert(0, texts)
            del known[MOST_ALIKE:]
            if len(self._known) > MOST_KNOWN:
                self._known.clear()
        self.end = begin + len(texts.block)
        self.spans.append((begin, texts.mask))
        return texts
