# SPDX-License-Identifier: Apache-2.0
"""Checks the final move: from where the axis has overrun home, to home plus the shift."""

from collections.abc import Iterator
from math import isfinite

from ..core.limits import Limit
from ..plant.geometry import true_home
from ..procedures.motions import Pace, Way
from ..procedures.states import HomeType, LimitPair, Role
from ..procedures.steps import HOME_SHIFT, HOME_SHIFT_MOVE
from .axis_with_layout import SIDES, AxisWithLayout
from .finding import Finding, Severity, down, up
from .stopping import fastest, stopping_distance

#: The home types that home wherever the run begins.
ANYWHERE = (HomeType.CurrentPos, HomeType.ZPulse)


class FinalMove(AxisWithLayout):
    """A final move that goes into something."""

    def check(self) -> Iterator[Finding]:
        shift, home = self.p.home_shift_distance, true_home(self.at, self.layout.start)
        if home is not None:
            home *= self.at.sign
            for way in (Way.TOWARD, Way.AWAY):
                if any(way * move > 0.0 for move in self._moves(home)):
                    yield from self.end(way, way * home)
        if shift and self.p.home_type in ANYWHERE:
            yield from self.from_anywhere(Way.TOWARD if shift > 0.0 else Way.AWAY)

    def _moves(self, home: float = 0.0) -> list[float]:
        """Return how far the final move may go, toward: from a rest on home, and from beyond."""
        shift = self.p.home_shift_distance
        moves = [shift]
        for _, row in self.searches:
            if HOME_SHIFT in row.on.values():
                way, velocity = row.motion.way, self.p.pace(row.motion.pace)[0]
                stop = self.late(row, way * home, self.braking(row, HOME_SHIFT))
                moves.append(shift - way * stop(velocity))
        return moves

    def _limits(self, way: Way) -> list[tuple[float, Limit]]:
        """Return the limit switches that end the final move, the nearest first."""
        return sorted(
            (flag.enters(way), limit)
            for name, limit in self.limits.items()
            if limit.way is way
            and limit.blocks_home
            and (flag := self.at.flags.get(name)) is not None
        )

    def end(self, way: Way, home: float) -> Iterator[Finding]:
        """Check where a move from a known home ends; all along a way."""
        end, stop = home + way * self.p.home_shift_distance, self.at.stops[way]
        if home <= stop < end:
            yield self._beyond(
                f'the hard stop {SIDES[way]}',
                'the travel ends there',
                'shift-into-stop',
                end,
                stop,
                home,
                way,
            )
            return
        for place, limit in self._limits(way)[:1]:
            on_the_edge = end == place
            if end > place or (on_the_edge and limit.role is not Role.REFERENCE):
                yield self._beyond(
                    f'where {limit.input} rises',
                    f'the run {"may end" if on_the_edge else "ends"} with LSTriggered',
                    'shift-into-limit',
                    end,
                    place,
                    home,
                    way,
                    Severity.warning if on_the_edge else Severity.error,
                )

    def _beyond(
        self,
        where: str,
        why: str,
        check: str,
        end: float,
        bar: float,
        home: float,
        way: Way,
        severity: Severity = Severity.error,
    ) -> Finding:
        room, least = bar - home, self.p.bounce_distance
        right = way * (down(0.95 * room) if room > 0.0 else -up(1.05 * max(-room, least)))
        return self.found(
            severity,
            check,
            f'the final move ends {end - bar:.4g} m beyond {where}',
            why,
            'home_shift_distance',
            self.p.home_shift_distance,
            right,
        )

    def from_anywhere(self, way: Way) -> Iterator[Finding]:
        """Check a move that may begin anywhere."""
        p, stop, limits = self.p, self.at.stops[way], self._limits(way)
        shift = abs(p.home_shift_distance)
        if not limits:
            if isfinite(stop):
                yield self.found(
                    Severity.error,
                    'end-unguarded',
                    f'a run that begins within {shift:g} m of the hard stop {SIDES[way]} goes '
                    'into it',
                    'no limit switch acts before it',
                    'switches',
                    shift,
                    f'with {p.limit_switch(LimitPair.HARDWARE, way)}',
                )
            return
        place, limit = limits[0]
        yield self.found(
            Severity.warning,
            'shift-from-anywhere',
            f'a run that begins within {shift:g} m of where {limit.input} rises ends there',
            f'{p.home_type} homes anywhere, and the final move goes on from there',
            'home_shift_distance',
            p.home_shift_distance,
        )
        top, acceleration, deceleration = p.pace(Pace.SHIFT)
        velocity = fastest(
            lambda v: (
                stopping_distance(v, acceleration, p.max_jerk)
                + stopping_distance(v, deceleration, p.max_jerk)
            ),
            max(way * move for move in self._moves()),
            top,
        )
        overrun = self.late(p.procedure.rows[HOME_SHIFT_MOVE], place, self._stopped(limit))
        room = stop - place
        if overrun(velocity) > room > 0.0:
            yield self.found(
                Severity.error,
                'hard-stop',
                f'the final move goes on by {overrun(velocity):.4g} m after {limit.input} rises, '
                f'into the hard stop {SIDES[way]}, which is {room:.4g} m away',
                f'it has come to {velocity:.3g} m/s then',
                'home_shift_velocity',
                overrun(velocity),
                down(fastest(overrun, room, velocity)),
                'm/s',
            )
