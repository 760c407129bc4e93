# SPDX-License-Identifier: Apache-2.0
"""Finds the values of some inputs in a message that was walked: by index, and by keys."""

import struct
from collections.abc import Sequence
from math import isfinite
from typing import Any, NamedTuple

from .cdr import Numbers, Place, Texts, Walk
from .layout import SIZES, Array, Layout, Number, Structure
from .resolve import Bound, Key, Named, Step

#: Keys that a message about a missing one lists.
LISTED = 12


class Missing(NamedTuple):
    """The value is not in a message; ``text`` says why.

    ``unread``: it is there, but no finite number; the driver has not read it yet.
    """

    text: str
    unread: bool = False


class NotMine(NamedTuple):
    """The message is not about the input."""


NOT_MINE = NotMine()

#: What a message says of an input.
Said = float | Missing | NotMine
#: A number of a message: its first byte, and its character of `struct`.
Spot = tuple[int, str]
#: The keys of all elements, and the elements that have each of them.
Table = tuple[Sequence[Any], dict[Any, list[int]]]


class Found:
    """Where a value is in all messages of a shape, or why it is not there.

    Attributes:
        spot: where it is, None: it is not there.
        filters: where numbers are that must have a value, and that value.
        why: why it is not there; None: the message is not about the input.
    """

    __slots__ = ('_bound', 'spot', 'filters', 'why', '_index', '_wanted')

    def __init__(
        self,
        bound: Bound,
        spot: Spot | None = None,
        filters: Sequence[tuple[Spot, Any]] = (),
        why: str | None = None,
    ) -> None:
        self._bound = bound
        self.spot, self.filters, self.why = spot, filters, why
        self._index = 0
        self._wanted: list[tuple[int, Any]] = []

    def number_from(self, numbers: dict[Spot, int]) -> None:
        """Note which of the numbers that are unpacked are meant."""
        if self.spot is not None:
            self._index = numbers[self.spot]
        self._wanted = [(numbers[spot], wanted) for spot, wanted in self.filters]

    def value(self, numbers: tuple[Any, ...]) -> Said:
        """Return what was written, of the numbers of a message that are unpacked."""
        for index, wanted in self._wanted:
            if numbers[index] != wanted:
                return NOT_MINE
        if self.spot is None:
            return NOT_MINE if self.why is None else Missing(self.why)
        return self._said(numbers[self._index])

    def value_in(self, walk: Walk) -> Said:
        """Return the same of a message that was walked."""
        for spot, wanted in self.filters:
            if walk.number(*spot) != wanted:
                return NOT_MINE
        if self.spot is None:
            return NOT_MINE if self.why is None else Missing(self.why)
        return self._said(walk.number(*self.spot))

    def _said(self, number: float) -> Said:
        """Return a number, masked or compared (0 or 1), as it was written."""
        if not isfinite(number):
            return Missing(f'it is {number:g}', unread=True)
        mask, equals = self._bound.mask, self._bound.equals
        if mask is not None:
            if number != int(number):
                return Missing(f'{number:g} has no bits')
            number = int(number) & mask
        return number if equals is None else number == equals


class Search:
    """Finds values in one message; what it looks at becomes part of the message's shape."""

    def __init__(self, walk: Walk) -> None:
        self._walk = walk
        self._tables: dict[tuple[int, int], Table] = {}  # by array, and field of its elements

    def spot(self, names: Sequence[Named], code: str) -> Spot | None:
        """Return where a value is to which names alone lead, None if `find` must say why not."""
        place: Place = self._walk.fields
        for field, keys, wanted, size in names:
            elements = place[keys].elements.get(wanted)
            if elements is None or len(elements) != 1:
                return None
            (index,) = elements
            place = place[field]
            if size:
                begin, count = place
                return (begin + index * size, code) if index < count else None
            if index >= len(place):
                return None
            place = place[index]
        return None

    def find(self, bound: Bound, layout: Structure) -> Found:
        """Return where a value is."""
        if bound.names:
            spot = self.spot(bound.names, bound.number.code)
            if spot is not None:
                return Found(bound, spot)
        place: Place = self._walk.fields
        here: Layout = layout
        filters = []
        for step in bound.steps:
            assert isinstance(here, Structure)
            for key in step.filters:
                if key.code:
                    filters.append(((place[key.field], key.code), key.wanted))
                elif place[key.field] != key.wanted:
                    return Found(bound)
            outer, place, here = place, place[step.field], here.fields[step.field]
            if step.index is None and not step.searched:
                continue
            assert isinstance(here, Array)
            index = step.index
            if index is None:
                matches, why = self._matches(step, place, outer)
                if why:
                    return Found(bound, None, filters, why)
                index = matches[0]
            count = place.elements if isinstance(place, Numbers) else len(place)
            if index >= count:
                why = f'{step.name} has {count} elements, none at {index}'
                return Found(bound, None, filters, why)
            here = here.of
            if isinstance(place, Numbers):
                assert isinstance(here, Number)
                place = place.begin + index * here.size
            else:
                place = place[index]
        return Found(bound, (place, bound.number.code), filters)

    def _matches(self, step: Step, place: Place, outer: Place) -> tuple[Sequence[int], str]:
        """Return the element that has the keys of a step, or why it is not one."""
        keys = (*step.beside, *step.inside)
        tables = [self._table(outer[key.field], key) for key in step.beside]
        tables += [self._table(place, key, key.field) for key in step.inside]
        found: Sequence[int] = tables[0][1].get(keys[0].wanted, ())
        for key, (_, more) in zip(keys[1:], tables[1:], strict=True):
            found = [one for one in found if one in more.get(key.wanted, ())]
        if len(found) == 1:
            return found, ''
        wanted = ','.join(key.text for key in keys)
        if found:
            return found, f'{len(found)} elements of {step.name} have {wanted}'
        there = [
            one.decode(errors='replace') if isinstance(one, bytes) else str(one)
            for one in tables[0][0][: LISTED + 1]
        ]
        there[LISTED:] = ['...'] * (len(there) > LISTED)
        listed = ', '.join(there) or 'none'
        return (), f'no element of {step.name} has {wanted}; there are {listed}'

    def _table(self, array: Place, key: Key, field: int = -1) -> Table:
        """Return the keys of an array of keys; or, with a field, those within its elements."""
        if isinstance(array, Texts):
            return array.names, array.elements
        name = id(array), field
        if name not in self._tables:
            keys = self._keys(array, key, field)
            elements: dict[Any, list[int]] = {}
            for number, one in enumerate(keys):
                elements.setdefault(one, []).append(number)
            self._tables[name] = keys, elements
        return self._tables[name]

    def _keys(self, array: Place, key: Key, field: int) -> Sequence[Any]:
        if not key.code:
            return [element[field] for element in array]
        walk, size = self._walk, SIZES[key.code]
        if isinstance(array, Numbers):
            begins = [array.begin + size * number for number in range(array.elements)]
        else:
            begins = [element[field] for element in array]
        walk.spans += [(begin, b'\xff' * size) for begin in begins]
        number = struct.Struct(walk.order + key.code)
        return [number.unpack_from(walk.data, begin)[0] for begin in begins]
