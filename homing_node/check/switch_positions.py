# SPDX-License-Identifier: Apache-2.0
"""Checks where the switches are: wiring, polarity, order along the axis."""

from collections.abc import Iterator
from math import isfinite

from ..core.limits import Limit
from ..plant.geometry import Flag
from ..procedures.events import Event
from ..procedures.motions import Way
from ..procedures.states import LIMIT_PAIRS, LIMIT_SWITCHES, Input, LimitPair, LSDirection
from .axis_with_layout import SIDES, AxisWithLayout
from .finding import Finding, Severity, up
from .stopping import stopping_distance

#: By what part travel may differ from the distance between the hard stops.
TRAVEL_TOLERANCE = 0.1
#: Parts of the free travel that lie beyond the home switch: it is at the other end.
FAR, VERY_FAR = 0.5, 0.9


class SwitchPositions(AxisWithLayout):
    """Switches that are wired, read or placed wrongly."""

    def check(self) -> Iterator[Finding]:
        yield from self.wiring()
        yield from self.polarity()
        yield from self.travel()
        for pair in LimitPair:
            yield from self.limit_pair(pair)
        yield from self.limit_flags()
        yield from self.home_switch()

    def wiring(self) -> Iterator[Finding]:
        """Check what is fitted against what is wired."""
        p, layout = self.p, self.layout
        fitted = {Input(name) for name in layout.switches}
        if layout.index_pitch:
            fitted.add(Input.Z_PULSE)
        if layout.touch_probe is not None:
            fitted.add(Input.TOUCH_PROBE)
        for name in sorted(fitted - set(p.switches)):
            limit = name in LIMIT_SWITCHES
            yield self.found(
                Severity.warning if limit else Severity.info,
                'fitted-unwired',
                f'{name} is fitted, but not in switches',
                'a limit switch that nobody reads stops nothing' if limit else 'it is not read',
                'switches',
                None,
                f'with {name}',
            )
        needed = set(p.procedure.inputs)
        if p.procedure.target:
            needed.add(p.limit_switch(p.procedure.target, Way.TOWARD))
        for name in p.inputs:
            if name not in fitted and name is not Input.SERVO_ENABLED:
                yield self.found(
                    Severity.warning if name in needed else Severity.info,
                    'place-unknown',
                    f'{name} is in switches, but the layout does not tell where it is',
                    f'{p.home_type} cannot home without it'
                    if name in needed
                    else 'what depends on it is not checked',
                    str(name),
                )

    def polarity(self) -> Iterator[Finding]:
        """Check that every switch is read the right way round."""
        for name in self.p.inputs:
            flag = self.layout.switches.get(name)
            inverted = self.p.inverted(name)
            if flag is not None and flag.inverted is not inverted:
                parameter = f'invert_{name}_polarity'.replace('home_switch', 'hs').replace(
                    'limit_switch', 'ls'
                )
                yield self.found(
                    Severity.error,
                    'polarity',
                    f'{name} is normally {"closed" if flag.inverted else "open"}, but '
                    f'{parameter} is {str(inverted).lower()}',
                    'it is read the wrong way round',
                    parameter,
                    str(inverted).lower(),
                    flag.inverted,
                    '',
                )

    def travel(self) -> Iterator[Finding]:
        """Check travel against the hard stops."""
        travel, span = self.p.travel, self.at.span
        if isfinite(span) and abs(travel - span) > TRAVEL_TOLERANCE * span:
            yield self.found(
                Severity.warning,
                'travel',
                f'travel is {travel:g} m, but the hard stops are {span:.6g} m apart',
                'the bounds of every search follow from travel',
                'travel',
                travel,
                float(f'{span:.6g}'),
            )

    def limit_pair(self, pair: LimitPair) -> Iterator[Finding]:
        """Check a pair of limit switches: which is where, and that the axis fits between them."""
        p, at = self.p, self.at
        switches = {way: p.limit_switch(pair, way) for way in (Way.TOWARD, Way.AWAY)}
        wired = {
            way: at.flags[name]
            for way, name in switches.items()
            if name in p.inputs and name in at.flags
        }
        ahead, behind = wired.get(Way.TOWARD), wired.get(Way.AWAY)
        swapped = (
            ahead.high < behind.low
            if ahead and behind
            else any(self._at_other_end(flag, way) for way, flag in wired.items())
        )
        if swapped:
            reverse = p.ls_direction is LSDirection.Reverse
            yield self.found(
                Severity.error,
                'limits-swapped',
                f'the {pair} limit switches are at the wrong ends',
                'the axis meets the one that should guard the other end',
                'ls_direction',
                str(p.ls_direction),
                str(LSDirection.Normal if reverse else LSDirection.Reverse),
                '',
            )
        elif ahead and behind and ahead.low <= behind.high and behind.low <= ahead.high:
            yield self.found(
                Severity.error,
                'limits-overlap',
                f'the {pair} limit switches are on together over '
                f'{min(ahead.high, behind.high) - max(ahead.low, behind.low):.4g} m',
                'a run that comes there ends with LimitsBothOn',
                str(LIMIT_PAIRS[pair][0]),
                behind.high - ahead.low,
            )

    def _at_other_end(self, flag: Flag, way: Way) -> bool:
        """Tell whether a lone limit's flag covers the hard stop at the wrong end."""
        other = -self.at.stops[Way(-way)]
        return (
            isfinite(other)
            and flag.enters(way) <= other <= flag.leaves(way)
            and flag.leaves(way) < self.at.stops[way]
        )

    def limit_flags(self) -> Iterator[Finding]:
        """Check every limit switch against the hard stop behind it."""
        for name, limit in self.limits.items():
            flag = self.at.flags.get(name)
            stop = self.at.stops[limit.way]
            if flag is None or not isfinite(stop):
                continue
            rises, falls = flag.enters(limit.way), flag.leaves(limit.way)
            if rises >= stop:
                yield self.found(
                    Severity.error,
                    'limit-beyond-stop',
                    f'{name} rises {rises - stop:.4g} m beyond the hard stop {SIDES[limit.way]}',
                    'the axis never comes to it',
                    str(name),
                    self.raw(rises, limit.way),
                    self.raw(stop - self._room_for(limit), limit.way),
                )
            elif falls < stop:
                yield self.found(
                    Severity.warning,
                    'limit-momentary',
                    f'{name} falls again {stop - falls:.4g} m before the hard stop '
                    f'{SIDES[limit.way]}',
                    'an axis that starts beyond it sees no limit switch and goes on to the hard '
                    'stop: make the flag reach up to there',
                    str(name),
                    stop - falls,
                    self.raw(stop, limit.way),
                )

    def _room_for(self, limit: Limit) -> float:
        """Return how far before the hard stop a limit switch has to be."""
        velocity = max(
            (
                self.p.pace(row.motion.pace)[0]
                for _, row in self.searches
                if row.motion.way is limit.way
            ),
            default=0.0,
        )
        return (
            up(velocity * self.delay + stopping_distance(velocity, self.p.ls_dec, self.p.max_jerk))
            if velocity
            else 0.0
        )

    def home_switch(self) -> Iterator[Finding]:
        """Check the home switch against the ends, and the direction in which it is sought."""
        p, at = self.p, self.at
        flag = at.flags.get(Input.HOME_SWITCH)
        if flag is None or Input.HOME_SWITCH not in p.procedure.inputs:
            return
        ahead, behind = self.first_limits(Way.TOWARD), self.first_limits(Way.AWAY)
        begin = min([*behind, at.stops[Way.AWAY]])
        behind_it = f'the {"limit switch" if behind else "hard stop"} behind'
        if p.homes_on_mechanical_end:
            first = (flag.leaves if flag.high >= at.stops[Way.TOWARD] else flag.enters)(Way.AWAY)
            if flag.low > at.stops[Way.TOWARD]:
                yield self._misplaced('the hard stop ahead', flag.low)
            elif first >= begin:
                yield self._misplaced(behind_it, -first)
            return
        edge = flag.low if Event.HS_RISES in self.searches[0][1].on else flag.leaves(Way.TOWARD)
        end = min([*ahead, at.stops[Way.TOWARD]])
        if edge >= end:
            yield self._misplaced(f'the {"limit switch" if ahead else "hard stop"} ahead', edge)
        elif flag.leaves(Way.AWAY) >= begin:
            yield self._misplaced(behind_it, flag.low)
        elif ahead and isfinite(begin):
            part = (end - edge) / (end + begin)
            if part > FAR:
                yield self.found(
                    Severity.warning if part > VERY_FAR else Severity.info,
                    'direction',
                    f'home_direction is {p.home_direction}, but the home switch is nearer to the '
                    'other end',
                    f'from {100 * part:.0f} % of the travel the axis meets the limit switch first '
                    'and has to turn',
                    'home_direction',
                    part,
                    'Negative' if at.sign > 0 else 'Positive',
                    '',
                )

    def _misplaced(self, where: str, place: float) -> Finding:
        return self.found(
            Severity.error,
            'home-switch-place',
            f'the edge of home_switch lies beyond {where}',
            'no run finds it; is home_direction right?',
            str(Input.HOME_SWITCH),
            self.at.raw(place),
        )
