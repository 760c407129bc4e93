# SPDX-License-Identifier: Apache-2.0
"""The rows that a gantry has besides the table of its home type.

Once the table has found its reference and the axis rests:

1. Squaring: the followers alone move, slowly, by what the gantry is out of square.
2. Proving: go back before the references, then pass them once more, slowly.
3. Come to rest, and go on with the table's last row.

A home switch that is on at the start is cleared, also for the types that home where it falls
(WMX3 manual, "Home Switch Initially Triggered": gantry).
"""

from collections.abc import Mapping

from .events import Event
from .fragments import Table, compose, home_switch_initially_on
from .motions import COME_TO_REST, Kind, Motion, Pace, Way
from .procedure import Procedure, Row
from .states import Input, State
from .steps import HOME_SHIFT, HOME_SHIFT_MOVE, HS_CLEAR_REVERSE_AT_START, Step

SQUARING = Step(State.Squaring)
PROVING_BACK = Step(State.Proving, 'back')
PROVING = Step(State.Proving)
PROVED = Step(State.Proving, 'at rest')

SQUARE = Motion(Kind.SQUARE, Way.NONE, Pace.SLOW, 'the followers alone, slow')
#: Back before the references, by the way in which they are passed.
BACK: Mapping[Way, Motion] = {
    Way.TOWARD: Motion(Kind.BACK, Way.AWAY, Pace.FAST, 'away, before the references'),
    Way.AWAY: Motion(Kind.BACK, Way.TOWARD, Pace.FAST, 'toward, before the references'),
}
PASS: Mapping[Way, Motion] = {
    way: Motion(Kind.SEARCH, way, Pace.SLOW, f'{way.name.lower()}, slow')
    for way in (Way.TOWARD, Way.AWAY)
}


def reference_of(procedure: Procedure) -> tuple[Event, Way]:
    """Return the event that is the reference of a home type, and which way it is passed."""
    for row in procedure.rows.values():
        for event, step in row.on.items():
            if step is HOME_SHIFT:
                return event, row.motion.way
    raise ValueError(f'{procedure.home_type} has no reference')


def clears_at_start(procedure: Procedure) -> bool:
    """Return whether a gantry clears a home switch at the start that the table does not clear."""
    on_home_switch = Input.HOME_SWITCH in procedure.inputs
    return on_home_switch and HS_CLEAR_REVERSE_AT_START not in procedure.rows


def gantry_rows(procedure: Procedure) -> Table:
    """Return the rows of a gantry that homes by a procedure: the table's, and its own."""
    event, way = reference_of(procedure)
    own: Table = {
        SQUARING: Row(SQUARE, {Event.DONE: PROVING_BACK}),
        PROVING_BACK: Row(BACK[way], {Event.DONE: PROVING}),
        PROVING: Row(PASS[way], {event: PROVED}),
        PROVED: Row(COME_TO_REST, {Event.DONE: HOME_SHIFT_MOVE}),
    }
    clearing: Table = {}
    if clears_at_start(procedure):
        clearing = home_switch_initially_on(then=procedure.first)
    return compose(procedure.rows, clearing, own)
