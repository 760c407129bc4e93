# SPDX-License-Identifier: Apache-2.0
"""Notices that the raw coordinates of an axis are no longer the same: its feedback jumps.

A driver that restarts begins with its own coordinates. A step of the feedback is a jump if it is
further from the steady motion than any acceleration of the axis explains. A driver may read the
position seldom and publish it often: the steps between its readings are no jumps. Positions are
in m or rad, times in s.
"""

from math import remainder

#: An axis accelerates by no more than this many times its strongest stop, `ls_dec`.
FIERCE = 100.0
#: A smaller part of a jump's least length is noise, and no motion.
NOISE = 0.02
#: A step is the lost offset if it differs from it by less than this part.
SAME = 1e-3
#: Changes of the position that are further apart are not readings of one motion, s.
READING = 0.1


class HomeWatch:
    """The newest feedback of an axis, and how it moved.

    Attributes:
        position: the newest position; None before the first sample.
    """

    __slots__ = ('position', '_changed', '_hold', '_step', '_time', '_velocity')

    def __init__(self) -> None:
        self.position: float | None = None
        self._time = self._changed = 0.0  # of the newest sample, and of the last change
        self._step = self._velocity = 0.0  # of the last change
        self._hold = 0.0  # the time between two readings

    def follow(self, time: float, position: float) -> None:
        """Take a sample without a judgement: a run moves the axis, and judges its feedback."""
        self.position, self._time, self._changed = position, time, time
        self._step = self._velocity = 0.0

    def step(
        self,
        time: float,
        position: float,
        leap: float,
        deceleration: float,
        wrap: float = 0.0,
        applied: float = 0.0,
    ) -> float:
        """Take a sample; return by how much the feedback has jumped, 0.0 if it has not.

        Args:
            time: when it was sampled.
            position: the raw position.
            leap: the least jump.
            deceleration: the strongest deceleration of the axis.
            wrap: the feedback is published modulo this distance; 0: it is not.
            applied: the offset that a driver loses when it restarts; a step of just this length
                is a jump, however long it took. 0: it has none.
        """
        before, self.position = self.position, position
        elapsed, self._time = time - self._time, time
        if before is None:
            self._changed = time
            return 0.0
        step = position - before
        if wrap:
            step = remainder(step, wrap)
        if not step:
            return 0.0
        since, self._changed = time - self._changed, time
        moving = 0.0 < since < READING and abs(self._step) > NOISE * leap
        expected = self._velocity * since if moving else 0.0
        horizon = max(elapsed, since, self._hold) if moving else max(elapsed, self._hold)
        lost = applied and not moving and abs(step - applied) < SAME * abs(applied)
        if lost or abs(step - expected) > leap + FIERCE * deceleration * horizon * horizon:
            self._step = self._velocity = 0.0
            return step
        self._step, self._velocity = step, step / since if since < READING else 0.0
        if moving:
            self._hold = since
        return 0.0
