# SPDX-License-Identifier: Apache-2.0
"""The unit of an axis: m for a linear one, rad for a rotary one."""

import re

from ..procedures.states import TextEnum

#: A length in a message: a number, a space, m.
LENGTH = re.compile(r'(?<=[0-9] )m\b')
#: The prefixes of a unit, from the largest on.
PREFIXES = (('', 1.0), ('m', 1e3), ('µ', 1e6))


class Unit(TextEnum):
    """The unit of a position."""

    m = 'm'
    rad = 'rad'

    def of(self, unit: str) -> str:
        """Return a unit of a linear axis as the unit of this axis: m/s becomes rad/s."""
        return re.sub(r'^m\b', self, unit)

    def in_message(self, message: str) -> str:
        """Return a message about a linear axis as a message about this axis."""
        return LENGTH.sub(self, message)

    def length(self, value: float, sign: bool = False) -> str:
        """Return a length with a prefix that fits: 0.0000521 m is `52.1 µm`."""
        size = abs(value)
        prefix, factor = next((one for one in PREFIXES if size * one[1] >= 1.0), PREFIXES[-1])
        number, digits = value * factor, 3 if size * factor >= 1.0 else 2
        begin = '+' if sign else ''
        text = f'{number:{begin}.{digits}g}'
        return f'{f"{number:{begin}.0f}" if "e" in text else text} {prefix}{self}'
