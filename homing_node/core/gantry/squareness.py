# SPDX-License-Identifier: Apache-2.0
"""How square a gantry is, from where each side has found its reference, and what follows from it.

The squareness of a follower is its reference less its `switch_offset` and less the leader's
reference, where both count from the same place: the constant offset between their commands is
taken off. So it is also how far the follower must move to be square. Lengths in m or rad, in the
*toward* frame.
"""

from collections.abc import Mapping, Sequence
from statistics import fmean
from typing import NamedTuple

from ...parameters.axis import AxisParameters
from ...procedures.events import Event
from ...procedures.states import Error
from ..outcome import Failure
from ..signals import Mark
from .edges import GroupEdge, GroupMark, least_uncertainty
from .side import Side


class Deviation(NamedTuple):
    """How far a side is out of square, and how far that may be off."""

    value: float
    uncertainty: float


class Squareness:
    """The squareness of a gantry in a run.

    Attributes:
        errors: of each follower that has a reference, as it was found last.
        found: the newest reference of each side.
    """

    def __init__(self, parameters: AxisParameters, sides: tuple[Side, ...], event: Event) -> None:
        """Begin; ``event`` is the event of the table that is the reference."""
        self._p, self._sides, self._leader = parameters, sides, sides[0]
        self._by_pulse = event is Event.Z_PULSE
        self.errors: dict[Side, Deviation] = {}
        self.found: dict[Side, Mark] = {}

    def measure(self, marks: Sequence[Mark]) -> None:
        """Take where each side has found its reference, in one pass or more."""
        passes = [mark.parts for mark in marks if isinstance(mark, GroupEdge | GroupMark)]
        if not passes:
            return
        self.found = dict(passes[-1])
        self.errors = {}
        leader = self._leader
        for side in self._sides[1:]:
            parts = [parts for parts in passes if side in parts and leader in parts]
            if parts:
                apart = fmean(one[side].position - one[leader].position for one in parts)
                self.errors[side] = Deviation(
                    apart - side.offset - side.shift,
                    max(
                        least_uncertainty(one[side], side.readings.finest)
                        + least_uncertainty(one[leader], leader.readings.finest)
                        for one in parts
                    ),
                )

    def moves(self) -> Failure | Mapping[Side, float]:
        """Return by how much each follower must move to be square, or why it must not."""
        p = self._p
        errors = {side: error.value for side, error in self.errors.items()}
        for side, error in self.errors.items():
            ambiguous = self._ambiguous(side, error)
            if ambiguous is not None:
                return ambiguous
        low, high = min([0.0, *errors.values()]), max([0.0, *errors.values()])
        if high - low > p.max_skew:
            listed = ', '.join(f'{side.name} by {error:.6g} m' for side, error in errors.items())
            return Failure(
                Error.SkewTooLarge,
                f'out of square: {listed}; that is more than {p.max_skew:.6g} m (max_skew), and '
                'is not forced',
                'is switch_offset right? Else free the gantry with its drives off',
            )
        if not self._squares:
            return {}
        return {side: error for side, error in errors.items() if abs(error) > p.square_tolerance}

    def _ambiguous(self, side: Side, error: Deviation) -> Failure | None:
        """Return why the Z-pulse of a side may belong to another turn.

        A gantry that may be out of square by half a pitch does not tell the turns apart.
        """
        pitch = side.latches.pitch
        if not self._by_pulse or not pitch:
            return None
        half, skew = 0.5 * pitch, self._p.max_skew
        if skew >= half:
            return Failure(
                Error.IndexAmbiguous,
                f'max_skew is {skew:.6g} m: half the distance of the Z-pulses of {side.name} or '
                f'more, {half:.6g} m, so that a pulse may be that of another turn',
                'make max_skew smaller, or home on the switches',
            )
        if abs(error.value) <= half - error.uncertainty:
            return None
        turns = max(1, round(abs(error.value) / pitch))
        return Failure(
            Error.IndexAmbiguous,
            f'the Z-pulse of {side.name} is {error.value:.6g} m from where it belongs, about '
            f'{turns} x {pitch:.6g} m, the distance of the pulses',
            "does its home switch arm the pulse of the same turn as the leader's?",
        )

    def moved(self, before: Mark, agreement: float) -> Failure | None:
        """Return why the proving pass contradicts the first ones: the leader has not moved alone.

        Args:
            before: where they have found the leader's reference.
            agreement: how far apart they may be, besides what is uncertain.
        """
        again = self.found.get(self._leader)
        if again is None:
            return None
        apart = abs(again.position - before.position)
        unsure = again.uncertainty + before.uncertainty
        if apart <= agreement + unsure:
            return None
        return Failure(
            Error.EdgeNotRepeated,
            f'the proving pass found the reference of {self._leader.name} {apart:.6g} m from '
            f'where it was, more than {agreement:.6g} m (edge_tolerance) and both '
            f'uncertainties, {unsure:.6g} m',
            'noise on the switch, or late messages?',
        )

    def unproven(self) -> Failure | None:
        """Return which side is not square, though it was squared."""
        for side, error in self.errors.items():
            limit = self._p.square_tolerance + error.uncertainty
            if abs(error.value) > limit:
                return Failure(
                    Error.NotSquare,
                    f'after the squaring move {side.name} is {error.value:.6g} m out of square, '
                    f'more than {self._p.square_tolerance:.6g} m (square_tolerance) and the '
                    f'uncertainty, {error.uncertainty:.6g} m',
                    'are the cables of two sides swapped, or is a coupling loose?',
                )
        return None

    def at_rest(self, places: Mapping[Side, float]) -> Failure | None:
        """Take where the sides rest after the last move; return which is not square any more.

        A side that has stayed behind since its reference is out of square by that. A side without
        a reference must be as far from the leader as at the start. A gantry that is not squared
        is only measured.
        """
        p, leader = self._p, self._leader
        for side in self._sides[1:]:
            apart, error = places[side] - places[leader], self.errors.get(side)
            count = max(side.track.count, leader.track.count)
            if error is None:
                left, unsure = side.at_start - apart, 2.0 * count
            else:
                left, unsure = error.value + side.offset - apart, error.uncertainty + 2.0 * count
                self.errors[side] = error._replace(value=left)
            if self._squares and abs(left) > p.square_tolerance + unsure:
                return Failure(
                    Error.NotSquare,
                    f'at rest {side.name} is {left:.6g} m out of square, more than '
                    f'{p.square_tolerance:.6g} m (square_tolerance) and the uncertainty, '
                    f'{unsure:.6g} m',
                    'did a side not follow the last move, or does its feedback stand still?',
                )
        return None

    @property
    def _squares(self) -> bool:
        return self._p.square and not self._p.gantry_homing_retain_sync_offset
