# SPDX-License-Identifier: Apache-2.0
"""The home types that begin with the search for the mechanical end."""

from .events import Event
from .fragments import Z_PULSE_REVERSE_ROWS, Table, homes_within_limits
from .motions import AWAY_SLOW, TOWARD_SLOW
from .procedure import Row
from .states import HomeType, LimitPair
from .steps import (
    HOME_SHIFT,
    HS_FALLING_EDGE_SEARCH_REVERSE,
    LS_FALLING_EDGE_SEARCH_REVERSE,
    MECHANICAL_END_DETECTION,
    Z_PULSE_SEARCH_REVERSE_ARMED,
    Step,
)


def mechanical_end(then: Step) -> Table:
    """Return the search for the mechanical end."""
    return {MECHANICAL_END_DETECTION: Row(TOWARD_SLOW, {Event.END_DETECTED: then})}


MECHANICAL_END = homes_within_limits(
    HomeType.MechanicalEndDetection,
    'the feedback at the mechanical end',
    """
    1. MechanicalEndDetection: go toward, slow, until the mechanical end holds the axis: the
       command is ahead of the feedback by more than `mechanical_end_detection_pos_diff` for
       `mechanical_end_detection_time`. The feedback is the home position then.
    2. HomeShift: come to rest, then go to the home position plus the home shift. A negative shift
       takes the axis off the end.

    The torque is limited to `mechanical_end_detection_first_torque_limit` until the axis touches
    the end, then to `mechanical_end_detection_second_torque_limit` if that is set.
    """,
    mechanical_end(then=HOME_SHIFT),
)

MECHANICAL_END_HS = homes_within_limits(
    HomeType.MechanicalEndDetectionHS,
    'the first edge of the home switch, going away from the mechanical end',
    """
    1. MechanicalEndDetection: go toward, slow, until the mechanical end holds the axis, as in the
       home type MechanicalEndDetection.
    2. HSFallingEdgeSearchReverse: go away, slow, to the first edge of the home switch. The switch
       rises there, or falls if it is on at the mechanical end. That edge is the home position.
    3. HomeShift: come to rest beyond the edge, then go to the home position plus the home shift.
    """,
    mechanical_end(then=HS_FALLING_EDGE_SEARCH_REVERSE),
    {
        HS_FALLING_EDGE_SEARCH_REVERSE: Row(
            AWAY_SLOW, {Event.HS_RISES: HOME_SHIFT, Event.HS_FALLS: HOME_SHIFT}
        ),
    },
)

MECHANICAL_END_LS = homes_within_limits(
    HomeType.MechanicalEndDetectionLS,
    'the first edge of the hardware limit switch, going away from the mechanical end',
    """
    1. MechanicalEndDetection: go toward, slow, until the mechanical end holds the axis, as in the
       home type MechanicalEndDetection. `mechanical_end_detection_ignore_ls` lets the axis pass
       the limit switch on its way there.
    2. LSFallingEdgeSearchReverse: go away, slow, to the first edge of the hardware limit switch
       ahead. The switch rises there, or falls if it is on at the mechanical end. That edge is the
       home position.
    3. HomeShift: come to rest beyond the edge, then go to the home position plus the home shift.
    """,
    mechanical_end(then=LS_FALLING_EDGE_SEARCH_REVERSE),
    {
        LS_FALLING_EDGE_SEARCH_REVERSE: Row(
            AWAY_SLOW, {Event.LS_RISES: HOME_SHIFT, Event.LS_FALLS: HOME_SHIFT}
        ),
    },
    target=LimitPair.HARDWARE,
)

MECHANICAL_END_REVERSE_Z_PULSE = homes_within_limits(
    HomeType.MechanicalEndDetectionReverseZPulse,
    'the first Z-pulse going away from the mechanical end',
    """
    1. MechanicalEndDetection: go toward, slow, until the mechanical end holds the axis, as in the
       home type MechanicalEndDetection.
    2. ZPulseSearchReverse, armed: go away, slow, to the first Z-pulse. The position that the drive
       latched there is the home position.
    3. HomeShift: come to rest beyond the pulse, then go to the home position plus the home shift.
    """,
    mechanical_end(then=Z_PULSE_SEARCH_REVERSE_ARMED),
    Z_PULSE_REVERSE_ROWS,
)
