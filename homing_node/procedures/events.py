# SPDX-License-Identifier: Apache-2.0
"""The events of homing: the labels of the arrows in the tables.

An edge counts for a row only if the axis traveled the row's way at the edge's own time. An edge
going away counts only at that end of the flag where the axis came in. Both rules hold for every
table and stand in core/switch_events.py and core/flags.py.
"""

from .states import TextEnum


class Event(TextEnum):
    """The label of an arrow."""

    HS_RISES = 'home switch rises'
    HS_FALLS = 'home switch falls'
    HS_ON = 'home switch on'
    LS_RISES = 'target limit rises'
    LS_FALLS = 'target limit falls'
    LS_ON = 'target limit on'
    LIMIT_AHEAD = 'limit ahead'
    Z_PULSE = 'Z-pulse'
    TOUCH_PROBE = 'touch probe'
    END_DETECTED = 'mechanical end'
    REPEAT = 'once more'
    DONE = 'done'


#: Events that are conditions, tested when a row is entered, in this order (first match wins).
CONDITIONS: tuple[Event, ...] = (Event.LIMIT_AHEAD, Event.LS_ON, Event.HS_ON)
