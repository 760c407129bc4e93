# SPDX-License-Identifier: Apache-2.0
"""Checks where the index pulses and the touch probe are: in reach, and far enough from an edge."""

from collections.abc import Iterator
from math import isfinite

from ..plant.geometry import Flag, arming_edge, entries, index_pulse
from ..procedures.events import Event
from ..procedures.motions import Way
from ..procedures.procedure import Row
from ..procedures.states import HomeType, IndexMarginAction, Input
from .axis_with_layout import SIDES, AxisWithLayout
from .finding import Finding, Severity, up

MARGINS = {
    IndexMarginAction.none: Severity.info,
    IndexMarginAction.Warn: Severity.warning,
    IndexMarginAction.Fail: Severity.error,
}


class IndexAndProbe(AxisWithLayout):
    """Index pulses and touch probes that a run cannot reach, or takes for others."""

    def check(self) -> Iterator[Finding]:
        yield from self.index()
        yield from self.probe()

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
                fastest = max(p.pace(before.motion.pace)[0] for before, _ in entries(p, step))
                unsure = 0.5 * fastest * self.layout.switch_period
                yield from self._margin(
                    armed[0], distance - p.z_pulse_arm_delay, row.motion.way, unsure
                )
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

    def _margin(self, name: str, distance: float, way: Way, unsure: float) -> Iterator[Finding]:
        """Check how far behind the arming edge the pulse comes: best is half a pitch.

        ``unsure`` is how exactly that edge is known if its switch is polled, m.
        """
        pitch = self.layout.index_pitch
        least = max(self.p.index_margin, unsure / pitch)
        part = distance / pitch
        if least <= part <= 1.0 - least:
            return
        polled = ''
        if unsure > self.p.index_margin * pitch:
            polled = f' (the switch is read {self.layout.switch_rate:g} times a second)'
        move = self.raw(distance - pitch / 2, way)
        severity = MARGINS[self.p.index_margin_action]
        if severity is Severity.error and name == Event.END_DETECTED:
            severity = Severity.warning  # no run fails for it: only an edge is judged
        yield self.found(
            severity,
            'index-margin',
            f'the index pulse comes {100 * part:.3g} % of a pitch after "{name}"{polled}',
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
