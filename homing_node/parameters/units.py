# SPDX-License-Identifier: Apache-2.0
"""The unit of an axis: m for a linear one, rad for a rotary one."""

import re

from ..procedures.states import TextEnum

#: A length in a message: a number, a space, m.
LENGTH = re.compile(r'(?<=[0-9] )m\b')


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
