# SPDX-License-Identifier: Apache-2.0
"""The kinds of fields of AxisParameters, with bounds that a machine can have.

The bounds hold for linear axes in m and for rotary axes in rad: from a stage of some micrometres
to a crane, and to a spindle of 95 000 turns in a minute.
"""

import dataclasses
from typing import Any

from ..procedures import cia402
from ..procedures.states import HomeType, LSType
from .definition import REQUIRED, Definition

#: The furthest position, and the longest distance.
FURTHEST = 1e5
#: The longest time: a day.
LONGEST = 86_400.0


def parameter(kind: type, default: Any, text: str, unit: str = '', **bounds: Any) -> Any:
    """Return a field of a dataclass that carries the definition of a parameter."""
    metadata = {'definition': Definition(text, kind, unit, **bounds)}
    if default is REQUIRED:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


class HomeTypeDefinition(Definition):
    """The definition of the home type, which a method of CiA 402 may name."""

    def convert(self, value: object) -> Any:
        """Return the home type, or the method that a number names."""
        if isinstance(value, cia402.Method):
            return value
        try:
            found = cia402.method(value)
        except ValueError as error:
            raise ValueError(f'{self.name}: {error}') from None
        return found or super().convert(value)


def home_type(text: str) -> Any:
    return dataclasses.field(metadata={'definition': HomeTypeDefinition(text, HomeType)})


def _real(
    default: Any, text: str, unit: str, minimum: float, maximum: float, or_zero: bool = False
) -> Any:
    return parameter(float, default, text, unit, minimum=minimum, maximum=maximum, or_zero=or_zero)


def travel(text: str) -> Any:
    return _real(REQUIRED, text, 'm', 1e-6, FURTHEST)


def position(default: float, text: str) -> Any:
    """Return a field for a position, or for a distance that has a sign."""
    return _real(default, text, 'm', -FURTHEST, FURTHEST)


def distance(default: float, text: str) -> Any:
    return _real(default, text, 'm', 1e-9, FURTHEST, or_zero=True)


def velocity(default: float, text: str, or_zero: bool = False) -> Any:
    return _real(default, text, 'm/s', 1e-7, 1e4, or_zero)


def acceleration(default: float, text: str) -> Any:
    return _real(default, text, 'm/s^2', 1e-4, 1e6)


def jerk(default: float, text: str) -> Any:
    return _real(default, text, 'm/s^3', 1e-3, 1e9)


def duration(default: float, text: str, least: float = 1e-6, or_zero: bool = True) -> Any:
    return _real(default, text, 's', least, LONGEST, or_zero)


def torque(text: str) -> Any:
    return _real(0.0, text, '%', 0.0, 1000.0)


def fraction(default: float, text: str, maximum: float) -> Any:
    return _real(default, text, '', 0.0, maximum)


def count(default: int, text: str, minimum: int, maximum: int) -> Any:
    return parameter(int, default, text, minimum=minimum, maximum=maximum)


class NamesDefinition(Definition):
    """The definition of a list of names, each of which stands there once."""

    def convert(self, value: object) -> Any:
        """Return the names as a tuple."""
        if isinstance(value, tuple):
            value = list(value)
        names: list[str] = self._strings(value)
        if len(set(names)) < len(names) or not all(names):
            raise ValueError(f'{self.name}: a name is empty or stands twice in {names}')
        return tuple(names)


def names(text: str) -> Any:
    return dataclasses.field(default=(), metadata={'definition': NamesDefinition(text, list)})


def flag(default: bool, text: str) -> Any:
    return parameter(bool, default, text)


def inversion(switch: str) -> Any:
    return flag(False, f'{switch}: on when the signal is false')


def ls_type(default: LSType, text: str) -> Any:
    return parameter(LSType, default, text)


def separate_ls_type(side: str) -> Any:
    return ls_type(LSType.none, f'action of the {side} one with SeparatePositiveLSNegativeLS')
