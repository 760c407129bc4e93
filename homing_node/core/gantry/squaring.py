# SPDX-License-Identifier: Apache-2.0
"""The squaring move of a gantry at rest: its followers alone move until it is square.

Each follower first moves by SIGN_TEST. If it does not move then, or the wrong way, the move ends:
with swapped cables it would make the gantry worse. Then it goes the rest of the way. Everything
is bounded: the distance, the following error, and the time.

Positions are in the *toward* frame, m or rad; times in s are passed in.
"""

from collections.abc import Mapping

from ...parameters.axis import AxisParameters
from ...procedures.motions import Pace
from ...procedures.states import Error
from ..outcome import Failure
from ..phase import Dynamics
from ..profile import Profile
from ..settling import SETTLE_TIMEOUT, Settling
from .side import Side

#: The first part of the move, which shows whether it goes the right way, m or rad.
SIGN_TEST = 1e-4
#: The least part of it that the feedback must show, and the part that is the wrong way.
LEAST, WRONG = 0.5, -0.5
#: The feedback may be so late, s.
LATE = 0.1


class SquaringMove:
    """The move of all followers that are out of square."""

    def __init__(
        self,
        parameters: AxisParameters,
        leader: Side,
        moves: Mapping[Side, float],
        lead: float = 0.0,
    ) -> None:
        """Plan the move.

        Args:
            parameters: those of the gantry as one axis.
            leader: the leader's side, which rests.
            moves: how far each follower goes.
            lead: how long before its time a setpoint is told, s.
        """
        self._p, self._leader, self._moves = parameters, leader, moves
        self._dynamics = Dynamics(*parameters.pace(Pace.SLOW))
        self._resting = {side: Settling(lead) for side in (leader, *moves)}
        self._before: dict[Side, float] = {}  # feedback less the leader's, before the move
        self._from: dict[Side, float] = {}  # the command before the move
        self._part: dict[Side, float] = {}  # the first part of the move
        self._tested = False
        self._arrived: float | None = None

    def update(self, now: float) -> bool | Failure:
        """Follow the move for a cycle; return whether it has ended, or why it must."""
        if not self._before:
            slow = self._p.homing_velocity_slow
            if all(one.over(now, side.track, slow) for side, one in self._resting.items()):
                self._begin()
            return False
        failure = self._wrong()
        if failure is not None:
            return failure
        if not all(_path(side).arrived for side in self._moves):
            self._arrived = None
            return False
        if self._arrived is None:
            self._arrived = now
        late = [side for side in self._moves if not self._is_there(side)]
        if late and now - self._arrived < SETTLE_TIMEOUT + LATE:
            return False
        if late:
            return self._did_not(late[0])
        if self._tested:
            self._end(now)
            return True
        self._tested, self._arrived = True, None
        for side, move in self._moves.items():
            _path(side).move(self._from[side] + move, self._dynamics)
        return False

    def moved(self, side: Side) -> float:
        """Return how far a follower has moved against the leader."""
        return side.track.position - self._leader.track.position - self._before[side]

    def _begin(self) -> None:
        for side, move in self._moves.items():
            self._before[side] = side.track.position - self._leader.track.position
            least = max(SIGN_TEST, 4.0 * max(side.track.count, self._leader.track.count))
            self._part[side] = max(-least, min(least, move))
            assert side.follower is not None
            path = side.follower.take_own_path()
            self._from[side] = path.position
            path.move(path.position + self._part[side], self._dynamics)

    def _wrong(self) -> Failure | None:
        """Return why a follower moves the wrong way, or too far."""
        for side, move in self._moves.items():
            part, moved = self._part[side], self.moved(side)
            if moved / part < WRONG:
                return Failure(
                    Error.NotSquare,
                    f'{side.name} moved {moved:.6g} m when it should move {part:.6g} m to be '
                    'square: the gantry gets worse',
                    'are the cables of two motors or two encoders swapped?',
                )
            if abs(moved) > abs(move) + max(0.5 * self._p.max_skew, 2.0 * abs(part)):
                return Failure(
                    Error.SkewTooLarge,
                    f'{side.name} moved {moved:.6g} m when it should move {move:.6g} m',
                )
        return None

    def _is_there(self, side: Side) -> bool:
        """Return whether the feedback shows enough of the move."""
        moved = self.moved(side)
        if not self._tested:
            return moved / self._part[side] >= LEAST
        count = max(side.track.count, self._leader.track.count)
        left = abs(self._moves[side] - moved)
        return left <= max(self._p.square_tolerance, 2.0 * count)

    def _did_not(self, side: Side) -> Failure:
        wanted = self._moves[side] if self._tested else self._part[side]
        return Failure(
            Error.NotSquare,
            f'{side.name} moved {self.moved(side):.6g} m when it should move {wanted:.6g} m to be '
            'square',
            'is it jammed, its drive too weak for a stiff gantry, or are cables swapped?',
        )

    def _end(self, now: float) -> None:
        for side in self._moves:
            assert side.follower is not None
            side.apart += self.moved(side)
            side.since = now
            side.follower.rejoin()


def _path(side: Side) -> Profile:
    assert side.follower is not None
    return side.follower.take_own_path()
