# SPDX-License-Identifier: Apache-2.0
"""Fits an expression to a message type: from names of fields to their places in the layout.

Which element of an array is meant is found in each message (reader.py). A condition is about the
field of that name in the element; if the element has none, about the field beside the array: an
array of keys, one for each element, or a single value, which says whether the message is about
this input at all.
"""

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

from .expression import DATA, BadExpression, Condition, Lookup, Part, Path, Source, Value
from .layout import BITS, Array, Layout, Number, Opaque, Structure, Text

#: What a key is compared with: a number, or the bytes of a text.
Wanted = int | bytes


@dataclass(frozen=True)
class Key:
    """A field that must have a value: its place among the fields, and how it was written."""

    field: int
    wanted: Wanted
    code: str  # of `struct`, '' for a text
    text: str


@dataclass(frozen=True)
class Step:
    """One field on the way to a value, and which of its elements.

    Attributes:
        name: the name of the field.
        field: its place among the fields of the structure.
        index: the element, None: it is found by keys, or the field is no array.
        inside: keys in the element.
        beside: keys in arrays beside this one, which have an element for each of its elements.
        filters: keys in the structure: a message without them is not about this input.
    """

    name: str
    field: int
    index: int | None = None
    inside: tuple[Key, ...] = ()
    beside: tuple[Key, ...] = ()
    filters: tuple[Key, ...] = ()

    @cached_property
    def searched(self) -> bool:
        """Whether the element is found by its keys."""
        return bool(self.inside or self.beside)

    @cached_property
    def name_beside(self) -> Key | None:
        """The name in an array of texts beside that alone tells the element, if one does."""
        if self.inside or self.filters or len(self.beside) != 1 or self.beside[0].code:
            return None
        return self.beside[0]


@dataclass(frozen=True)
class Bound:
    """A number in messages of one type, and what counts of it."""

    steps: tuple[Step, ...]
    number: Number
    mask: int | None
    equals: int | None


@dataclass(frozen=True)
class BoundSource:
    """The value of an input, and the counter of a latch."""

    value: Bound
    counter: Bound | None = None


def bind(source: Source, layout: Structure, default: Value = DATA) -> BoundSource:
    """Fit what a user wrote to a message type.

    Args:
        source: what the user wrote.
        layout: the layout of the type.
        default: the value where the user names only a topic.

    Raises:
        BadExpression: it does not fit; the message has the fields that there are.
    """
    if source.value is None and default is DATA and 'data' not in layout.names:
        raise BadExpression(
            f"{layout.kind} has no field data: write what is the input behind a '#'; it has "
            f'{layout.listed}'
        )
    value = _bind(source.value or default, layout)
    return BoundSource(value, _bind(source.counter, layout) if source.counter else None)


def _bind(value: Value, layout: Structure) -> Bound:
    place = value.place
    path = _path_of(place, layout) if isinstance(place, Lookup) else place
    steps: list[Step] = []
    here: Layout = layout
    for part in path.parts:
        if not isinstance(here, Structure):
            raise BadExpression(
                f'{steps[-1].name} ({here.kind}) has no fields, so no {part.field}'
            )
        step, here = _step(part, here, layout)
        steps.append(step)
    name = steps[-1].name
    if isinstance(here, Array):
        raise BadExpression(f'{name} ({here.kind}) is an array: which element? {name}[0], say')
    if isinstance(here, Structure):
        raise BadExpression(f'{name} ({here.kind}) is no number: which field? {here.listed}')
    if not isinstance(here, Number):
        raise BadExpression(f'{name} is {_what(here)}, a number is expected')
    if value.mask is not None and here.code in BITS:
        bits = 1 if here.kind == 'boolean' else BITS[here.code]
        if value.mask >> bits:
            raise BadExpression(f'the mask {value.mask:#x} has bits beyond {name} ({here.kind})')
    return Bound(tuple(steps), here, value.mask, value.equals)


def _step(part: Part, here: Structure, message: Structure) -> tuple[Step, Layout]:
    layout = here.field(part.field)
    if layout is None:
        raise BadExpression(_no_field(part.field, here))
    for before, one in zip(here.names, here.fields, strict=True):
        if isinstance(one, Opaque):
            raise BadExpression(f'{before} ({one.kind}) of {here.kind} cannot be read')
        if before == part.field:
            break
    field = here.names.index(part.field)
    if part.index is not None:
        if not isinstance(layout, Array):
            raise BadExpression(f'{part.field} ({layout.kind}) is no array, so no {part}')
        if layout.count is not None and part.index >= layout.count:
            raise BadExpression(
                f'{part.field} ({layout.kind}) has the elements 0 to {layout.count - 1}, not '
                f'{part.index}'
            )
        return Step(part.field, field, part.index), layout.of
    if not part.where:
        return Step(part.field, field), layout
    inside, beside, filters = [], [], []
    element = layout.of if isinstance(layout, Array) else None
    for condition in part.where:
        if isinstance(element, Structure) and condition.field in element.names:
            inside.append(_key(condition, element, False))
        elif isinstance(here.field(condition.field), Array):
            if element is None:
                raise BadExpression(
                    f'{part}: {condition.field} is an array, but {part.field} is none'
                )
            beside.append(_key(condition, here, True))
        elif condition.field in here.names:
            filters.append(_key(condition, here, False))
        else:
            there = element if isinstance(element, Structure) else here
            raise BadExpression(f'{part}: {_no_field(condition.field, there)}')
    step = Step(part.field, field, None, tuple(inside), tuple(beside), tuple(filters))
    return step, element if element is not None and step.searched else layout


def _key(condition: Condition, where: Structure, in_array: bool) -> Key:
    layout = where.field(condition.field)
    if in_array and isinstance(layout, Array):
        layout = layout.of
    field, text = where.names.index(condition.field), str(condition)
    if isinstance(layout, Text):
        return Key(field, condition.text.encode(), '', text)
    if not isinstance(layout, Number) or layout.code not in BITS:
        kind = layout.kind if layout else ''
        raise BadExpression(f'{text}: {condition.field} ({kind}) is neither an integer nor a text')
    words = {'true': 1, 'false': 0} if layout.kind == 'boolean' else {}
    try:
        wanted = words[condition.text] if condition.text in words else int(condition.text, 0)
    except ValueError:
        raise BadExpression(f'{text}: {condition.field} is an integer ({layout.kind})') from None
    bits = BITS[layout.code]
    low, high = (
        (-(1 << bits - 1), (1 << bits - 1) - 1) if layout.code.islower() else (0, (1 << bits) - 1)
    )
    if not low <= wanted <= high:
        raise BadExpression(f'{text}: {condition.field} ({layout.kind}) is {low} to {high}')
    return Key(field, wanted, layout.code, text)


def _path_of(lookup: Lookup, layout: Structure) -> Path:
    """Return the way to a value of a group, or of a joint.

    A message has groups if it has one array of names, and one array of structures with one array
    of names and one array of numbers (DynamicInterfaceGroupValues, DynamicJointState); it has
    joints if it has one array of names and arrays of numbers (JointState).
    """
    names = [name for name, one in _fields(layout) if _is_array(one, Text)]
    groups = [
        (name, one.of)
        for name, one in _fields(layout)
        if isinstance(one, Array) and isinstance(one.of, Structure) and _named_numbers(one.of)
    ]
    numbers = [name for name, one in _fields(layout) if _is_array(one, Number)]
    if len(names) == 1 and len(groups) == 1:
        field, element = groups[0]
        (inner_names, inner_numbers) = _named_numbers(element) or ('', '')
        return Path(
            (
                Part(field, None, (Condition(names[0], lookup.group, True),)),
                Part(inner_numbers, None, (Condition(inner_names, lookup.name, True),)),
            )
        )
    if len(names) == 1 and numbers:
        if lookup.name not in numbers:
            raise BadExpression(
                f'{layout.kind} has no {lookup.name!r} of {lookup.group!r}, only '
                f'{", ".join(numbers)}'
            )
        return Path((Part(lookup.name, None, (Condition(names[0], lookup.group, True),)),))
    raise BadExpression(
        f'{layout.kind} has no groups or joints by name, so no {lookup}; it has {layout.listed}'
    )


def _named_numbers(structure: Structure) -> tuple[str, str] | None:
    """Return the one array of names and the one array of numbers, None where it has not both."""
    names = [name for name, one in _fields(structure) if _is_array(one, Text)]
    numbers = [name for name, one in _fields(structure) if _is_array(one, Number)]
    return (names[0], numbers[0]) if len(names) == len(numbers) == 1 else None


def _fields(structure: Structure) -> Iterable[tuple[str, Layout]]:
    return zip(structure.names, structure.fields, strict=True)


def _is_array(layout: Layout, of: type[Number | Text]) -> bool:
    return isinstance(layout, Array) and isinstance(layout.of, of)


def _no_field(name: str, structure: Structure) -> str:
    close = difflib.get_close_matches(name, structure.names, 1)
    hint = f'; did you mean {close[0]}?' if close else ''
    return f'{structure.kind} has no field {name}; it has {structure.listed}{hint}'


def _what(layout: Layout) -> str:
    return 'text' if isinstance(layout, Text) else f'a {layout.kind}'
