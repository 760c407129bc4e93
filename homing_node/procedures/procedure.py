# SPDX-License-Identifier: Apache-2.0
"""What the table of a home type consists of: rows, and what the home type needs."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from .events import Event
from .motions import Bound, Kind, Motion
from .states import LATCHES, HomeType, Input, LimitPair, Role
from .steps import Step


@dataclass(frozen=True)
class Row:
    """What the axis does in a step.

    Attributes:
        motion: the motion.
        on: where each event leads.
        bound: what bounds the distance of a search.
    """

    motion: Motion
    on: Mapping[Event, Step]
    bound: Bound = Bound.SEARCH

    @cached_property
    def latches(self) -> tuple[Event, ...]:
        """Its events that are latched positions."""
        return tuple(event for event in self.on if INPUT_OF.get(event) in LATCHES)


@dataclass(frozen=True)
class Procedure:
    """A home type.

    Attributes:
        home_type: its name.
        home: what the home position is, in words.
        words: what the axis does, in words: the numbered steps, then what the start position and
            a limit change. Markdown; the home type's page shows it.
        rows: its table; the first row is where the procedure begins.
        limits_ahead: what each limit ahead means.
        target: the limit that it homes on, None if it homes on none.
        quick: the rows with which a run begins if it is known where the switch is: going toward,
            and coming back from beyond. Empty if this type has none.
        first: the step in which it begins.
        events: all labels of its arrows.
    """

    home_type: HomeType
    home: str
    words: str
    rows: Mapping[Step, Row]
    limits_ahead: Mapping[LimitPair, Role]
    target: LimitPair | None = None
    quick: Mapping[Step, Row] = field(default_factory=dict)
    first: Step = field(init=False)
    events: frozenset[Event] = field(init=False)

    def __post_init__(self) -> None:
        lines = (line.removeprefix('    ') for line in self.words.strip().splitlines())
        object.__setattr__(self, 'words', '\n'.join(lines))
        object.__setattr__(self, 'first', next(iter(self.rows)))
        used = (event for row in self.rows.values() for event in row.on)
        object.__setattr__(self, 'events', frozenset(used))

    @cached_property
    def moves(self) -> bool:
        """Whether the axis moves before it has found its reference."""
        kinds = {row.motion.kind for row in self.rows.values()}
        return not kinds.isdisjoint((Kind.SEARCH, Kind.APPROACH))

    @property
    def inputs(self) -> frozenset[Input]:
        """The inputs without which this type cannot home, except the target limit."""
        return frozenset(INPUT_OF[event] for event in self.events if event in INPUT_OF)


#: The input that brings about an event.
INPUT_OF: Mapping[Event, Input] = {
    Event.HS_RISES: Input.HOME_SWITCH,
    Event.HS_FALLS: Input.HOME_SWITCH,
    Event.Z_PULSE: Input.Z_PULSE,
    Event.TOUCH_PROBE: Input.TOUCH_PROBE,
}
