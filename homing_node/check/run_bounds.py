# SPDX-License-Identifier: Apache-2.0
"""Checks the bounds of a run against the way that it has to go: distances and time."""

from collections.abc import Iterator
from math import isfinite

from ..plant.geometry import Flag, place_of
from ..procedures.events import Event
from ..procedures.motions import Bound, Kind, Pace, Way
from ..procedures.procedure import Row
from ..procedures.states import Input, Role
from ..procedures.steps import HOME_SHIFT, Step
from .axis_with_layout import AxisWithLayout
from .finding import Finding, Severity, up
from .stopping import turning_distance

HS_EVENTS = (Event.HS_RISES, Event.HS_FALLS)
#: More steps than any run takes for a pass.
MOST_STEPS = 20


class RunBounds(AxisWithLayout):
    """Bounds that are too narrow for a good run."""

    def check(self) -> Iterator[Finding]:
        yield from self.reversal()
        yield from self.off_the_limit()
        yield from self.off_the_home_switch()
        yield from self.first_search()

    def _bound(self, bound: Bound) -> tuple[str, float]:
        """Return the parameter that bounds a row, and its value."""
        own: float = getattr(self.p, bound)
        return (str(bound), own) if own else (str(Bound.SEARCH), self.p.search_distance)

    def reversal(self) -> Iterator[Finding]:
        """Check the way from a limit switch back over the home switch."""
        p, at = self.p, self.at
        home, ahead = at.flags.get(Input.HOME_SWITCH), self.first_limits(Way.TOWARD)
        if not home or not ahead:
            return
        if Role.REVERSAL not in p.limits_ahead.values():
            yield from self._no_reversal(home, min(ahead))
            return
        name, bound = self._bound(Bound.LS_REVERSE)
        velocity, acceleration, deceleration = p.pace(Pace.FAST)
        met_at_rest = home.leaves(Way.TOWARD) >= min(ahead)  # only by a run that begins on it
        overrun = (
            0.0
            if p.immediate_stop_at_ls or met_at_rest
            else turning_distance(velocity, velocity, acceleration, deceleration, p.max_jerk)
        )
        edge = -home.leaves(Way.AWAY)
        least, stop = min(ahead) + overrun - edge, at.stops[Way.TOWARD]
        most = max(least, stop - edge) if isfinite(stop) else least
        if bound < least:
            yield self.found(
                Severity.error,
                'ls-reverse-bound',
                f'{name} is {bound:g} m, but from where the axis turns at the limit switch ahead '
                f'it is {least:.4g} m to where the home switch falls',
                'every reversal ends with MaxLSRevDistanceTraveled',
                name,
                bound,
                up(1.05 * most),
            )
        elif bound < most:
            yield self.found(
                Severity.warning,
                'ls-reverse-bound',
                f'{name} is {bound:g} m, but from the hard stop ahead it is {most:.4g} m to where '
                'the home switch falls',
                'a run that starts there ends with MaxLSRevDistanceTraveled',
                name,
                bound,
                up(1.05 * most),
            )

    def _no_reversal(self, home: Flag, ahead: float) -> Iterator[Finding]:
        """Find a home switch that a run may miss, where no limit switch turns the axis."""
        searched = any(event in row.on for _, row in self.searches for event in HS_EVENTS)
        towards = self.searches and self.searches[0][1].motion.way is Way.TOWARD
        if self.p.limit_reversal or not (searched and towards):
            return
        if home.leaves(Way.TOWARD) < ahead:
            yield self.found(
                Severity.warning,
                'reversal-off',
                f'limit_reversal is false, and the home switch ends {ahead - home.high:.4g} m '
                'before the limit switch ahead',
                'a run that starts between them ends with LSTriggered',
                'limit_reversal',
                'false',
                True,
                '',
            )

    def off_the_limit(self) -> Iterator[Finding]:
        """Check the way off a target limit: after its rise, and where it is on at the start."""
        target = self.at.target
        if target is None or all(row.bound is not Bound.LS_REVERSE for _, row in self.searches):
            return
        name, bound = self._bound(Bound.LS_REVERSE)
        width = min(target.high, self.at.stops[Way.TOWARD]) + target.leaves(Way.AWAY)
        least = target.enters(Way.TOWARD) + target.leaves(Way.AWAY) + self._turn_off_limit()
        right = up(1.05 * max(width, least)) if isfinite(width) else up(1.05 * least)
        if bound < least:
            yield self.found(
                Severity.error,
                'ls-reverse-bound',
                f'{name} is {bound:g} m, but from where the axis turns at the limit switch it is '
                f'{least:.4g} m to where it falls',
                'every run ends with MaxLSRevDistanceTraveled',
                name,
                bound,
                right,
            )
        elif isfinite(width) and bound < width:
            yield self.found(
                Severity.warning,
                'ls-reverse-bound',
                f'{name} is {bound:g} m, but from the far end of the limit switch it is '
                f'{width:.4g} m to where it falls',
                'a run that starts there ends with MaxLSRevDistanceTraveled',
                name,
                bound,
                right,
            )

    def _turn_off_limit(self) -> float:
        """Return how far the axis goes on where it turns to see the target limit fall."""
        rows = self.p.procedure.rows
        turns = [
            self.braking(row, then)(self.p.pace(row.motion.pace)[0])
            for _, row in self.searches
            if (then := row.on.get(Event.LS_RISES)) and rows[then].bound is Bound.LS_REVERSE
        ]
        return 0.0 if self.p.immediate_stop_at_ls else min(turns, default=0.0)

    def off_the_home_switch(self) -> Iterator[Finding]:
        """Check the way off a home switch that is on at the start."""
        home = self.at.flags.get(Input.HOME_SWITCH)
        if home is None or all(row.bound is not Bound.HS_ON_AT_START for _, row in self.searches):
            return
        name, bound = self._bound(Bound.HS_ON_AT_START)
        # On a limit switch ahead a run begins with the reversal.
        begin = min([home.high, self.at.stops[Way.TOWARD], *self.first_limits(Way.TOWARD)])
        width = begin + home.leaves(Way.AWAY)
        if isfinite(width) and bound < width:
            yield self.found(
                Severity.error,
                'hs-reverse-bound',
                f'{name} is {bound:g} m, but from the far end of the home switch it is '
                f'{width:.4g} m to where it falls',
                f'a good switch is taken for one that is stuck ({Bound(name).error})',
                name,
                bound,
                up(1.05 * width),
            )

    def first_search(self) -> Iterator[Finding]:
        """Check the longest way to the first switch, and the time that it takes."""
        p, at = self.p, self.at
        if not self.searches:
            return
        step, row = self.searches[0]
        edge = self._end_of(step, row)
        begin = min([*self.first_limits(Way.AWAY), at.stops[Way.AWAY]])
        if edge is None or not isfinite(begin):
            return
        if Event.END_DETECTED in row.on:  # the command goes on behind the end
            velocity = p.pace(row.motion.pace)[0]
            edge += p.mechanical_end_detection_pos_diff
            edge += velocity * p.mechanical_end_detection_time
        free, whole = edge + begin, edge + at.stops[Way.AWAY]
        longest = max(free, whole) if isfinite(whole) else free
        if p.search_distance < free:
            yield self.found(
                Severity.error,
                'search-bound',
                f'max_search_distance is {p.search_distance:g} m, but the first search goes up to '
                f'{free:.4g} m',
                'from the far end it ends with SearchDistanceExceeded',
                'max_search_distance',
                p.search_distance,
                up(1.05 * longest),
            )
        elif p.search_distance < longest:
            yield self.found(
                Severity.warning,
                'search-bound',
                f'max_search_distance is {p.search_distance:g} m, but from the hard stop behind '
                f'the first search goes {longest:.4g} m',
                'a run that starts there ends with SearchDistanceExceeded',
                'max_search_distance',
                p.search_distance,
                up(1.05 * longest),
            )
        yield from self._to_the_limit(longest)
        yield from self._timeout(-begin)

    def _to_the_limit(self, longest: float) -> Iterator[Finding]:
        """Check the way to the limit switch ahead, of a run that begins beyond the home switch."""
        p, home = self.p, self.at.flags.get(Input.HOME_SWITCH)
        limits = self.first_limits(Way.TOWARD)
        if home is None or not limits or Role.REVERSAL not in p.limits_ahead.values():
            return
        way = min(limits) - home.leaves(Way.TOWARD)
        if p.search_distance < way:
            yield self.found(
                Severity.error,
                'search-bound',
                f'max_search_distance is {p.search_distance:g} m, but from beyond the home switch '
                f'it is {way:.4g} m to the limit switch ahead',
                'a run that starts there ends with SearchDistanceExceeded',
                'max_search_distance',
                p.search_distance,
                up(1.05 * max(way, longest)),
            )

    def _timeout(self, begin: float) -> Iterator[Finding]:
        """Check the timeout against runs from the far end and from beyond the home switch."""
        timeout, home = self.p.timeout, self.at.flags.get(Input.HOME_SWITCH)
        if not timeout:
            return
        starts = {'the far end': begin}
        if home and Role.REVERSAL in self.p.limits_ahead.values():
            starts['beyond the home switch'] = home.leaves(Way.TOWARD)
        where, least = max(
            ((name, self.least_time(start)) for name, start in starts.items()),
            key=lambda each: each[1],
        )
        if timeout < least:
            yield self.found(
                Severity.error,
                'timeout',
                f'timeout is {timeout:g} s, but a run from {where} takes at least {least:.4g} s',
                'it ends with Timeout (0: computed)',
                'timeout',
                timeout,
                0.0,
                's',
            )

    def least_time(self, place: float) -> float:
        """Return what a run from a place of the toward frame takes at least, s.

        Ramps and overruns are left out, and all that comes after a place that is not known.
        """
        p, rows, passes, time = self.p, self.p.procedure.rows, 0, 0.0
        step, limits = p.procedure.first, self.first_limits(Way.TOWARD)
        for _ in range(MOST_STEPS * p.repeat):
            row = rows[step]
            velocity, way = p.pace(row.motion.pace)[0], row.motion.way
            if row.motion.kind is Kind.HOME:
                return time + abs(p.home_shift_distance) / velocity
            event, distance = Event.DONE, 0.0
            if row.motion.kind is Kind.FURTHER:
                distance = p.homing_reverse_distance
            elif row.motion.kind is Kind.SEARCH:
                places = {one: place_of(self.at, one, step, row) for one in row.on}
                places[Event.LIMIT_AHEAD] = min(limits, default=None)
                ahead = [
                    (known - way * place, one)
                    for one, known in places.items()
                    if one in row.on
                    and one not in (Event.HS_ON, Event.LS_ON)
                    and known is not None
                    and known >= way * place
                ]
                if not ahead:
                    return time
                distance, event = min(ahead)
            time += distance / velocity
            if event is Event.END_DETECTED:
                time += p.mechanical_end_detection_time
            place += way * distance
            passes += row.on[event] == HOME_SHIFT
            again = row.on[event] == HOME_SHIFT and passes < p.repeat
            step = row.on[Event.REPEAT if again else event]
        return time

    def _end_of(self, step: Step, row: Row) -> float | None:
        """Return where a search ends at the latest, along its way."""
        known = [
            place
            for event in row.on
            if event not in (Event.HS_ON, Event.LS_ON)
            and (place := place_of(self.at, event, step, row)) is not None
        ]
        return min(known, default=None)
