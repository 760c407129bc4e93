# SPDX-License-Identifier: Apache-2.0
"""The home types that search no switch."""

from .events import Event
from .fragments import homes_within_limits
from .motions import TOWARD_SLOW
from .procedure import Row
from .states import HomeType
from .steps import HOME_SHIFT, TOUCH_PROBE_SEARCH, Z_PULSE_SEARCH

CURRENT_POS = homes_within_limits(
    HomeType.CurrentPos,
    'the feedback when the run begins',
    """
    1. HomeShift: the position at which the axis stands is the home position. Go to it plus the
       home shift.

    Nothing is searched, and nothing moves unless `home_shift_distance` is set. Only that move asks
    the limit switches.
    """,
)

Z_PULSE = homes_within_limits(
    HomeType.ZPulse,
    'the first Z-pulse going toward',
    """
    1. ZPulseSearch: go toward, slow, to the first Z-pulse beyond the start. The position that the
       drive latched there is the home position.
    2. HomeShift: come to rest beyond the pulse, then go to the home position plus the home shift.

    No switch chooses the pulse: the axis must start within the same pitch each time.
    """,
    {Z_PULSE_SEARCH: Row(TOWARD_SLOW, {Event.Z_PULSE: HOME_SHIFT})},
)

TOUCH_PROBE = homes_within_limits(
    HomeType.TouchProbe,
    "the touch probe's latched position",
    """
    1. TouchProbeSearch: go toward, slow, until the touch probe triggers. The position that the
       drive latched there is the home position.
    2. HomeShift: come to rest beyond it, then go to the home position plus the home shift.
    """,
    {TOUCH_PROBE_SEARCH: Row(TOWARD_SLOW, {Event.TOUCH_PROBE: HOME_SHIFT})},
)
