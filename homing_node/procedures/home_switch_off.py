# SPDX-License-Identifier: Apache-2.0
"""The home types that search the fall of the home switch; a limit ahead means the reversal."""

from .events import Event
from .fragments import (
    Z_PULSE_REVERSE_ROWS,
    homes_on_switch,
    limit_switch_during_homing,
    quick_way,
)
from .motions import AWAY_SLOW, TOWARD_FAST, TOWARD_SLOW
from .procedure import Row
from .states import HomeType, State
from .steps import (
    HOME_SHIFT,
    HS_FALLING_EDGE_SEARCH_REVERSE,
    HS_OFF_AND_Z_PULSE_SEARCH,
    HS_OFF_AND_Z_PULSE_SEARCH_ARMED,
    HS_OFF_SEARCH,
    SECOND_HS_SEARCH_REVERSE,
    Z_PULSE_SEARCH_REVERSE,
    Z_PULSE_SEARCH_REVERSE_ARMED,
)

HS_OFF = homes_on_switch(
    HomeType.HSOff,
    'the feedback where the home switch falls, going toward',
    """
    1. HSOffSearch: go toward, fast, until the home switch falls, at the far end of its flag. That
       edge is the home position.
    2. HomeShift: come to rest beyond the edge, then go to the home position plus the home shift.

    Home switch on at the start: the same, with less far to go. Limit ahead in step 1: the
    reversal, then step 1.
    """,
    {
        HS_OFF_SEARCH: Row(
            TOWARD_FAST,
            {
                Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
                Event.HS_FALLS: HOME_SHIFT,
            },
        ),
    },
    limit_switch_during_homing(then=HS_OFF_SEARCH),
    quick=quick_way(
        State.HSOffSearch,
        {
            Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
            Event.HS_FALLS: HS_FALLING_EDGE_SEARCH_REVERSE,
        },
        then=HS_OFF_SEARCH,
    ),
)

HS_OFF_Z_PULSE = homes_on_switch(
    HomeType.HSOffZPulse,
    "the first Z-pulse beyond the home switch's falling edge",
    """
    1. HSOffAndZPulseSearch: go toward, fast, until the home switch falls, at the far end of its
       flag.
    2. HSOffAndZPulseSearch, armed: go on toward, slow, to the next Z-pulse. The position that the
       drive latched there is the home position.
    3. HomeShift: come to rest beyond the pulse, then go to the home position plus the home shift.

    Home switch on at the start: the same, with less far to go. Limit ahead in step 1 or 2: the
    reversal, then step 1.
    """,
    {
        HS_OFF_AND_Z_PULSE_SEARCH: Row(
            TOWARD_FAST,
            {
                Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
                Event.HS_FALLS: HS_OFF_AND_Z_PULSE_SEARCH_ARMED,
            },
        ),
        HS_OFF_AND_Z_PULSE_SEARCH_ARMED: Row(
            TOWARD_SLOW,
            {
                Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
                Event.Z_PULSE: HOME_SHIFT,
            },
        ),
    },
    limit_switch_during_homing(then=HS_OFF_AND_Z_PULSE_SEARCH),
    quick=quick_way(
        State.HSOffAndZPulseSearch,
        {
            Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
            Event.HS_FALLS: HS_FALLING_EDGE_SEARCH_REVERSE,
        },
        then=HS_OFF_AND_Z_PULSE_SEARCH,
    ),
)

HS_OFF_REVERSE_Z_PULSE = homes_on_switch(
    HomeType.HSOffReverseZPulse,
    'the first Z-pulse after the home switch has risen, going away',
    """
    1. HSOffSearch: go toward, fast, until the home switch falls, at the far end of its flag.
    2. ZPulseSearchReverse: turn and go away, slow, until the switch rises again.
    3. ZPulseSearchReverse, armed: go on away, slow, to the next Z-pulse. The position that the
       drive latched there is the home position.
    4. HomeShift: come to rest beyond the pulse, then go to the home position plus the home shift.

    Home switch on at the start: the same, with less far to go. Limit ahead in step 1: the
    reversal, then step 1.
    """,
    {
        HS_OFF_SEARCH: Row(
            TOWARD_FAST,
            {
                Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
                Event.HS_FALLS: Z_PULSE_SEARCH_REVERSE,
            },
        ),
        Z_PULSE_SEARCH_REVERSE: Row(AWAY_SLOW, {Event.HS_RISES: Z_PULSE_SEARCH_REVERSE_ARMED}),
    },
    Z_PULSE_REVERSE_ROWS,
    limit_switch_during_homing(then=HS_OFF_SEARCH),
    quick=quick_way(
        State.HSOffSearch,
        {
            Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
            Event.HS_FALLS: Z_PULSE_SEARCH_REVERSE,
        },
        then=HS_OFF_SEARCH,
    ),
)

HS_OFF_REVERSE = homes_on_switch(
    HomeType.HSOffReverse,
    'the feedback where the home switch rises, slowly, coming back from beyond it',
    """
    1. HSOffSearch: go toward, fast, until the home switch falls, at the far end of its flag.
    2. SecondHSSearch, reverse: turn and go away, slow, until the switch rises again. That edge is
       the home position.
    3. HomeShift: come to rest on the switch, then go to the home position plus the home shift.

    Home switch on at the start: the same, with less far to go. Limit ahead in step 1: the
    reversal, then step 1. `repeat`: steps 1 and 2 once more for each further pass.

    Not a type of WMX3. CiA 402 has it as methods 25 and 29.
    """,
    {
        HS_OFF_SEARCH: Row(
            TOWARD_FAST,
            {
                Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
                Event.HS_FALLS: SECOND_HS_SEARCH_REVERSE,
            },
        ),
        SECOND_HS_SEARCH_REVERSE: Row(
            AWAY_SLOW,
            {
                Event.REPEAT: HS_OFF_SEARCH,
                Event.HS_RISES: HOME_SHIFT,
            },
        ),
    },
    limit_switch_during_homing(then=HS_OFF_SEARCH),
    quick=quick_way(
        State.HSOffSearch,
        {
            Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
            Event.HS_FALLS: SECOND_HS_SEARCH_REVERSE,
        },
        then=HS_OFF_SEARCH,
    ),
)
