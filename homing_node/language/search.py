# SPDX-License-Identifier: Apache-2.0
"""Finds what is wanted in a message that was walked: by index, and by keys.

What several inputs want is a tree: a step that several of them begin with is gone once for all.
"""

import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

from .cdr import Place, Texts, Walk
from .layout import SIZES
from .resolve import Bound, Key, Step

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
#: The keys of all elements, and the elements that have each of them.
Table = tuple[Sequence[Any], dict[Any, list[int]]]


class Wanted:
    """Numbers that are wanted of the messages of one type."""

    def __init__(self, bounds: Sequence[Bound]) -> None:
        """Note what is wanted."""
        self._count = len(bounds)
        self._ways = _ways(
            [_Path(slot, one.steps, one.number.code) for slot, one in enumerate(bounds)]
        )

    def find(self, walk: Walk, places: Sequence[Place]) -> list[Said]:
        """Return the number of each bound value, or why it is not there.

        Args:
            walk: a message.
            places: the places of its fields.
        """
        found: list[Said] = [NOT_MINE] * self._count
        search = _Search(walk)
        for way in self._ways:
            way.find(search, places, found)
        return found


class _Search:
    """What is found in one message."""

    def __init__(self, walk: Walk) -> None:
        self.walk = walk
        self._tables: dict[tuple[int, int], Table] = {}  # by array, and field of its elements

    def matches(self, step: Step, place: Place, outer: Place) -> tuple[Sequence[int], str]:
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
        if isinstance(array, tuple):
            begin, elements = array
            begins = range(begin, begin + elements * SIZES[key.code], SIZES[key.code])
            return [self.walk.number(begin, key.code) for begin in begins]
        if not key.code:
            return [element[field] for element in array]
        return [self.walk.number(element[field], key.code) for element in array]


class _Path(NamedTuple):
    """The rest of the way to a number: its place in what is found, its character of `struct`."""

    slot: int
    steps: Sequence[Step]
    code: str


def _ways(paths: Sequence[_Path]) -> 'list[_Way | _Columns]':
    """Return the ways of some paths that begin at one structure."""
    further: dict[Step, list[_Path]] = {}
    for slot, steps, code in paths:
        further.setdefault(steps[0], []).append(_Path(slot, steps[1:], code))
    ways: list[_Way | _Columns] = []
    columns: dict[tuple[int, int], list[_Way]] = {}
    for way in (_Way(step, rest) for step, rest in further.items()):
        if way.code and way.step.name_beside:
            place = way.step.field, way.step.name_beside.field
            columns.setdefault(place, []).append(way)
        else:
            ways.append(way)
    return [*ways, *map(_Columns, columns.values())]


class _Way:
    """A step to a number, or to a structure in which ways begin.

    Attributes:
        step: the step.
        slots: the places, in what is found, of all numbers to which it leads.
        code: the character of the number for `struct`, '' where the step leads to a structure.
    """

    def __init__(self, step: Step, paths: Sequence[_Path]) -> None:
        """Note a step, and the paths behind it."""
        self.step = step
        self.slots = [path.slot for path in paths]
        self.code = '' if paths[0].steps else paths[0].code
        self._ways = [] if self.code else _ways(paths)

    def find(self, search: _Search, place: Place, found: list[Said]) -> None:
        """Note the numbers that are found in a structure at a place."""
        step, walk = self.step, search.walk
        for key in step.filters:
            one = place[key.field]
            if (walk.number(one, key.code) if key.code else one) != key.wanted:
                return
        outer, place = place, place[step.field]
        index = step.index
        if step.searched:
            name = step.name_beside
            matches: Sequence[int] = ()
            if name:
                matches = outer[name.field].elements.get(name.wanted, ())
            if len(matches) != 1:
                matches, why = search.matches(step, place, outer)
                if why:
                    self._note(Missing(why), found)
                    return
            index = matches[0]
        if index is not None:
            begin, count = place if isinstance(place, tuple) else (None, len(place))
            if index >= count:
                self._note(Missing(f'{step.name} has {count} elements, none at {index}'), found)
                return
            place = place[index] if begin is None else begin + index * SIZES[self.code]
        if self.code:
            self._note(walk.number(place, self.code), found)
        for way in self._ways:
            way.find(search, place, found)

    def _note(self, said: Said, found: list[Said]) -> None:
        for slot in self.slots:
            found[slot] = said


class _Columns:
    """Ways to numbers of one array by their names, which stand in one array of texts beside.

    Where each number is, is noted at the array of texts.
    """

    def __init__(self, ways: Sequence[_Way]) -> None:
        self._ways = ways
        step = ways[0].step
        self._field, self._code = step.field, ways[0].code
        (key,) = step.beside
        self._keys = key.field

    def find(self, search: _Search, place: Place, found: list[Said]) -> None:
        """Note the numbers that are found in a structure at a place."""
        texts = place[self._keys]
        columns = texts.notes.get(self)
        if columns is None:
            columns = texts.notes[self] = self._columns(search, place)
        begin, elements = place[self._field]
        if columns.needed > elements:
            for way in self._ways:
                way.find(search, place, found)
            return
        numbers = columns.numbers.unpack_from(search.walk.data, begin)
        for slot, index in columns.indices:
            found[slot] = numbers[index]
        for slot, missing in columns.missing:
            found[slot] = missing

    def _columns(self, search: _Search, place: Place) -> '_Found':
        indices: list[tuple[int, int]] = []
        missing: list[tuple[int, Missing]] = []
        for way in self._ways:
            matches, why = search.matches(way.step, place[self._field], place)
            if why:
                missing += [(slot, Missing(why)) for slot in way.slots]
            else:
                indices += [(slot, matches[0]) for slot in way.slots]
        needed = 1 + max((index for _, index in indices), default=-1)
        numbers = struct.Struct(f'{search.walk.order}{needed}{self._code}')
        return _Found(needed, numbers, indices, missing)


class _Found(NamedTuple):
    """Where numbers are in an array.

    Attributes:
        needed: how many elements it must have.
        numbers: unpacks these.
        indices: the place of each number, in what is found and among these.
        missing: the place of each other number in what is found, and why it is not there.
    """

    needed: int
    numbers: struct.Struct
    indices: Sequence[tuple[int, int]]
    missing: Sequence[tuple[int, Missing]]
