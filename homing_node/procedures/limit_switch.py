# SPDX-License-Identifier: Apache-2.0
"""The home types that home on a limit switch ahead.

Three limit switches, each with two home types. What the other limits ahead mean meanwhile stands
in LIMITS_OF_TARGET (fragments.py).
"""

from .events import Event
from .fragments import (
    Z_PULSE_REVERSE_ROWS,
    Table,
    homes_on_limit,
    limit_switch_initially_on,
)
from .motions import AWAY_SLOW, TOWARD_FAST
from .procedure import Row
from .states import HomeType, LimitPair
from .steps import (
    HOME_SHIFT,
    LS_FALLING_EDGE_SEARCH_REVERSE,
    LS_SEARCH,
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
)

LS_REVERSE_Z_PULSE = homes_on_limit(
    HomeType.LSReverseZPulse,
    'the first Z-pulse after the hardware limit switch has fallen, going away',
    LS_REVERSE_Z_PULSE_WORDS.format(limit='hardware', others=HARDWARE_OTHERS),
    LimitPair.HARDWARE,
    LS_REVERSE_Z_PULSE_ROWS,
)

NEAR_LS = homes_on_limit(
    HomeType.NearLS,
    'the feedback where the near limit switch ahead rises',
    LS_WORDS.format(limit='near', others=NEAR_OTHERS),
    LimitPair.NEAR,
    LS_ROWS,
)

NEAR_LS_REVERSE_Z_PULSE = homes_on_limit(
    HomeType.NearLSReverseZPulse,
    'the first Z-pulse after the near limit switch has fallen, going away',
    LS_REVERSE_Z_PULSE_WORDS.format(limit='near', others=NEAR_OTHERS),
    LimitPair.NEAR,
    LS_REVERSE_Z_PULSE_ROWS,
)

EXTERNAL_LS = homes_on_limit(
    HomeType.ExternalLS,
    'the feedback where the external limit switch ahead rises',
    LS_WORDS.format(limit='external', others=EXTERNAL_OTHERS),
    LimitPair.EXTERNAL,
    LS_ROWS,
)

EXTERNAL_LS_REVERSE_Z_PULSE = homes_on_limit(
    HomeType.ExternalLSReverseZPulse,
    'the first Z-pulse after the external limit switch has fallen, going away',
    LS_REVERSE_Z_PULSE_WORDS.format(limit='external', others=EXTERNAL_OTHERS),
    LimitPair.EXTERNAL,
    LS_REVERSE_Z_PULSE_ROWS,
)
