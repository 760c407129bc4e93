# SPDX-License-Identifier: Apache-2.0
"""The motions of homing: a closed vocabulary for the rows of the tables.

Ways are relative to the homing direction: *toward* along it, *away* against it.
"""

from enum import IntEnum
from typing import NamedTuple

from .states import Error, TextEnum


class Way(IntEnum):
    """Along the homing direction, against it, or neither; the value is the sign."""

    TOWARD = 1
    NONE = 0
    AWAY = -1


class Kind(TextEnum):
    """How a motion ends."""

    SEARCH = 'search'  # at constant speed until an event
    FURTHER = 'further'  # on by the homing reverse distance, counted from the row's cause
    REST = 'rest'  # a stop
    HOME = 'home'  # to the home position plus the home shift distance
    SQUARE = 'square'  # the followers of a gantry alone, until it is square
    BACK = 'back'  # to before the references of a gantry
    APPROACH = 'approach'  # to the rehome margin before where the switch was the last time


class Pace(TextEnum):
    """The profile parameters that a motion uses; the value is their common prefix."""

    FAST = 'homing_velocity_fast'
    SLOW = 'homing_velocity_slow'
    SHIFT = 'home_shift'
    QUICK = 'rehome'


class Motion(NamedTuple):
    """One motion of the tables.

    Attributes:
        kind: how it ends.
        way: which way it goes; NONE if its target decides.
        pace: its profile parameters.
        text: its name in the diagrams.
    """

    kind: Kind
    way: Way
    pace: Pace
    text: str


TOWARD_FAST = Motion(Kind.SEARCH, Way.TOWARD, Pace.FAST, 'toward, fast')
TOWARD_SLOW = Motion(Kind.SEARCH, Way.TOWARD, Pace.SLOW, 'toward, slow')
AWAY_FAST = Motion(Kind.SEARCH, Way.AWAY, Pace.FAST, 'away, fast')
AWAY_SLOW = Motion(Kind.SEARCH, Way.AWAY, Pace.SLOW, 'away, slow')
FURTHER_AWAY = Motion(Kind.FURTHER, Way.AWAY, Pace.FAST, 'away, homing reverse distance')
COME_TO_REST = Motion(Kind.REST, Way.NONE, Pace.SHIFT, 'come to rest')
QUICK_TOWARD = Motion(Kind.APPROACH, Way.TOWARD, Pace.QUICK, 'toward, to the rehome margin')
QUICK_AWAY = Motion(Kind.APPROACH, Way.AWAY, Pace.QUICK, 'away, to the rehome margin')
TO_HOME_POSITION = Motion(Kind.HOME, Way.NONE, Pace.SHIFT, 'to the home position + home shift')


class Bound(TextEnum):
    """The bound of a search's distance; the value is the parameter's name."""

    SEARCH = 'max_search_distance'
    LS_REVERSE = 'max_ls_reverse_distance'
    HS_ON_AT_START = 'max_hs_on_at_start_reverse_distance'

    @property
    def error(self) -> Error:
        return _BOUND_ERRORS[self]


_BOUND_ERRORS = {
    Bound.SEARCH: Error.SearchDistanceExceeded,
    Bound.LS_REVERSE: Error.MaxLSRevDistanceTraveled,
    Bound.HS_ON_AT_START: Error.MaxHSOnAtStartRevDistanceTraveled,
}
