# SPDX-License-Identifier: Apache-2.0
"""The home types as tables: step -> (motion, {event: next step}).

A table is plain data. The manual's shared pages are fragments that every type composes: *limit
switches during homing*, *home switch initially on*, *limit switch initially on*, *home shift*.
What holds in every step is not in the tables but in machine.py: a normal limit, a stale input, a
cancel are tested before a row's own arrows; distance and time before what its motion brings about.

- The first row of a table is where the procedure begins. A condition (``HS_ON`` ...) is tested
  when its row is entered, so it also tells what the start position changes.
- The event on the arrow into ``HOME_SHIFT`` is the reference: its position is the home position.
- ``REPEAT`` takes the place of the arrow into ``HOME_SHIFT`` while passes are left.
- The event that led into a row is the row's *cause*: a Z-pulse or probe latch counts only beyond
  it, the homing reverse distance is counted from it.

Sources: WMX3 manual, "Limit Switches During Homing", "Home Switch Initially Triggered", "Limit
Switch Initially Triggered" and the pages of the home types.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

from .events import Event
from .motions import (
    AWAY_FAST,
    AWAY_SLOW,
    COME_TO_REST,
    FURTHER_AWAY,
    TO_HOME_POSITION,
    TOWARD_FAST,
    TOWARD_SLOW,
    Bound,
    Motion,
)
from .states import LATCHES, HomeType, Input, Role, State, Tier


class Step(NamedTuple):
    """A row's key: the published home state and, where a state has several rows, which one."""

    state: State
    phase: str = ''

    def __str__(self) -> str:
        return f'{self.state} ({self.phase})' if self.phase else str(self.state)


@dataclass(frozen=True)
class Row:
    """What the axis does in a step, where each event leads, and what bounds a search."""

    motion: Motion
    on: Mapping[Event, Step]
    bound: Bound = Bound.SEARCH

    @cached_property
    def latches(self) -> tuple[Event, ...]:
        """Those of its events that are latched positions."""
        return tuple(event for event in self.on if INPUT_OF.get(event) in LATCHES)


@dataclass(frozen=True)
class Procedure:
    """A home type: its table, what a limit ahead means to it, and the limit it homes on."""

    home_type: HomeType
    rows: Mapping[Step, Row]
    limits_ahead: Mapping[Tier, Role]
    target: Tier | None = None
    first: Step = field(init=False)
    events: frozenset[Event] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, 'first', next(iter(self.rows)))
        used = (event for row in self.rows.values() for event in row.on)
        object.__setattr__(self, 'events', frozenset(used))

    @property
    def inputs(self) -> frozenset[Input]:
        """Inputs without which this type cannot home (the target limit besides)."""
        return frozenset(INPUT_OF[event] for event in self.events if event in INPUT_OF)


INPUT_OF: Mapping[Event, Input] = {
    Event.HS_RISES: Input.HOME_SWITCH,
    Event.HS_FALLS: Input.HOME_SWITCH,
    Event.Z_PULSE: Input.Z_PULSE,
    Event.TOUCH_PROBE: Input.TOUCH_PROBE,
}

# ---------------------------------------------------------------------------------- the steps

HS_SEARCH = Step(State.HSSearch)
HS_AND_Z_PULSE_SEARCH = Step(State.HSAndZPulseSearch)
HS_AND_Z_PULSE_SEARCH_ARMED = Step(State.HSAndZPulseSearch, 'armed')
HS_OFF_SEARCH = Step(State.HSOffSearch)
HS_OFF_AND_Z_PULSE_SEARCH = Step(State.HSOffAndZPulseSearch)
HS_OFF_AND_Z_PULSE_SEARCH_ARMED = Step(State.HSOffAndZPulseSearch, 'armed')
LS_SEARCH = Step(State.LSSearch)
Z_PULSE_SEARCH = Step(State.ZPulseSearch)
Z_PULSE_SEARCH_REVERSE = Step(State.ZPulseSearchReverse)
Z_PULSE_SEARCH_REVERSE_ARMED = Step(State.ZPulseSearchReverse, 'armed')
HS_CLEAR_REVERSE = Step(State.HSClearReverse)
HS_CLEAR_REVERSE_FURTHER = Step(State.HSClearReverse, 'further')
HS_CLEAR_REVERSE_AT_START = Step(State.HSClearReverse, 'at start')
HS_CLEAR_REVERSE_AT_START_FURTHER = Step(State.HSClearReverse, 'at start, further')
HS_FALLING_EDGE_SEARCH_REVERSE = Step(State.HSFallingEdgeSearchReverse)
HS_FALLING_EDGE_SEARCH_REVERSE_FURTHER = Step(State.HSFallingEdgeSearchReverse, 'further')
LS_FALLING_EDGE_SEARCH_REVERSE = Step(State.LSFallingEdgeSearchReverse)
LS_FALLING_EDGE_SEARCH_REVERSE_FURTHER = Step(State.LSFallingEdgeSearchReverse, 'further')
SECOND_HS_SEARCH = Step(State.SecondHSSearch)
TOUCH_PROBE_SEARCH = Step(State.TouchProbeSearch)
MECHANICAL_END_DETECTION = Step(State.MechanicalEndDetection)
HOME_SHIFT = Step(State.HomeShift)
HOME_SHIFT_MOVE = Step(State.HomeShift, 'move')
HOMED = Step(State.Idle, 'homed')

# --------------------------------------------------------------------------- shared fragments

Table = Mapping[Step, Row]


def limit_switch_during_homing(then: Step) -> Table:
    """Give the reversal: away from the limit until HS falls, further, then begin again."""
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
    """Give the way off a home switch that is on at the start."""
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
    """Give the way off a target limit that is on at the start."""
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
    """Give the way off the home switch between the first pass and the second."""
    return {
        HS_CLEAR_REVERSE: Row(AWAY_FAST, {Event.HS_FALLS: HS_CLEAR_REVERSE_FURTHER}),
        HS_CLEAR_REVERSE_FURTHER: Row(
            FURTHER_AWAY, {Event.HS_ON: HS_CLEAR_REVERSE, Event.DONE: then}
        ),
    }


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

    Raises ValueError where two of them hold the same step.
    """
    rows: dict[Step, Row] = {}
    for fragment in fragments:
        for step, row in fragment.items():
            if step in rows:
                raise ValueError(f'step {step} stands in two fragments')
            rows[step] = row
    return MappingProxyType(rows)


# fmt: off  (a table reads like its state diagram)

# ------------------------------------------------- what a limit ahead means (manual's page, §6)

LIMITS_REVERSE = dict.fromkeys(Tier, Role.REVERSAL)
LIMITS_NORMAL = dict.fromkeys(Tier, Role.NORMAL)
LIMITS_OF_TARGET: Mapping[Tier, Mapping[Tier, Role]] = {
    Tier.HARDWARE: {
        Tier.HARDWARE: Role.REFERENCE,
        Tier.NEAR: Role.IGNORED,
        Tier.EXTERNAL: Role.IGNORED,
    },
    Tier.NEAR: {
        Tier.HARDWARE: Role.NORMAL,
        Tier.NEAR: Role.REFERENCE,
        Tier.EXTERNAL: Role.IGNORED,
    },
    Tier.EXTERNAL: {
        Tier.HARDWARE: Role.NORMAL,
        Tier.NEAR: Role.IGNORED,
        Tier.EXTERNAL: Role.REFERENCE,
    },
}


def homes_on_switch(home_type: HomeType, *fragments: Table) -> Procedure:
    """Give a home type in which a limit ahead means the reversal."""
    return Procedure(home_type, compose(*fragments, HOME_SHIFT_ROWS), LIMITS_REVERSE)


def homes_on_limit(home_type: HomeType, target: Tier, *fragments: Table) -> Procedure:
    """Give a home type whose reference is a limit switch."""
    rows = compose(*fragments, HOME_SHIFT_ROWS)
    return Procedure(home_type, rows, LIMITS_OF_TARGET[target], target)


def homes_within_limits(
    home_type: HomeType, *fragments: Table, target: Tier | None = None
) -> Procedure:
    """Give a home type in which every limit acts as it always does."""
    return Procedure(home_type, compose(*fragments, HOME_SHIFT_ROWS), LIMITS_NORMAL, target)


# --------------------------------------------------------------------- home switch, rising edge

HS = homes_on_switch(
    HomeType.HS,
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
)

HSHS = homes_on_switch(
    HomeType.HSHS,
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
)

HS_Z_PULSE = homes_on_switch(
    HomeType.HSZPulse,
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
)

HS_REVERSE_Z_PULSE = homes_on_switch(
    HomeType.HSReverseZPulse,
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
)

HS_TOUCH_PROBE = homes_on_switch(
    HomeType.HSTouchProbe,
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
)

# -------------------------------------------------------------------- home switch, falling edge

HS_OFF = homes_on_switch(
    HomeType.HSOff,
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
)

HS_OFF_Z_PULSE = homes_on_switch(
    HomeType.HSOffZPulse,
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
)

HS_OFF_REVERSE_Z_PULSE = homes_on_switch(
    HomeType.HSOffReverseZPulse,
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
)

# ------------------------------------------------------------------------------- limit switches

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

LS = homes_on_limit(HomeType.LS, Tier.HARDWARE, LS_ROWS)
NEAR_LS = homes_on_limit(HomeType.NearLS, Tier.NEAR, LS_ROWS)
EXTERNAL_LS = homes_on_limit(HomeType.ExternalLS, Tier.EXTERNAL, LS_ROWS)
LS_REVERSE_Z_PULSE = homes_on_limit(
    HomeType.LSReverseZPulse, Tier.HARDWARE, LS_REVERSE_Z_PULSE_ROWS
)
NEAR_LS_REVERSE_Z_PULSE = homes_on_limit(
    HomeType.NearLSReverseZPulse, Tier.NEAR, LS_REVERSE_Z_PULSE_ROWS
)
EXTERNAL_LS_REVERSE_Z_PULSE = homes_on_limit(
    HomeType.ExternalLSReverseZPulse, Tier.EXTERNAL, LS_REVERSE_Z_PULSE_ROWS
)

# ---------------------------------------------------------------------------- without a switch

CURRENT_POS = homes_within_limits(HomeType.CurrentPos)

Z_PULSE = homes_within_limits(
    HomeType.ZPulse, {Z_PULSE_SEARCH: Row(TOWARD_SLOW, {Event.Z_PULSE: HOME_SHIFT})}
)

TOUCH_PROBE = homes_within_limits(
    HomeType.TouchProbe, {TOUCH_PROBE_SEARCH: Row(TOWARD_SLOW, {Event.TOUCH_PROBE: HOME_SHIFT})}
)

# ------------------------------------------------------------------------------ mechanical end


def mechanical_end(then: Step) -> Table:
    """Give the search for the mechanical end."""
    return {MECHANICAL_END_DETECTION: Row(TOWARD_SLOW, {Event.END_DETECTED: then})}


MECHANICAL_END = homes_within_limits(
    HomeType.MechanicalEndDetection, mechanical_end(then=HOME_SHIFT)
)

MECHANICAL_END_HS = homes_within_limits(
    HomeType.MechanicalEndDetectionHS,
    mechanical_end(then=HS_FALLING_EDGE_SEARCH_REVERSE),
    {
        HS_FALLING_EDGE_SEARCH_REVERSE: Row(
            AWAY_SLOW, {Event.HS_RISES: HOME_SHIFT, Event.HS_FALLS: HOME_SHIFT}
        ),
    },
)

MECHANICAL_END_LS = homes_within_limits(
    HomeType.MechanicalEndDetectionLS,
    mechanical_end(then=LS_FALLING_EDGE_SEARCH_REVERSE),
    {
        LS_FALLING_EDGE_SEARCH_REVERSE: Row(
            AWAY_SLOW, {Event.LS_RISES: HOME_SHIFT, Event.LS_FALLS: HOME_SHIFT}
        ),
    },
    target=Tier.HARDWARE,
)

MECHANICAL_END_REVERSE_Z_PULSE = homes_within_limits(
    HomeType.MechanicalEndDetectionReverseZPulse,
    mechanical_end(then=Z_PULSE_SEARCH_REVERSE_ARMED),
    Z_PULSE_REVERSE_ROWS,
)


def _by_home_type(procedures: Iterable[Procedure]) -> Mapping[HomeType, Procedure]:
    return MappingProxyType({procedure.home_type: procedure for procedure in procedures})


PROCEDURES = _by_home_type(
    [
        HS,
        HS_Z_PULSE,
        HS_REVERSE_Z_PULSE,
        HSHS,
        HS_TOUCH_PROBE,
        HS_OFF,
        HS_OFF_Z_PULSE,
        HS_OFF_REVERSE_Z_PULSE,
        LS,
        LS_REVERSE_Z_PULSE,
        NEAR_LS,
        NEAR_LS_REVERSE_Z_PULSE,
        EXTERNAL_LS,
        EXTERNAL_LS_REVERSE_Z_PULSE,
        CURRENT_POS,
        Z_PULSE,
        TOUCH_PROBE,
        MECHANICAL_END,
        MECHANICAL_END_HS,
        MECHANICAL_END_LS,
        MECHANICAL_END_REVERSE_Z_PULSE,
    ]
)
