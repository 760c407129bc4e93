# SPDX-License-Identifier: Apache-2.0
"""The home types that search the rise of the home switch; a limit ahead means the reversal."""

from .events import Event
from .fragments import (
    Z_PULSE_REVERSE_ROWS,
    home_switch_clear,
    home_switch_initially_on,
    homes_on_switch,
    limit_switch_during_homing,
    quick_way,
)
from .motions import AWAY_SLOW, TOWARD_FAST, TOWARD_SLOW
from .procedure import Row
from .states import HomeType, State
from .steps import (
    HOME_SHIFT,
    HS_AND_Z_PULSE_SEARCH,
    HS_AND_Z_PULSE_SEARCH_ARMED,
    HS_CLEAR_REVERSE,
    HS_CLEAR_REVERSE_AT_START,
    HS_FALLING_EDGE_SEARCH_REVERSE,
    HS_FALLING_EDGE_SEARCH_REVERSE_SLOW,
    HS_SEARCH,
    SECOND_HS_SEARCH,
    TOUCH_PROBE_SEARCH,
    Z_PULSE_SEARCH_REVERSE,
    Z_PULSE_SEARCH_REVERSE_ARMED,
)

HS = homes_on_switch(
    HomeType.HS,
    'the feedback where the home switch rises',
    """
    1. HSSearch: go toward, fast, until the home switch rises. That edge is the home position.
    2. HomeShift: come to rest beyond the edge, then go to the home position plus the home shift.

    Home switch on at the start: HSClearReverse goes away, fast, until the switch falls, and
    further by `homing_reverse_distance`; then step 1. Limit ahead in step 1: the reversal, then
    step 1.

    One fast pass: the quickest of the home switch types, and as repeatable as the switch is at
    that velocity.
    """,
    {
        HS_SEARCH: Row(
            TOWARD_FAST,
            {
                Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
                Event.HS_ON: HS_CLEAR_REVERSE_AT_START,
                Event.HS_RISES: HOME_SHIFT,
            },
        ),
    },
    home_switch_initially_on(then=HS_SEARCH),
    limit_switch_during_homing(then=HS_SEARCH),
    quick=quick_way(
        State.HSSearch,
        {
            Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
            Event.HS_ON: HS_CLEAR_REVERSE_AT_START,
            Event.HS_RISES: HS_CLEAR_REVERSE_AT_START,
        },
        then=HS_SEARCH,
    ),
)

HSHS = homes_on_switch(
    HomeType.HSHS,
    'the feedback where the home switch rises for the second time, slowly',
    """
    1. HSSearch: go toward, fast, until the home switch rises.
    2. HSClearReverse: go away, fast, until the switch falls, and further by
       `homing_reverse_distance`.
    3. SecondHSSearch: go toward, slow, until the switch rises again. That edge is the home
       position.
    4. HomeShift: come to rest beyond the edge, then go to the home position plus the home shift.

    Home switch on at the start: step 2, then step 3. Limit ahead in step 1 or 3: the reversal,
    then step 1.

    The two edges must agree within `edge_tolerance`; else the run ends with `EdgeNotRepeated`.
    """,
    {
        HS_SEARCH: Row(
            TOWARD_FAST,
            {
                Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
                Event.HS_ON: HS_CLEAR_REVERSE_AT_START,
                Event.HS_RISES: HS_CLEAR_REVERSE,
            },
        ),
        SECOND_HS_SEARCH: Row(
            TOWARD_SLOW,
            {
                Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
                Event.HS_ON: HS_CLEAR_REVERSE,
                Event.REPEAT: HS_CLEAR_REVERSE,
                Event.HS_RISES: HOME_SHIFT,
            },
        ),
    },
    home_switch_clear(then=SECOND_HS_SEARCH),
    home_switch_initially_on(then=SECOND_HS_SEARCH),
    limit_switch_during_homing(then=HS_SEARCH),
    quick=quick_way(
        State.HSSearch,
        {
            Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
            Event.HS_ON: HS_CLEAR_REVERSE_AT_START,
            Event.HS_RISES: HS_CLEAR_REVERSE,
        },
        then=SECOND_HS_SEARCH,
    ),
)

HS_Z_PULSE = homes_on_switch(
    HomeType.HSZPulse,
    "the first Z-pulse beyond the home switch's rising edge",
    """
    1. HSAndZPulseSearch: go toward, fast, until the home switch rises.
    2. HSAndZPulseSearch, armed: go on toward, slow, to the next Z-pulse. The position that the
       drive latched there is the home position.
    3. HomeShift: come to rest beyond the pulse, then go to the home position plus the home shift.

    Home switch on at the start: HSClearReverse goes away, fast, until the switch falls, and
    further by `homing_reverse_distance`; then step 1. Limit ahead in step 1 or 2: the reversal,
    then step 1.

    The switch only chooses the pulse. Keep its edge away from a pulse, half a pitch at best.
    """,
    {
        HS_AND_Z_PULSE_SEARCH: Row(
            TOWARD_FAST,
            {
                Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
                Event.HS_ON: HS_CLEAR_REVERSE_AT_START,
                Event.HS_RISES: HS_AND_Z_PULSE_SEARCH_ARMED,
            },
        ),
        HS_AND_Z_PULSE_SEARCH_ARMED: Row(
            TOWARD_SLOW,
            {
                Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
                Event.Z_PULSE: HOME_SHIFT,
            },
        ),
    },
    home_switch_initially_on(then=HS_AND_Z_PULSE_SEARCH),
    limit_switch_during_homing(then=HS_AND_Z_PULSE_SEARCH),
    quick=quick_way(
        State.HSAndZPulseSearch,
        {
            Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
            Event.HS_ON: HS_CLEAR_REVERSE_AT_START,
            Event.HS_RISES: HS_CLEAR_REVERSE_AT_START,
        },
        then=HS_AND_Z_PULSE_SEARCH,
    ),
)

HS_REVERSE_Z_PULSE = homes_on_switch(
    HomeType.HSReverseZPulse,
    'the first Z-pulse after the home switch has fallen, going away',
    """
    1. HSSearch: go toward, fast, until the home switch rises.
    2. ZPulseSearchReverse: turn and go away, slow, until the switch falls.
    3. ZPulseSearchReverse, armed: go on away, slow, to the next Z-pulse. The position that the
       drive latched there is the home position.
    4. HomeShift: come to rest beyond the pulse, then go to the home position plus the home shift.

    Home switch on at the start: HSClearReverse goes away, fast, until the switch falls, and
    further by `homing_reverse_distance`; then step 1. Limit ahead in step 1: the reversal, then
    step 1.
    """,
    {
        HS_SEARCH: Row(
            TOWARD_FAST,
            {
                Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
                Event.HS_ON: HS_CLEAR_REVERSE_AT_START,
                Event.HS_RISES: Z_PULSE_SEARCH_REVERSE,
            },
        ),
        Z_PULSE_SEARCH_REVERSE: Row(AWAY_SLOW, {Event.HS_FALLS: Z_PULSE_SEARCH_REVERSE_ARMED}),
    },
    Z_PULSE_REVERSE_ROWS,
    home_switch_initially_on(then=HS_SEARCH),
    limit_switch_during_homing(then=HS_SEARCH),
    quick=quick_way(
        State.HSSearch,
        {
            Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
            Event.HS_ON: HS_CLEAR_REVERSE_AT_START,
            Event.HS_RISES: Z_PULSE_SEARCH_REVERSE,
        },
        then=HS_SEARCH,
    ),
)

HS_TOUCH_PROBE = homes_on_switch(
    HomeType.HSTouchProbe,
    "the touch probe's latched position",
    """
    1. HSSearch: go toward, fast, until the home switch rises.
    2. HSClearReverse: go away, fast, until the switch falls, and further by
       `homing_reverse_distance`.
    3. TouchProbeSearch: go toward, slow, until the touch probe triggers. The position that the
       drive latched there is the home position.
    4. HomeShift: come to rest beyond it, then go to the home position plus the home shift.

    Home switch on at the start: step 2, then step 3. Limit ahead in step 1 or 3: the reversal,
    then step 1.
    """,
    {
        HS_SEARCH: Row(
            TOWARD_FAST,
            {
                Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
                Event.HS_ON: HS_CLEAR_REVERSE_AT_START,
                Event.HS_RISES: HS_CLEAR_REVERSE,
            },
        ),
        TOUCH_PROBE_SEARCH: Row(
            TOWARD_SLOW,
            {
                Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
                Event.REPEAT: HS_CLEAR_REVERSE,
                Event.TOUCH_PROBE: HOME_SHIFT,
            },
        ),
    },
    home_switch_clear(then=TOUCH_PROBE_SEARCH),
    home_switch_initially_on(then=TOUCH_PROBE_SEARCH),
    limit_switch_during_homing(then=HS_SEARCH),
    quick=quick_way(
        State.HSSearch,
        {
            Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
            Event.HS_ON: HS_CLEAR_REVERSE_AT_START,
            Event.HS_RISES: HS_CLEAR_REVERSE,
        },
        then=HS_SEARCH,
    ),
)

HS_REVERSE = homes_on_switch(
    HomeType.HSReverse,
    'the feedback where the home switch falls, slowly, going away',
    """
    1. HSSearch: go toward, fast, until the home switch rises.
    2. HSFallingEdgeSearchReverse, slow: turn and go away, slow, until the switch falls. That edge
       is the home position.
    3. HomeShift: come to rest off the switch, then go to the home position plus the home shift.

    Home switch on at the start: HSClearReverse goes away, fast, until the switch falls, and
    further by `homing_reverse_distance`; then step 1. Limit ahead in step 1: the reversal, then
    step 1. `repeat`: steps 1 and 2 once more for each further pass.

    Not a type of WMX3. CiA 402 has it as methods 19, 21, 23 and 27; LinuxCNC where HOME_LATCH_VEL
    has the opposite sign of HOME_SEARCH_VEL.
    """,
    {
        HS_SEARCH: Row(
            TOWARD_FAST,
            {
                Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
                Event.HS_ON: HS_CLEAR_REVERSE_AT_START,
                Event.HS_RISES: HS_FALLING_EDGE_SEARCH_REVERSE_SLOW,
            },
        ),
        HS_FALLING_EDGE_SEARCH_REVERSE_SLOW: Row(
            AWAY_SLOW,
            {
                Event.REPEAT: HS_SEARCH,
                Event.HS_FALLS: HOME_SHIFT,
            },
        ),
    },
    home_switch_initially_on(then=HS_SEARCH),
    limit_switch_during_homing(then=HS_SEARCH),
    quick=quick_way(
        State.HSSearch,
        {
            Event.LIMIT_AHEAD: HS_FALLING_EDGE_SEARCH_REVERSE,
            Event.HS_ON: HS_CLEAR_REVERSE_AT_START,
            Event.HS_RISES: HS_FALLING_EDGE_SEARCH_REVERSE_SLOW,
        },
        then=HS_SEARCH,
    ),
)

# -------------------------------------------------------------------- home switch, falling edge
