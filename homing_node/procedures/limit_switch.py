# SPDX-License-Identifier: Apache-2.0
"""The home types that home on a limit switch ahead.

Three limit switches, each with four home types. What the other limits ahead mean meanwhile stands
in LIMITS_OF_TARGET (fragments.py).
"""

from .events import Event
from .fragments import (
    Z_PULSE_REVERSE_ROWS,
    Table,
    homes_on_limit,
    limit_switch_initially_on,
    quick_way,
)
from .motions import AWAY_SLOW, TOWARD_FAST, TOWARD_SLOW, Bound
from .procedure import Row
from .states import HomeType, LimitPair, State
from .steps import (
    HOME_SHIFT,
    LS_FALLING_EDGE_SEARCH_REVERSE,
    LS_FALLING_EDGE_SEARCH_REVERSE_SLOW,
    LS_SEARCH,
    LS_SEARCH_SECOND,
    Z_PULSE_SEARCH_REVERSE,
    Z_PULSE_SEARCH_REVERSE_ARMED,
)

LS_WORDS = """
1. LSSearch: go toward, fast, until the {limit} limit switch rises. That edge is the home position.
2. HomeShift: come to rest beyond the edge, then go to the home position plus the home shift. A
   negative shift takes the axis off the limit.

That limit on at the start: LSFallingEdgeSearchReverse goes away, fast, until it falls, and further
by `homing_reverse_distance`; then step 1. {others}
"""

LS_ROWS: Table = {
    LS_SEARCH: Row(
        TOWARD_FAST,
        {
            Event.LS_ON: LS_FALLING_EDGE_SEARCH_REVERSE,
            Event.LS_RISES: HOME_SHIFT,
        },
    ),
    **limit_switch_initially_on(then=LS_SEARCH),
}

LS_QUICK = quick_way(
    State.LSSearch,
    {
        Event.LS_ON: LS_FALLING_EDGE_SEARCH_REVERSE,
        Event.LS_RISES: LS_FALLING_EDGE_SEARCH_REVERSE,
    },
    then=LS_SEARCH,
)

LS_REVERSE_Z_PULSE_WORDS = """
1. LSSearch: go toward, fast, until the {limit} limit switch rises.
2. ZPulseSearchReverse: turn and go away, slow, until the limit falls.
3. ZPulseSearchReverse, armed: go on away, slow, to the next Z-pulse. The position that the drive
   latched there is the home position.
4. HomeShift: come to rest beyond the pulse, then go to the home position plus the home shift.

That limit on at the start: LSFallingEdgeSearchReverse goes away, fast, until it falls, and further
by `homing_reverse_distance`; then step 1. {others}
"""

LS_REVERSE_Z_PULSE_ROWS: Table = {
    LS_SEARCH: Row(
        TOWARD_FAST,
        {
            Event.LS_ON: LS_FALLING_EDGE_SEARCH_REVERSE,
            Event.LS_RISES: Z_PULSE_SEARCH_REVERSE,
        },
    ),
    Z_PULSE_SEARCH_REVERSE: Row(AWAY_SLOW, {Event.LS_FALLS: Z_PULSE_SEARCH_REVERSE_ARMED}),
    **Z_PULSE_REVERSE_ROWS,
    **limit_switch_initially_on(then=LS_SEARCH),
}

LS_REVERSE_Z_PULSE_QUICK = quick_way(
    State.LSSearch,
    {
        Event.LS_ON: LS_FALLING_EDGE_SEARCH_REVERSE,
        Event.LS_RISES: Z_PULSE_SEARCH_REVERSE,
    },
    then=LS_SEARCH,
)

LS_OFF_WORDS = """
1. LSSearch: go toward, fast, until the {limit} limit switch rises.
2. LSFallingEdgeSearchReverse, slow: turn and go away, slow, until the limit falls. That edge is
   the home position.
3. HomeShift: come to rest off the limit, then go to the home position plus the home shift.

That limit on at the start: LSFallingEdgeSearchReverse goes away, fast, until it falls, and further
by `homing_reverse_distance`; then step 1. `repeat`: steps 1 and 2 once more for each further pass.
{others}

Not a type of WMX3. {who}
"""

LS_OFF_ROWS: Table = {
    LS_SEARCH: Row(
        TOWARD_FAST,
        {
            Event.LS_ON: LS_FALLING_EDGE_SEARCH_REVERSE,
            Event.LS_RISES: LS_FALLING_EDGE_SEARCH_REVERSE_SLOW,
        },
    ),
    LS_FALLING_EDGE_SEARCH_REVERSE_SLOW: Row(
        AWAY_SLOW,
        {
            Event.REPEAT: LS_SEARCH,
            Event.LS_FALLS: HOME_SHIFT,
        },
        Bound.LS_REVERSE,
    ),
    **limit_switch_initially_on(then=LS_SEARCH),
}

LS_OFF_QUICK = quick_way(
    State.LSSearch,
    {
        Event.LS_ON: LS_FALLING_EDGE_SEARCH_REVERSE,
        Event.LS_RISES: LS_FALLING_EDGE_SEARCH_REVERSE_SLOW,
    },
    then=LS_SEARCH,
)

LS_LS_WORDS = """
1. LSSearch: go toward, fast, until the {limit} limit switch rises.
2. LSFallingEdgeSearchReverse: go away, fast, until the limit falls, and further by
   `homing_reverse_distance`.
3. LSSearch, second: go toward, slow, until the limit rises again. That edge is the home position.
4. HomeShift: come to rest beyond the edge, then go to the home position plus the home shift. A
   negative shift takes the axis off the limit.

That limit on at the start: step 2, then step 3. `repeat`: steps 2 and 3 once more for each further
pass. {others}

The two edges must agree within `edge_tolerance`; else the run ends with `EdgeNotRepeated`. Not a
type of WMX3. {who}
"""

LS_LS_ROWS: Table = {
    LS_SEARCH: Row(
        TOWARD_FAST,
        {
            Event.LS_ON: LS_FALLING_EDGE_SEARCH_REVERSE,
            Event.LS_RISES: LS_FALLING_EDGE_SEARCH_REVERSE,
        },
    ),
    LS_SEARCH_SECOND: Row(
        TOWARD_SLOW,
        {
            Event.LS_ON: LS_FALLING_EDGE_SEARCH_REVERSE,
            Event.REPEAT: LS_FALLING_EDGE_SEARCH_REVERSE,
            Event.LS_RISES: HOME_SHIFT,
        },
    ),
    **limit_switch_initially_on(then=LS_SEARCH_SECOND),
}

LS_LS_QUICK = quick_way(
    State.LSSearch,
    {
        Event.LS_ON: LS_FALLING_EDGE_SEARCH_REVERSE,
        Event.LS_RISES: LS_FALLING_EDGE_SEARCH_REVERSE,
    },
    then=LS_SEARCH_SECOND,
)

ON_ANOTHER_LS = 'CiA 402 knows the hardware limit switches only.'
HARDWARE_OTHERS = 'Near and external limit switches ahead are ignored.'
NEAR_OTHERS = (
    'The external limit switch ahead is ignored; the hardware limit switch acts as its LS Type '
    'says.'
)
EXTERNAL_OTHERS = (
    'The near limit switch ahead is ignored; the hardware limit switch acts as its LS Type says.'
)

LS = homes_on_limit(
    HomeType.LS,
    'the feedback where the hardware limit switch ahead rises',
    LS_WORDS.format(limit='hardware', others=HARDWARE_OTHERS),
    LimitPair.HARDWARE,
    LS_ROWS,
    quick=LS_QUICK,
)

LS_REVERSE_Z_PULSE = homes_on_limit(
    HomeType.LSReverseZPulse,
    'the first Z-pulse after the hardware limit switch has fallen, going away',
    LS_REVERSE_Z_PULSE_WORDS.format(limit='hardware', others=HARDWARE_OTHERS),
    LimitPair.HARDWARE,
    LS_REVERSE_Z_PULSE_ROWS,
    quick=LS_REVERSE_Z_PULSE_QUICK,
)

NEAR_LS = homes_on_limit(
    HomeType.NearLS,
    'the feedback where the near limit switch ahead rises',
    LS_WORDS.format(limit='near', others=NEAR_OTHERS),
    LimitPair.NEAR,
    LS_ROWS,
    quick=LS_QUICK,
)

NEAR_LS_REVERSE_Z_PULSE = homes_on_limit(
    HomeType.NearLSReverseZPulse,
    'the first Z-pulse after the near limit switch has fallen, going away',
    LS_REVERSE_Z_PULSE_WORDS.format(limit='near', others=NEAR_OTHERS),
    LimitPair.NEAR,
    LS_REVERSE_Z_PULSE_ROWS,
    quick=LS_REVERSE_Z_PULSE_QUICK,
)

EXTERNAL_LS = homes_on_limit(
    HomeType.ExternalLS,
    'the feedback where the external limit switch ahead rises',
    LS_WORDS.format(limit='external', others=EXTERNAL_OTHERS),
    LimitPair.EXTERNAL,
    LS_ROWS,
    quick=LS_QUICK,
)

EXTERNAL_LS_REVERSE_Z_PULSE = homes_on_limit(
    HomeType.ExternalLSReverseZPulse,
    'the first Z-pulse after the external limit switch has fallen, going away',
    LS_REVERSE_Z_PULSE_WORDS.format(limit='external', others=EXTERNAL_OTHERS),
    LimitPair.EXTERNAL,
    LS_REVERSE_Z_PULSE_ROWS,
    quick=LS_REVERSE_Z_PULSE_QUICK,
)

LS_OFF = homes_on_limit(
    HomeType.LSOff,
    'the feedback where the hardware limit switch falls, slowly, going away',
    LS_OFF_WORDS.format(
        limit='hardware', others=HARDWARE_OTHERS, who='CiA 402 has it as methods 17 and 18.'
    ),
    LimitPair.HARDWARE,
    LS_OFF_ROWS,
    quick=LS_OFF_QUICK,
)

LS_LS = homes_on_limit(
    HomeType.LSLS,
    'the feedback where the hardware limit switch ahead rises for the second time, slowly',
    LS_LS_WORDS.format(limit='hardware', others=HARDWARE_OTHERS, who='grbl homes like this.'),
    LimitPair.HARDWARE,
    LS_LS_ROWS,
    quick=LS_LS_QUICK,
)

NEAR_LS_OFF = homes_on_limit(
    HomeType.NearLSOff,
    'the feedback where the near limit switch falls, slowly, going away',
    LS_OFF_WORDS.format(limit='near', others=NEAR_OTHERS, who=ON_ANOTHER_LS),
    LimitPair.NEAR,
    LS_OFF_ROWS,
    quick=LS_OFF_QUICK,
)

NEAR_LS_NEAR_LS = homes_on_limit(
    HomeType.NearLSNearLS,
    'the feedback where the near limit switch ahead rises for the second time, slowly',
    LS_LS_WORDS.format(limit='near', others=NEAR_OTHERS, who=ON_ANOTHER_LS),
    LimitPair.NEAR,
    LS_LS_ROWS,
    quick=LS_LS_QUICK,
)

EXTERNAL_LS_OFF = homes_on_limit(
    HomeType.ExternalLSOff,
    'the feedback where the external limit switch falls, slowly, going away',
    LS_OFF_WORDS.format(limit='external', others=EXTERNAL_OTHERS, who=ON_ANOTHER_LS),
    LimitPair.EXTERNAL,
    LS_OFF_ROWS,
    quick=LS_OFF_QUICK,
)

EXTERNAL_LS_EXTERNAL_LS = homes_on_limit(
    HomeType.ExternalLSExternalLS,
    'the feedback where the external limit switch ahead rises for the second time, slowly',
    LS_LS_WORDS.format(limit='external', others=EXTERNAL_OTHERS, who=ON_ANOTHER_LS),
    LimitPair.EXTERNAL,
    LS_LS_ROWS,
    quick=LS_LS_QUICK,
)
