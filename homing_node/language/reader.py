# SPDX-License-Identifier: Apache-2.0
"""Reads the values of some inputs from the messages of one topic.

The first two messages of a shape (lengths, names, their order) are walked, and the place of each
value is noted. The next ones of that shape need two steps: a comparison of what the places depend
on, and one `struct.unpack` of all values. Some shapes are remembered, for drivers whose groups
change their order from message to message.
"""

import struct
from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple

from .cdr import Broken, Known, Place, Walk
from .layout import SIZES, Structure
from .resolve import Bound, BoundSource
from .search import NOT_MINE, Found, Missing, NotMine, Said, Search

#: Shapes that are remembered.
MOST_SHAPES = 8
NS = 1_000_000_000


class Reading(NamedTuple):
    """What a message says.

    Attributes:
        stamp: its header's stamp, ns; 0 where it has none.
        values: the number of each input.
        counters: the number of each counter, None where an input has none.
        same: whether all of them are as in the message before.
    """

    stamp: int
    values: Sequence[Said]
    counters: Sequence[Said | None]
    same: bool


class Reader:
    """Reads messages of one type; ``sources`` says what of them."""

    def __init__(self, layout: Structure, sources: Sequence[BoundSource]) -> None:
        self._layout = layout
        self._sources = sources
        bounds = [one for source in sources for one in (source.value, source.counter) if one]
        self._stamp = _stamp_field(layout)
        last = max((_last_field(bound) for bound in bounds), default=-1)
        self._fields = 1 + max(last, -1 if self._stamp is None else self._stamp)
        self._shapes: list[_Shape] = []
        self._shape: _Shape | None = None
        self._texts: Known = {}
        # Where everything was in the last messages that were walked.
        self._places: deque[Place] = deque(maxlen=MOST_SHAPES)
        self._numbers: tuple[Any, ...] = ()
        self._reading = Reading(0, (), (), False)

    def forget(self) -> None:
        """Take the next message as a new one, whatever it says."""
        self._shape = None

    def read(self, data: bytes) -> Reading:
        """Return what a message says.

        Raises:
            Broken: the bytes are no message of this type.
        """
        shape = self._shape_of(data)
        if shape is None:
            return self._walk(data)
        numbers = shape.values.unpack_from(data)
        stamp = 0
        if shape.stamp is not None:
            seconds, nanoseconds = shape.stamp.unpack_from(data, shape.stamp_at)
            stamp = seconds * NS + nanoseconds
        if numbers == self._numbers and shape is self._shape:
            return self._reading._replace(stamp=stamp, same=True)
        self._shape, self._numbers = shape, numbers
        self._reading = Reading(
            stamp,
            [one.value(numbers) for one in shape.inputs],
            [None if one is None else one.value(numbers) for one in shape.counters],
            False,
        )
        return self._reading

    def _shape_of(self, data: bytes) -> '_Shape | None':
        """Return the shape of a message, None if it is not known."""
        size, bits = -1, 0
        for shape in self._shapes:
            if shape.size != size:
                size = shape.size
                bits = int.from_bytes(data[:size], 'little')
            if bits & shape.mask == shape.expected and len(data) >= size:
                return shape
        return None

    def _walk(self, data: bytes) -> Reading:
        """Walk through a message; remember its shape if one that was walked lately had it."""
        walk = Walk(data, self._layout, self._fields, self._texts)
        find, layout = Search(walk).find, self._layout
        inputs = [find(one.value, layout) for one in self._sources]
        counters = [find(one.counter, layout) if one.counter else None for one in self._sources]
        self._shape = None
        if walk.fields in self._places:
            self._shapes.insert(0, _Shape(walk, inputs, counters, self._stamp))
            del self._shapes[MOST_SHAPES:]
        self._places.append(walk.fields)
        stamp = 0
        if self._stamp is not None:
            seconds, nanoseconds = walk.fields[self._stamp][0]
            stamp = walk.number(seconds, 'i') * NS + walk.number(nanoseconds, 'I')
        return Reading(
            stamp,
            [one.value_in(walk) for one in inputs],
            [None if one is None else one.value_in(walk) for one in counters],
            False,
        )


class _Shape:
    """Where the values are in all messages of one shape.

    Attributes:
        mask: the bits of a message that tell its shape, as the bits of one integer.
        expected: what these bits are.
        size: how many bytes of a message matter.
        values: unpacks all numbers that are meant.
        inputs: where the value of each input is.
        counters: where the counter of each input is.
        stamp: unpacks the header's stamp at `stamp_at`, None where there is no header.
    """

    def __init__(
        self,
        walk: Walk,
        inputs: Sequence[Found],
        counters: Sequence[Found | None],
        stamp: int | None,
    ) -> None:
        self.inputs, self.counters = inputs, counters
        found = [one for one in (*self.inputs, *self.counters) if one]
        spots = {one.spot for one in found if one.spot}
        spots.update(spot for one in found for spot, _ in one.filters)
        at, codes, numbers = 0, '', {}
        for number, spot in enumerate(sorted(spots)):
            begin, code = spot
            codes += f'{begin - at}x{code}'
            at = begin + SIZES[code]
            numbers[spot] = number
        for one in found:
            one.number_from(numbers)
        self.values = struct.Struct(walk.order + codes)
        self.stamp: struct.Struct | None = None
        self.stamp_at = 0
        if stamp is not None:
            self.stamp = struct.Struct(f'{walk.order}iI')
            self.stamp_at = walk.fields[stamp][0][0]
        self.size = walk.end
        mask = bytearray(walk.end)
        for begin, span in walk.spans:
            mask[begin : begin + len(span)] = span
        self.mask = int.from_bytes(mask, 'little')
        self.expected = int.from_bytes(walk.data[: walk.end], 'little') & self.mask


def _last_field(bound: Bound) -> int:
    """Return the last field of a message that the way to a value needs."""
    first = bound.steps[0]
    return max([first.field, *(key.field for key in (*first.beside, *first.filters))])


def _stamp_field(layout: Structure) -> int | None:
    """Return which field is a header with a stamp, None if there is none."""
    header = layout.field('header')
    if not isinstance(header, Structure) or header.names[:1] != ('stamp',):
        return None
    stamp = header.fields[0]
    if not isinstance(stamp, Structure) or stamp.names != ('sec', 'nanosec'):
        return None
    return layout.names.index('header')


__all__ = ['NOT_MINE', 'Broken', 'Missing', 'NotMine', 'Reader', 'Reading', 'Said']
