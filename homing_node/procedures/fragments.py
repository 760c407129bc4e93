# SPDX-License-Identifier: Apache-2.0
"""The parts that the tables are composed of: the pages that the manual's home types share."""

from collections.abc import Mapping
from types import MappingProxyType

from .events import Event
from .motions import (
    AWAY_FAST,
    AWAY_SLOW,
    COME_TO_REST,
    FURTHER_AWAY,
    QUICK_AWAY,
    QUICK_TOWARD,
    TO_HOME_POSITION,
    Bound,
)
from .procedure import Procedure, Row
from .states import HomeType, LimitPair, Role, State
from .steps import (
    HOME_SHIFT,
    HOME_SHIFT_MOVE,
    HOMED,
    HS_CLEAR_REVERSE,
    HS_CLEAR_REVERSE_AT_START,
    HS_CLEAR_REVERSE_AT_START_FURTHER,
    HS_CLEAR_REVERSE_FURTHER,
    HS_FALLING_EDGE_SEARCH_REVERSE,
    HS_FALLING_EDGE_SEARCH_REVERSE_FURTHER,
    LS_FALLING_EDGE_SEARCH_REVERSE,
    LS_FALLING_EDGE_SEARCH_REVERSE_FURTHER,
    Z_PULSE_SEARCH_REVERSE_ARMED,
    Step,
)

Table = Mapping[Step, Row]


def limit_switch_during_homing(then: Step) -> Table:
    """Return the reversal: away from the limit until HS falls, further, then begin again."""
    return {
        HS_FALLING_EDGE_SEARCH_REVERSE: Row(
            AWAY_FAST,
            {Event.HS_FALLS: HS_FALLING_EDGE_SEARCH_REVERSE_FURTHER},
            Bound.LS_REVERSE,
        ),
        HS_FALLING_EDGE_SEARCH_REVERSE_FURTHER: Row(
            FURTHER_AWAY, {Event.HS_ON: HS_FALLING_EDGE_SEARCH_REVERSE, Event.DONE: then}
        ),
    }


def home_switch_initially_on(then: Step) -> Table:
    """Return the way off a home switch that is on at the start."""
    return {
        HS_CLEAR_REVERSE_AT_START: Row(
            AWAY_FAST,
            {Event.HS_FALLS: HS_CLEAR_REVERSE_AT_START_FURTHER},
            Bound.HS_ON_AT_START,
        ),
        HS_CLEAR_REVERSE_AT_START_FURTHER: Row(
            FURTHER_AWAY, {Event.HS_ON: HS_CLEAR_REVERSE_AT_START, Event.DONE: then}
        ),
    }


def limit_switch_initially_on(then: Step) -> Table:
    """Return the way off a target limit that is on at the start."""
    return {
        LS_FALLING_EDGE_SEARCH_REVERSE: Row(
            AWAY_FAST,
            {Event.LS_FALLS: LS_FALLING_EDGE_SEARCH_REVERSE_FURTHER},
            Bound.LS_REVERSE,
        ),
        LS_FALLING_EDGE_SEARCH_REVERSE_FURTHER: Row(
            FURTHER_AWAY, {Event.LS_ON: LS_FALLING_EDGE_SEARCH_REVERSE, Event.DONE: then}
        ),
    }


def home_switch_clear(then: Step) -> Table:
    """Return the way off the home switch between the first pass and the second."""
    return {
        HS_CLEAR_REVERSE: Row(AWAY_FAST, {Event.HS_FALLS: HS_CLEAR_REVERSE_FURTHER}),
        HS_CLEAR_REVERSE_FURTHER: Row(
            FURTHER_AWAY, {Event.HS_ON: HS_CLEAR_REVERSE, Event.DONE: then}
        ),
    }


def quick_way(state: State, met: Mapping[Event, Step], then: Step) -> Table:
    """Return the quick way to the margin before the switch, for a run that knows where it is.

    Args:
        state: the home state that is published.
        met: where an event leads that comes too early: into the ordinary run.
        then: what follows at the margin.
    """
    return {
        Step(state, 'quick'): Row(QUICK_TOWARD, {**met, Event.DONE: then}),
        Step(state, 'quick, back'): Row(QUICK_AWAY, {Event.DONE: then}),
    }


#: The end of every table: the overrun, then the move to the home position plus the home shift.
HOME_SHIFT_ROWS: Table = {
    HOME_SHIFT: Row(COME_TO_REST, {Event.DONE: HOME_SHIFT_MOVE}),
    HOME_SHIFT_MOVE: Row(TO_HOME_POSITION, {Event.DONE: HOMED}),
}

#: The row that takes the first Z-pulse going away, once the edge that arms it was found.
Z_PULSE_REVERSE_ROWS: Table = {
    Z_PULSE_SEARCH_REVERSE_ARMED: Row(AWAY_SLOW, {Event.Z_PULSE: HOME_SHIFT}),
}


def compose(*fragments: Table) -> Table:
    """Join tables in order.

    Raises:
        ValueError: two of them hold the same step.
    """
    rows: dict[Step, Row] = {}
    for fragment in fragments:
        for step, row in fragment.items():
            if step in rows:
                raise ValueError(f'step {step} stands in two fragments')
            rows[step] = row
    return MappingProxyType(rows)


#: What a limit ahead means (the manual's page): the reversal, what it always means, or by the
#: limit that the home type homes on: that one is the reference, some are ignored.
LIMITS_REVERSE = dict.fromkeys(LimitPair, Role.REVERSAL)
LIMITS_NORMAL = dict.fromkeys(LimitPair, Role.NORMAL)
LIMITS_OF_TARGET: Mapping[LimitPair, Mapping[LimitPair, Role]] = {
    LimitPair.HARDWARE: {
        LimitPair.HARDWARE: Role.REFERENCE,
        LimitPair.NEAR: Role.IGNORED,
        LimitPair.EXTERNAL: Role.IGNORED,
    },
    LimitPair.NEAR: {
        LimitPair.HARDWARE: Role.NORMAL,
        LimitPair.NEAR: Role.REFERENCE,
        LimitPair.EXTERNAL: Role.IGNORED,
    },
    LimitPair.EXTERNAL: {
        LimitPair.HARDWARE: Role.NORMAL,
        LimitPair.NEAR: Role.IGNORED,
        LimitPair.EXTERNAL: Role.REFERENCE,
    },
}


def homes_on_switch(
    home_type: HomeType, home: str, words: str, *fragments: Table, quick: Table
) -> Procedure:
    """Return a home type for which a limit ahead means the reversal."""
    rows = compose(*fragments, HOME_SHIFT_ROWS)
    return Procedure(home_type, home, words, rows, LIMITS_REVERSE, quick=quick)


def homes_on_limit(
    home_type: HomeType,
    home: str,
    words: str,
    target: LimitPair,
    *fragments: Table,
    quick: Table,
) -> Procedure:
    """Return a home type whose reference is a limit switch."""
    rows = compose(*fragments, HOME_SHIFT_ROWS)
    return Procedure(home_type, home, words, rows, LIMITS_OF_TARGET[target], target, quick)


def homes_within_limits(
    home_type: HomeType, home: str, words: str, *fragments: Table, target: LimitPair | None = None
) -> Procedure:
    """Return a home type for which every limit acts as it always does."""
    rows = compose(*fragments, HOME_SHIFT_ROWS)
    return Procedure(home_type, home, words, rows, LIMITS_NORMAL, target)
