# SPDX-License-Identifier: Apache-2.0
"""The tables of a jog: a move by a distance, beside the home types.

A jog homes nothing. Its home type is the one that searches nothing, and no page shows it. Every
limit switch is a normal one: a jog into it ends with LSTriggered, and so does one that would
begin on it.
"""

from collections.abc import Mapping

from .events import Event
from .motions import Kind, Motion, Pace, Way
from .procedure import Procedure, Row
from .states import HomeType, LimitPair, Role
from .steps import JOGGED, JOGGING


def _jog(way: Way, text: str) -> Procedure:
    motion = Motion(Kind.APPROACH, way, Pace.FAST, text)
    return Procedure(
        HomeType.CurrentPos,
        'none',
        f'1. Jogging: go {text}.',
        {JOGGING: Row(motion, {Event.DONE: JOGGED})},
        dict.fromkeys(LimitPair, Role.NORMAL),
    )


#: The table for each way.
JOGS: Mapping[Way, Procedure] = {
    Way.TOWARD: _jog(Way.TOWARD, 'toward, by a distance'),
    Way.AWAY: _jog(Way.AWAY, 'away, by a distance'),
}
