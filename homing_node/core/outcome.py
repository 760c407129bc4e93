# SPDX-License-Identifier: Apache-2.0
"""The values that say why a run failed and how it ended."""

from collections.abc import Sequence
from typing import NamedTuple

from ..parameters.units import Unit
from ..procedures.states import Error, Input


class Failure(NamedTuple):
    """Why a run cannot go on.

    Attributes:
        error: the error that is reported.
        seen: what was expected and what was seen.
        hint: a possible reason, as a question; may be empty.
    """

    error: Error
    seen: str
    hint: str = ''


class MemberHome(NamedTuple):
    """One drive of a gantry; lengths in m or rad.

    Attributes:
        name: the axis for the leader, else the follower's name in `followers`.
        joint: its joint.
        position: its raw position.
        skew: how far it has moved more than the leader since the start of the run.
        home_position_raw: raw position of its captured reference; 0 until it was captured.
        squareness: its reference less `switch_offset` and the leader's reference, where both
            count from the same place; 0: square.
        uncertainty: how far ``squareness`` may be off.
    """

    name: str
    joint: str
    position: float = 0.0
    skew: float = 0.0
    home_position_raw: float = 0.0
    squareness: float = 0.0
    uncertainty: float = 0.0


class Met(NamedTuple):
    """A change of an input that the axis has met on its way.

    Attributes:
        time: when the input changed, s.
        input: the input.
        level: its level after the change, after polarity; true for a latched pulse.
        position: where the axis was, raw, m or rad.
        uncertainty: how far that may be off, m or rad.
        velocity: how fast the axis was, with its sign, raw, m/s or rad/s.
    """

    time: float
    input: Input
    level: bool
    position: float
    uncertainty: float
    velocity: float


class Jogged(NamedTuple):
    """How a jog has gone.

    Attributes:
        distance: how far the axis went, raw, m or rad.
        edges: what it has met on its way, in the order of time.
    """

    distance: float
    edges: tuple[Met, ...] = ()


class Outcome(NamedTuple):
    """How a run ended, or why a request was refused.

    Attributes:
        error: NoError if the axis is homed.
        message: the error in words.
        home_position_raw: where home is in the feedback's coordinates, m or rad.
        home_offset: raw position minus homed position, m or rad.
        uncertainty: how far the home position may be off, m or rad.
        passes: the number of passes over the reference.
        passes_range: largest minus smallest position of the passes, m or rad.
        passes_deviation: their standard deviation, m or rad.
        index_margin: distance from the edge that armed the Z-pulse to the first pulse, in pitches;
            None if it is not known.
        warnings: what the user should know of the run.
        duration: how long the run took, s.
        verified: raw difference of the home that a run has found from the home that it verified,
            m or rad; None: it verified none.
        verified_uncertainty: how far that difference may be off, m or rad.
        unit: the unit of the axis.
        final: whether waiting does not mend what forbids the run.
        applied: what the driver takes off its own coordinates since the hand-over, m or rad; None
            if it applies no home.
        members: the drives of a gantry, the leader first; else none.
        jogged: how a jog has gone; None: it was a homing run.
    """

    error: Error
    message: str = ''
    home_position_raw: float = 0.0
    home_offset: float = 0.0
    uncertainty: float = 0.0
    passes: int = 0
    passes_range: float = 0.0
    passes_deviation: float = 0.0
    index_margin: float | None = None
    warnings: tuple[str, ...] = ()
    final: bool = False
    verified: float | None = None
    verified_uncertainty: float = 0.0
    unit: Unit = Unit.m
    applied: float | None = None
    members: tuple[MemberHome, ...] = ()
    duration: float = 0.0
    jogged: Jogged | None = None

    @property
    def success(self) -> bool:
        return self.error is Error.NoError


def together(missing: Sequence[Outcome]) -> Outcome:
    """Return one outcome that names everything that is missing."""
    first = missing[0]
    texts = [
        one.message if one.error is first.error else f'{one.error}: {one.message}'
        for one in dict.fromkeys(missing)
    ]
    return Outcome(first.error, '; '.join(texts))
