# SPDX-License-Identifier: Apache-2.0
"""The rules of a gantry that hold in every state: they stand beside the tables (doc/gantry.md).

- No side may get further ahead of the leader than `max_skew`, compared at equal times.
- After the first side has passed its reference, the others must within `max_skew` and their
  `switch_offset`.
- A stale input or a following error of any side stops all.

Positions are in the *toward* frame, m or rad; times in s are passed in.
"""

from collections.abc import Sequence
from math import inf

from ...parameters.axis import AxisParameters
from ...procedures.events import Event
from ...procedures.motions import Kind
from ...procedures.states import Error, Input
from ..machine import Machine
from ..outcome import Failure
from ..profile import Profile
from ..signals import Mark
from ..track import Track
from .edges import GroupEdge
from .side import Side, place_at, time_at
from .switches import GantrySwitches, awaited, awaits_rise

#: A message of a switch may be so late, s: before that its edge is not missing.
LATE = 0.05
#: And it is missing once that has lasted, s: after a busy moment of the machine the feedback is
#: there before the messages of the switches.
PERSISTS = 0.02


class GantryRules:
    """The rules of one run.

    Attributes:
        largest_skew: the largest |skew| so far.
    """

    def __init__(
        self,
        parameters: AxisParameters,
        sides: tuple[Side, ...],
        switches: GantrySwitches,
        profile: Profile,
    ) -> None:
        """Keep what the rules look at.

        Args:
            parameters: those of the gantry as one axis.
            sides: all sides, the leader's first.
            switches: their switches.
            profile: the leader's path.
        """
        self._p, self._sides, self._switches, self._profile = parameters, sides, switches, profile
        self._leader, self._followers = sides[0], sides[1:]
        self._began = self._leader.track.position
        self.largest_skew = self._noticed = 0.0  # the latter is no more than the limit
        self._missed = inf  # since when a reference is missing, s
        self._watched = [
            # a side with a switch_timeout is looked at in each cycle
            (side, side.readings, side.track, -inf if p.switch_timeout else p.feedback_timeout)
            for side, p in ((one, one.parameters) for one in self._followers)
        ]

    def broken(self, machine: Machine, now: float) -> Failure | None:
        """Return the rule that is broken, None while all hold."""
        squares = machine.row.motion.kind is Kind.SQUARE  # squaring.py bounds that move
        least, command = machine.rules.least_limit, self._profile.commanded()
        leader = self._leader.track
        for side, readings, track, timeout in self._watched:
            if now - readings.arrival > timeout:
                stale = readings.stale(now)
                if stale is not None:
                    return stale._replace(seen=f'{side.name}: {stale.seen}')
            place = track.position
            if not squares and (
                track.time != leader.time
                or abs(place - leader.position - side.apart) > self._noticed
            ):
                skewed = self._skewed(side, track)
                if skewed is not None:
                    return skewed
            follower = side.follower
            assert follower is not None
            own = follower.profile
            behind = (command + follower.offset if own is None else own.present) - place
            if abs(behind) > least:
                failure = self._lagging(side, behind, machine, now)
                if failure is not None:
                    return failure
        missing = self._missing(machine) if self._switches.apart else None
        if missing is None:
            self._missed = inf
        elif self._missed == inf:
            self._missed = now
        elif now - self._missed >= PERSISTS:
            return missing
        return None

    def skew(self, side: Side, apart: float) -> tuple[float, float]:
        """Return how far a side is ahead of the leader, and how far that may be off.

        Both places are those of the newest time that both feedbacks know.

        Args:
            side: the side.
            apart: its place less the leader's where it is not ahead.
        """
        one, other = side.track, self._leader.track
        time = min(one.time, other.time)
        unsure = abs(self._profile.velocity) * sum(
            track.doubt + track.late_readings for track in (one, other)
        )
        return place_at(one, time) - place_at(other, time) - apart, unsure

    def _skewed(self, side: Side, track: Track) -> Failure | None:
        """Return why a side is too far ahead of the leader, or behind it."""
        leader = self._leader.track
        if track.time < side.since or leader.time < side.since:
            return None  # the feedback is still of the squaring move
        unsure = 0.0
        if track.time == leader.time:
            skew = track.position - leader.position - side.apart
        else:
            skew, unsure = self.skew(side, side.apart)
        size = abs(skew)
        limit = self._p.max_skew
        if size > self.largest_skew:
            self.largest_skew = size
            self._noticed = min(size, limit)
        if size <= limit or size - (unsure or self.skew(side, side.apart)[1]) <= limit:
            return None
        ahead = 'ahead of' if skew > 0.0 else 'behind'
        return Failure(
            Error.SkewTooLarge,
            f'{side.name} is {size:.6g} m {ahead} the leader, more than {limit:.6g} m (max_skew)',
            'is a side jammed, its motor off, its encoder inverted, or its cable swapped?',
        )

    def _lagging(self, side: Side, behind: float, machine: Machine, now: float) -> Failure | None:
        """Return why a side is too far behind its command."""
        track, follower = side.track, side.follower
        assert follower is not None
        then = follower.commanded(min(max(0.0, now - track.time), LATE)) - track.position
        failure = machine.rules.lags(behind, then, now, track.interval)
        return None if failure is None else failure._replace(seen=f'{side.name}: {failure.seen}')

    # ------------------------------------------------------------------------ missing references

    def _missing(self, machine: Machine) -> Failure | None:
        """Return which side has not found its switch, though another one has."""
        row = machine.row
        if row.motion.kind is not Kind.SEARCH:
            return None
        for source, captures in self._switches.captures.items():
            if captures.agree or not awaited(row, source is Input.HOME_SWITCH):
                continue
            found = captures.pending(awaits_rise(row, source is Input.HOME_SWITCH))
            if found is not None:
                edge, first, missing = found
                if captures.way != row.motion.way:
                    continue  # a bounce from before it turned
                failure = self._too_far(first, edge.time, missing, source.text, edge.uncertainty)
                if failure is not None:
                    return failure
            elif stuck := captures.stuck:
                far = abs(self._leader.track.position - self._began)
                reach = self._reach(stuck[0], self._leader)
                if far > 2.0 * reach + self._p.homing_reverse_distance:
                    return _no_switch(stuck, source.text, far, 'fall', 'others are off')
        return None

    def apart(self, group: GroupEdge[Side]) -> Failure | None:
        """Return which side has passed its switch too far from the first one."""
        track = self._leader.track
        first = min(group.parts, key=lambda side: group.parts[side].time)
        place, unsure = place_at(track, group.parts[first].time), group.parts[first].uncertainty
        for side, edge in group.parts.items():
            far = abs(place_at(track, edge.time) - place)
            if far > self._reach(side, first) + unsure + edge.uncertainty:
                return _no_switch(
                    [side], edge.input.text, far, 'change', f'{first.name} had passed its own'
                )
        return None

    def missing_latch(
        self, first: Side, mark: Mark, missing: Sequence[Side], event: Event, since: float
    ) -> Failure | None:
        """Return which side has not latched a reference, though another one has.

        A Z-pulse may come a turn later: then it is known that it is the wrong one. ``since`` is
        when the axis has turned.
        """
        time = max(since, time_at(first.track, mark.position))
        pitch = self._p.z_pulse_distance_check if event is Event.Z_PULSE else 0.0
        text = 'Z-pulse' if event is Event.Z_PULSE else 'touch probe'
        return self._too_far(first, time, missing, text, mark.uncertainty + pitch)

    def _too_far(
        self, first: Side, time: float, missing: Sequence[Side], what: str, more: float
    ) -> Failure | None:
        track = self._leader.track
        known = min(side.track.time for side in self._sides) - LATE
        if known <= time:
            return None
        far = abs(place_at(track, known) - place_at(track, time))
        late = [side for side in missing if far > self._reach(side, first) + more]
        if not late:
            return None
        return _no_switch(late, what, far, 'change', f'{first.name} has passed its own')

    def _reach(self, side: Side, first: Side) -> float:
        """Return how far apart the references of two sides may be."""
        return self._p.max_skew + abs(side.shift - first.shift)


def _no_switch(sides: Sequence[Side], what: str, far: float, change: str, other: str) -> Failure:
    names = ', '.join(side.name for side in sides)
    return Failure(
        Error.FollowerSwitchMissing,
        f'the {what} of {names} did not {change} within {far:.6g} m, though {other} '
        '(max_skew and switch_offset)',
        'is it dead or stuck, its cable cut, or its polarity wrong?',
    )
