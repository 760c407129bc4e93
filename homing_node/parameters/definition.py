# SPDX-License-Identifier: Apache-2.0
"""What is known of one parameter: its kind, unit, bounds, meaning, and how a value is read."""

import difflib
import math
from collections.abc import Iterable
from enum import Enum
from typing import Any, NamedTuple

from ..procedures.states import Input


class InvalidParameters(ValueError):
    """Bad parameters; ``faults`` lists every one of them, a line each."""

    def __init__(self, faults: Iterable[str]) -> None:
        self.faults = tuple(faults)
        super().__init__('\n'.join(self.faults))


REQUIRED: Any = object()

#: The largest number that a parameter can have; the range in its descriptor tells of it.
LARGEST = 1e300


class Definition(NamedTuple):
    """What is known of one parameter: its kind, unit, bounds and meaning."""

    text: str
    kind: type
    unit: str = ''
    minimum: float = -math.inf
    maximum: float = math.inf
    open_minimum: bool = False
    name: str = ''
    default: Any = REQUIRED

    @property
    def required(self) -> bool:
        return self.default is REQUIRED

    @property
    def initial(self) -> Any:
        """The default, None where the parameter is required."""
        return None if self.required else self.default

    @property
    def choices(self) -> tuple[str, ...]:
        return tuple(str(c) for c in self.kind) if issubclass(self.kind, Enum) else ()

    @property
    def bounds(self) -> str:
        """Tell the bounds in words, '' where there are none."""
        parts = []
        if self.minimum > -math.inf:
            parts.append(f'{">" if self.open_minimum else ">="} {self.minimum:g}')
        if self.maximum < math.inf:
            parts.append(f'<= {self.maximum:g}')
        return ' and '.join(parts)

    def convert(self, value: object) -> Any:
        """Return the value as this parameter holds it; raise ValueError that says what is wrong.

        Integers are accepted for real parameters.
        """
        if issubclass(self.kind, Enum):
            if isinstance(value, str) and value in self.choices:
                return self.kind(value)
            raise ValueError(
                f'{self.name}: {value!r} is none of {", ".join(self.choices)}'
                + suggestion(value, self.choices)
            )
        if self.kind is tuple:
            return self._inputs(value)
        if self.kind is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if not isinstance(value, self.kind) or (self.kind is int and isinstance(value, bool)):
            kind = {float: 'a number', int: 'an integer', bool: 'true or false'}
            raise ValueError(
                f'{self.name}: {value!r} is not {kind.get(self.kind, "a string")}'
                + (f' ({self.unit})' if self.unit else '')
            )
        if isinstance(value, int | float):
            below = value <= self.minimum if self.open_minimum else value < self.minimum
            huge = not abs(value) <= LARGEST
            if huge or below or value > self.maximum:
                size = '' if not huge else f'<= {LARGEST:g}' if math.isfinite(value) else 'finite'
                bounds = ' and '.join(filter(None, (size, self.bounds)))
                raise ValueError(
                    f'{self.name}: {value!r} {self.unit} must be {bounds} {self.unit}'.replace(
                        '  ', ' '
                    ).rstrip()
                )
        return value

    def _inputs(self, value: object) -> tuple[Input, ...]:
        names = tuple(str(i) for i in Input)
        if isinstance(value, str) or not isinstance(value, Iterable):
            raise ValueError(f'{self.name}: {value!r} is not a list of inputs')
        listed = list(value)
        for name in listed:
            if name not in names:
                raise ValueError(
                    f'{self.name}: {name!r} is none of {", ".join(names)}'
                    + suggestion(name, names)
                )
        if len(set(listed)) < len(listed):
            raise ValueError(f'{self.name}: an input is listed twice in {listed}')
        return tuple(Input(name) for name in listed)


def suggestion(value: object, names: Iterable[str]) -> str:
    """Say which of the names may be meant, '' where none is close."""
    close = difflib.get_close_matches(str(value), list(names), 1)
    return f'; did you mean {close[0]!r}?' if close else ''
