# SPDX-License-Identifier: Apache-2.0
"""Checks what bounds a run: distances, time, the index, following errors."""

from collections.abc import Iterator
from math import isfinite

from ..plant.geometry import Flag, arming_edge, index_pulse, place_of
from ..procedures.events import Event
from ..procedures.motions import Bound, Kind, Pace, Way
from ..procedures.procedure import Row
from ..procedures.states import LATCHES, HomeType, IndexMarginAction, Input, Role
from ..procedures.steps import HOME_SHIFT, Step
from .finding import Finding, Severity, up
from .placed import SIDES, Placed
from .stopping import turning_distance

MARGINS = {
    IndexMarginAction.none: Severity.info,
    IndexMarginAction.Warn: Severity.warning,
    IndexMarginAction.Fail: Severity.error,
}
#: A drive that hears nothing for this many cycles must not stop.
QUIET_CYCLES = 3
#: More steps than any run takes for a pass.
MOST_STEPS = 20


class Bounds(Placed):
    """What no run can keep."""

    def check(self) -> Iterator[Finding]:
        yield from self.reversal()
        yield from self.off_the_limit()
        yield from self.off_the_home_switch()
        yield from self.first_search()
        yield from self.index()
        yield from self.probe()
        yield from self.following()
        yield from self.drive()

    def _bound(self, bound: Bound) -> tuple[str, float]:
        """Return the parameter that bounds a row, and its value."""
        own: float = getattr(self.p, bound)
        return (str(bound), own) if own else (str(Bound.SEARCH), self.p.search_distance)

    def reversal(self) -> Iterator[Finding]:
        """Check the way from a limit switch back over the home switch."""
        p, at = self.p, self.at
        home, ahead = at.flags.get(Input.HOME_SWITCH), self.first_limits(Way.TOWARD)
        if Role.REVERSAL not in p.procedure.limits_ahead.values() or not home or not ahead:
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

    def off_the_limit(self) -> Iterator[Finding]:
        """Check the way off a target limit that is on at the start."""
        target = self.at.target
        if target is None or all(row.bound is not Bound.LS_REVERSE for _, row in self.searches):
            return
        name, bound = self._bound(Bound.LS_REVERSE)
        width = min(target.high, self.at.stops[Way.TOWARD]) + target.leaves(Way.AWAY)
        if isfinite(width) and bound < width:
            yield self.found(
                Severity.warning,
                'ls-reverse-bound',
                f'{name} is {bound:g} m, but from the far end of the limit switch it is '
                f'{width:.4g} m to where it falls',
                'a run that starts there ends with MaxLSRevDistanceTraveled',
                name,
                bound,
                up(1.05 * width),
            )

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
        yield from self._timeout(-begin)

    def _timeout(self, begin: float) -> Iterator[Finding]:
        """Check the timeout against runs from the far end and from beyond the home switch."""
        timeout, home = self.p.timeout, self.at.flags.get(Input.HOME_SWITCH)
        starts = {'the far end': begin}
        if home and Role.REVERSAL in self.p.procedure.limits_ahead.values():
            starts['beyond the home switch'] = home.leaves(Way.TOWARD)
        where, least = max(
            ((name, self.least_time(start)) for name, start in starts.items()),
            key=lambda each: each[1],
        )
        if timeout and timeout < least:
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

    # -------------------------------------------------------------------------------------- index

    def index(self) -> Iterator[Finding]:
        """Check where the index pulses are against the edge that arms them."""
        p, at, pitch = self.p, self.at, self.layout.index_pitch
        if Event.Z_PULSE not in p.procedure.events or not pitch:
            return
        count, expected = max(1, p.multiple_z_pulse), p.z_pulse_distance_check
        if (
            count > 1
            and expected
            and (abs(pitch - expected) > expected * p.z_pulse_distance_tolerance)
        ):
            yield self.found(
                Severity.error,
                'z-pulse-check',
                f'the index pitch is {pitch:g} m, z_pulse_distance_check is {expected:g} m',
                'every run ends with ZPulseDistanceCheckError',
                'z_pulse_distance_check',
                expected,
                pitch,
            )
        for step, row in self.searches:
            if Event.Z_PULSE not in row.on:
                continue
            armed, last = arming_edge(at, step, row), index_pulse(at, step, row)
            needed = pitch if count > 1 else 0.0
            if armed and last is not None:
                distance = last - (count - 1) * pitch - armed[1]
                yield from self._margin(armed[0], distance - p.z_pulse_arm_delay, row.motion.way)
                yield from self._comes_first(row, last, count)
                needed = max(distance, needed)
            yield from self._pulse_bound(needed)
        if p.home_type is HomeType.ZPulse and isfinite(at.span) and at.span > pitch:
            yield self.found(
                Severity.warning,
                'index-ambiguous',
                f'an index pulse comes every {pitch:g} m, the axis is {at.span:.4g} m long',
                'which pulse becomes home depends on where the run starts',
                'home_type',
                at.span / pitch,
                self.with_home_switch(HomeType.HSZPulse),
                '',
            )

    def _margin(self, name: str, distance: float, way: Way) -> Iterator[Finding]:
        """Check how far behind the arming edge the pulse comes: best is half a pitch."""
        pitch, least = self.layout.index_pitch, self.p.index_margin
        part = distance / pitch
        if least <= part <= 1.0 - least:
            return
        move = self.raw(distance - pitch / 2, way)
        severity = MARGINS[self.p.index_margin_action]
        if severity is Severity.error and name == Event.END_DETECTED:
            severity = Severity.warning  # no run fails for it: only an edge is judged
        yield self.found(
            severity,
            'index-margin',
            f'the index pulse comes {100 * part:.3g} % of a pitch after "{name}"',
            f'with a little drift of the switch, home is off by a pitch of {pitch:g} m; move the '
            f'switch by {abs(move):.4g} m toward {"positive" if move > 0.0 else "negative"}, or '
            'count pulses only further on',
            'z_pulse_arm_delay',
            part,
            float(f'{self.p.z_pulse_arm_delay + (distance - pitch / 2) % pitch:.4g}'),
        )

    def _comes_first(self, row: Row, pulse: float, count: int) -> Iterator[Finding]:
        """Check that the pulse comes before what ends the search."""
        way = row.motion.way
        text = f'index pulse {count}' if count > 1 else 'the index pulse'
        stop = self.at.stops[way]
        if pulse >= stop:
            yield self.found(
                Severity.error,
                'index-unreachable',
                f'{text} is {pulse - stop:.4g} m beyond the hard stop {SIDES[way]}',
                'no run comes to it',
            )
            return
        for one in self.limit_stops(row):
            if one.limit is not None and pulse >= one.place:
                yield self.found(
                    Severity.error,
                    'index-unreachable',
                    f'{text} is {pulse - one.place:.4g} m beyond where {one.limit.input} rises',
                    'no run comes to it',
                )

    def _pulse_bound(self, needed: float) -> Iterator[Finding]:
        bound, pitch = self.p.max_z_pulse_distance, self.layout.index_pitch
        furthest = pitch + self.p.z_pulse_arm_delay
        if bound and bound < furthest:
            always = bound < needed
            yield self.found(
                Severity.error if always else Severity.warning,
                'z-pulse-bound',
                f'max_z_pulse_distance is {bound:g} m, but a pulse can be {furthest:g} m away',
                f'{"every" if always else "a"} run ends with ZPulseNotFound',
                'max_z_pulse_distance',
                bound,
                up(1.2 * furthest),
            )

    def probe(self) -> Iterator[Finding]:
        """Check that the touch probe is in reach."""
        p, at = self.p, self.at
        if Event.TOUCH_PROBE not in p.procedure.events or at.probe is None:
            return
        end = min([*self.first_limits(Way.TOWARD), at.stops[Way.TOWARD]])
        home = at.flags.get(Input.HOME_SWITCH)
        if at.probe >= end:
            yield self.found(
                Severity.error,
                'probe-unreachable',
                f'the touch probe is {at.probe - end:.4g} m beyond what ends the search before it',
                'no run comes to it',
                'touch_probe',
                at.raw(at.probe),
            )
        elif p.home_type is HomeType.TouchProbe:
            yield self.found(
                Severity.warning,
                'probe-passed',
                f'the touch probe is at {at.raw(at.probe):g}, the search for it goes one way',
                'a run that starts beyond it does not find it',
                'home_type',
                None,
                self.with_home_switch(HomeType.HSTouchProbe),
                '',
            )
        elif home and p.home_type is HomeType.HSTouchProbe:
            yield from self._probe_before(home, at.probe)

    def _probe_before(self, home: Flag, probe: float) -> Iterator[Finding]:
        """Check a touch probe that comes before the home switch, which is sought first."""
        p = self.p
        off = next(each for each in self.searches if each[1].motion.way is Way.AWAY)
        overrun = next(self.event_stops(*off)).overrun(p.homing_velocity_fast)
        gap = -home.leaves(Way.AWAY) - probe
        if gap > p.homing_reverse_distance:
            found = gap < overrun
            yield self.found(
                Severity.warning if found else Severity.error,
                'probe-unreachable',
                f'the touch probe is {gap:.4g} m before the home switch, the search for it begins '
                f'{p.homing_reverse_distance:g} m before it (homing_reverse_distance)',
                'only the overrun makes up for it' if found else 'no run finds it',
                'homing_reverse_distance',
                p.homing_reverse_distance,
                up(1.1 * gap),
            )
        if p.repeat > 1:
            yield from self._probe_again(home, probe)

    def _probe_again(self, home: Flag, probe: float) -> Iterator[Finding]:
        """Check that the axis is on the home switch when it turns for the next pass."""
        row = next(row for _, row in self.searches if Event.TOUCH_PROBE in row.on)
        turn, room = self.braking(row, row.on[Event.REPEAT]), home.low - probe
        velocity = self.p.homing_velocity_slow
        if turn(velocity) < room:
            never = self.late(row, probe, turn)(velocity) < room
            yield self.found(
                Severity.error if never else Severity.warning,
                'repeat-off-switch',
                f'the touch probe is {room:.4g} m before the home switch, which the axis must '
                'have reached when it turns for the next pass',
                'it waits for the home switch to fall: the run ends at the limit switch behind',
                'repeat',
                float(self.p.repeat),
                1.0,
                '',
            )

    # --------------------------------------------------------------------------- following errors

    def following(self) -> Iterator[Finding]:
        """Check how far the axis stays behind against what is allowed."""
        p, lag = self.p, self.layout.lag
        if not lag or not self.searches:
            return
        age = self.timing.feedback_age
        velocity = max(p.pace(row.motion.pace)[0] for row in p.procedure.rows.values())
        behind, limit = velocity * lag, p.following_error_limit
        if limit < behind + velocity * age and not p.homes_on_mechanical_end:
            always = limit < behind
            yield self.found(
                Severity.error if always else Severity.warning,
                'following-error',
                f'at {velocity:g} m/s the axis stays {behind:.3g} m behind and its feedback may '
                f'be {velocity * age:.3g} m old, but following_error is {limit:.3g} m',
                f'{"every" if always else "a"} run ends with FollowingError',
                'following_error',
                behind,
                up(2 * (behind + velocity * age)),
            )
        if p.wrong_direction_limit < behind:
            yield self.found(
                Severity.warning,
                'wrong-direction',
                f'wrong_direction_distance is {p.wrong_direction_limit:.3g} m, less than the '
                f'{behind:.3g} m that the axis stays behind',
                'its way is judged before it follows',
                'wrong_direction_distance',
                p.wrong_direction_limit,
                up(2 * behind),
            )
        if p.open_loop_homing and p.procedure.inputs - set(LATCHES):
            yield self.found(
                Severity.warning,
                'open-loop',
                'open_loop_homing takes the commanded position at an edge, but the axis is up to '
                f'{behind:.3g} m behind it',
                'home is off by that, and depends on the velocity',
                'open_loop_homing',
                behind,
                False,
            )
        if p.homes_on_mechanical_end:
            yield from self._end_too_early(lag, age)

    def _end_too_early(self, lag: float, age: float) -> Iterator[Finding]:
        slow, limit = self.p.homing_velocity_slow, self.p.mechanical_end_detection_pos_diff
        normal = slow * (lag + age)
        if limit < 2 * normal:
            always = limit <= slow * lag
            yield self.found(
                Severity.error if always else Severity.warning,
                'end-too-early',
                f'at {slow:g} m/s the axis stays {normal:.3g} m behind, but '
                f'mechanical_end_detection_pos_diff is {limit:.3g} m',
                f'the end {"is" if always else "may be"} detected anywhere on the way',
                'mechanical_end_detection_pos_diff',
                limit,
                up(4 * normal),
            )

    def drive(self) -> Iterator[Finding]:
        """Check that the drive waits for the next setpoint for long enough."""
        quiet, period = self.layout.command_timeout, 1.0 / self.timing.update_rate
        if quiet and quiet < QUIET_CYCLES * period:
            yield self.found(
                Severity.warning,
                'drive-timeout',
                f'the drive stops after {quiet:g} s without a setpoint, they come every '
                f'{period:g} s',
                'a late setpoint stops the axis',
                'command_timeout',
                quiet,
                up(QUIET_CYCLES * period),
                's',
            )
