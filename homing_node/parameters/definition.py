# SPDX-License-Identifier: Apache-2.0
"""The definition of a value that a user sets: kind, unit, bounds, meaning, default.

Parameters of the node, parameters of an axis, keys of a layout and parameters of the simulated
axes are all tables of definitions; :func:`read` reads each of them. Every message names the value,
what is wrong with it, the bound and the unit.
"""

import difflib
import math
import reprlib
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple, TypeGuard

from ..procedures.states import Input


class InvalidParameters(ValueError):
    """Bad parameters; ``faults`` lists every one of them, a line each."""

    def __init__(self, faults: Iterable[str]) -> None:
        self.faults = tuple(faults)
        super().__init__('\n'.join(self.faults))


REQUIRED: Any = object()

#: How a message names a kind of value.
KINDS: Mapping[type, str] = {float: 'a number', int: 'an integer', bool: 'true or false'}


#: How much of a value a message shows; a file of a few lines may hold a value of millions.
_SHORT = reprlib.Repr()
_SHORT.maxlevel, _SHORT.maxlist, _SHORT.maxdict, _SHORT.maxstring = 2, 8, 8, 200
_SHORT.maxtuple, _SHORT.maxlong, _SHORT.maxother = 8, 60, 200


def shown(value: object) -> str:
    """Return a value as a message shows it."""
    return _SHORT.repr(value)


class Interval(NamedTuple):
    """Two positions, the lower one first."""

    low: float
    high: float


@dataclass(frozen=True)
class Definition:
    """The definition of one value.

    Attributes:
        text: The meaning, in a few words.
        kind: float, int, bool, str, an enumeration, Interval, tuple (names of inputs) or list
            (of strings).
        unit: The unit of a number, '' where there is none.
        minimum: The least number that is allowed.
        maximum: The largest number that is allowed.
        or_zero: Whether 0 is allowed besides; it means "none" or "computed".
        name: The name under which users set it.
        default: The value where the user sets none; REQUIRED: there is no default.
        names: The names that a tuple may list.
    """

    text: str
    kind: type
    unit: str = ''
    minimum: float = -math.inf
    maximum: float = math.inf
    or_zero: bool = False
    name: str = ''
    default: Any = REQUIRED
    names: tuple[str, ...] = tuple(str(each) for each in Input)

    @property
    def required(self) -> bool:
        return self.default is REQUIRED

    @property
    def initial(self) -> Any:
        """The default, None where the value is required."""
        return None if self.required else self.default

    @property
    def choices(self) -> tuple[str, ...]:
        return tuple(str(c) for c in self.kind) if issubclass(self.kind, Enum) else ()

    @property
    def bounds(self) -> str:
        """The bounds in words, '' where there are none."""
        parts = []
        if self.minimum > -math.inf:
            parts.append(f'{"0 or " if self.or_zero else ""}>= {self.minimum:g}')
        if self.maximum < math.inf:
            parts.append(f'<= {self.maximum:g}')
        return ' and '.join(parts)

    @property
    def least(self) -> float:
        """The least number that is allowed, 0 included where it means "none"."""
        return min(self.minimum, 0.0) if self.or_zero else self.minimum

    @property
    def missing(self) -> str:
        """The message for a required value that is not set."""
        unit = f', {self.unit}' if self.unit else ''
        return f'{self.name}: required, but not set ({self.text}{unit})'

    def convert(self, value: object) -> Any:
        """Return the value in its own kind; an integer is accepted for a real number.

        Raises:
            ValueError: The value is of another kind or out of its bounds; the message names both.
        """
        if issubclass(self.kind, Enum):
            return self.kind(self._known(value, self.choices))
        if self.kind is tuple:
            return self._inputs(value)
        if self.kind is list:
            return self._strings(value)
        if self.kind is Interval:
            return self._interval(value)
        if self.kind is float and _is_real(value):
            value = float(value)
        if not isinstance(value, self.kind) or (self.kind is int and isinstance(value, bool)):
            raise self._wrong_kind(value, KINDS.get(self.kind, 'a string'))
        if isinstance(value, int | float):
            self._check_bounds(value)
        return value

    def _wrong_kind(self, value: object, kind: str) -> ValueError:
        unit = f' ({self.unit})' if self.unit else ''
        return ValueError(f'{self.name}: {shown(value)} is not {kind}{unit}')

    def _check_bounds(self, value: float) -> None:
        if math.isfinite(value) and self.minimum <= value <= self.maximum:
            return
        if self.or_zero and value == 0:
            return
        bounds = self.bounds or 'finite'
        unit = f' {self.unit}' if self.unit else ''
        raise ValueError(f'{self.name}: {value!r}{unit} must be {bounds}{unit}')

    def _known(self, value: object, names: Iterable[str]) -> str:
        """Return a name if it is one of the known names."""
        names = list(names)
        if isinstance(value, str) and value in names:
            return value
        raise ValueError(
            f'{self.name}: {shown(value)} is none of {", ".join(names)}' + suggestion(value, names)
        )

    def _inputs(self, value: object) -> tuple[Input, ...]:
        if isinstance(value, str) or not isinstance(value, Iterable):
            raise self._wrong_kind(value, 'a list of inputs')
        listed = [self._known(name, self.names) for name in value]
        if len(set(listed)) < len(listed):
            raise ValueError(f'{self.name}: an input is listed twice in {listed}')
        return tuple(Input(name) for name in listed)

    def _strings(self, value: object) -> list[str]:
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            raise ValueError(
                f'{self.name}: {shown(value)} is not a list of strings; quote the names, '
                "YAML reads an unquoted y as true: ['x', 'y']"
            )
        return value

    def _interval(self, value: object) -> Interval:
        if (
            not isinstance(value, list | tuple)
            or len(value) != 2
            or not all(_is_real(end) and not math.isnan(end) for end in value)
        ):
            raise self._wrong_kind(value, 'a pair [from, to] of numbers')
        low, high = map(float, value)
        if low > high:
            raise ValueError(
                f'{self.name}: {low!r} {self.unit} must be <= {high!r} {self.unit}, where it ends'
            )
        return Interval(low, high)


def table(*definitions: Definition) -> Mapping[str, Definition]:
    """Return definitions by their names."""
    return {definition.name: definition for definition in definitions}


def read(
    values: Mapping[str, object], definitions: Mapping[str, Definition]
) -> tuple[dict[str, Any], list[str]]:
    """Read values by their definitions.

    Returns:
        The values that are good, with the defaults of those that are not set, and a message for
        each fault: an unknown name, a bad value, a required value that is missing.
    """
    good, faults = {}, []
    for name, value in values.items():
        if name not in definitions:
            faults.append(unknown(name, definitions))
            continue
        try:
            good[name] = definitions[name].convert(value)
        except ValueError as error:
            faults.append(str(error))
    for name, definition in definitions.items():
        if name in values:
            continue
        if definition.required:
            faults.append(definition.missing)
        else:
            good[name] = definition.default
    return good, faults


def unknown(name: str, names: Iterable[str]) -> str:
    """Return the message for a name that nothing has."""
    return f'{name}: no such parameter{suggestion(name, names)}'


def suggestion(value: object, names: Iterable[str]) -> str:
    """Return which of the names the user may mean, '' where none is close.

    Upper and lower case make no difference.
    """
    by_lower = {name.lower(): name for name in names}
    text = value if isinstance(value, str) else shown(value)
    close = difflib.get_close_matches(text.lower(), list(by_lower), 1)
    return f'; did you mean {by_lower[close[0]]!r}?' if close else ''


def _is_real(value: object) -> TypeGuard[float]:
    """Return whether a value is a number that a float holds."""
    if isinstance(value, int):
        return not isinstance(value, bool) and abs(value) <= sys.float_info.max
    return isinstance(value, float)
