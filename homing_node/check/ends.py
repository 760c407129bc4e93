"""Checks every stop: how far the axis goes on behind a switch, and what comes after it."""

from collections.abc import Iterator
from math import isfinite

from ..events import Event
from ..motions import Way
from ..procedures import Row, Step
from ..states import Input, Role, Tier
from .finding import Finding, Severity, down
from .placed import SIDES, Placed, Stop, ls_type_of


class Ends(Placed):
    """What stops the axis, and before what."""

    def check(self) -> Iterator[Finding]:
        for step, row in self.searches:
            if Event.END_DETECTED in row.on:
                yield from self.before_the_end()
                continue
            limits, events = list(self.limit_stops(row)), list(self.event_stops(row))
            if self._known(row.motion.way):
                yield from self.hard_stop(step, row, limits, events)
            for one in events + limits:
                yield from self.next_tier(row, one)
        yield from self.flags()

    def _known(self, way: Way) -> bool:
        """Tell whether it is known where the hard stop and the limits before it are."""
        return isfinite(self.at.stops[way]) and all(
            name in self.at.flags for name, limit in self.limits.items() if limit.way is way)

    def hard_stop(
        self, step: Step, row: Row, limits: list[Stop], events: list[Stop]
    ) -> Iterator[Finding]:
        """Check whether a search can end at the hard stop."""
        way = row.motion.way
        velocity, stop = self.p.pace(row.motion.pace)[0], self.at.stops[way]
        guards = [one for one in limits if one.place < stop]
        sure = [one for one in events if one.place < stop]
        if guards:
            best = min(guards, key=lambda one: one.place + one.overrun(velocity))
            yield from self._hit(row, best)
            yield from self._coasting(row, best)
        elif any(one.place + one.overrun(velocity) > stop for one in sure):
            yield from self._hit(row, min(sure, key=lambda one: one.place))
        elif way is Way.TOWARD and self._passable(row, sure):
            yield self._unguarded(
                Severity.error, 'an axis that starts beyond its reference goes', row)
        else:
            yield self._unguarded(
                Severity.warning, f'if {step.state} misses its switch, the axis goes', row)

    def _hit(self, row: Row, one: Stop) -> Iterator[Finding]:
        """Say where the overrun of a switch ends at the hard stop."""
        way, pace = row.motion.way, row.motion.pace
        velocity, room = self.p.pace(pace)[0], self.at.stops[way] - one.place
        overrun = one.overrun(velocity)
        if overrun > room:
            yield self.found(
                Severity.error, 'hard-stop',
                f'at {velocity:g} m/s the axis goes on by {overrun:.4g} m after the {one.name}, '
                f'into the hard stop {SIDES[way]}, which is {room:.4g} m away',
                f'it takes up to {1e3 * self.delay:.3g} ms until it brakes, then the stop itself',
                str(pace), overrun, down(one.velocity(room, velocity)), 'm/s')

    def _coasting(self, row: Row, one: Stop) -> Iterator[Finding]:
        limit = one.limit
        if (limit and limit.role is Role.NORMAL and limit.action
                and limit.action.deceleration is None):
            room = self.at.stops[limit.way] - one.place
            yield self.found(
                Severity.warning, 'coasting',
                f'{limit.input} switches the servo off, {room:.4g} m before the hard stop '
                f'{SIDES[limit.way]}',
                f'how far the axis goes on from {self.p.pace(row.motion.pace)[0]:g} m/s is up to '
                'its brake', ls_type_of(limit), room, 'DecServoOff', '')

    def _unguarded(self, severity: Severity, subject: str, row: Row) -> Finding:
        velocity, way = self.p.pace(row.motion.pace)[0], row.motion.way
        tier = next((limit.tier for limit in self.limits.values() if limit.way is way), None)
        if tier is None:
            right = 'switches', f'with {self.p.limit_switch(Tier.HARDWARE, way)}'
        else:
            right = 'ls_type' if tier is Tier.HARDWARE else f'{tier}_ls_type', 'Dec'
        return self.found(
            severity, 'end-unguarded',
            f'{subject} on into the hard stop {SIDES[way]} at {velocity:g} m/s',
            'no limit switch acts before it', right[0], velocity, right[1], '')

    def _passable(self, row: Row, events: list[Stop]) -> bool:
        """Tell whether a search toward can begin beyond all that it waits for."""
        if Event.Z_PULSE in row.on and not events:
            return True
        flag = self.at.flags.get(Input.HOME_SWITCH)
        if Event.HS_RISES in row.on and flag is not None:
            return flag.leaves(Way.TOWARD) < self.at.stops[Way.TOWARD]
        return Event.HS_FALLS in row.on

    def next_tier(self, row: Row, one: Stop) -> Iterator[Finding]:
        """Check whether the overrun of a switch reaches the next limit switch."""
        velocity, way = self.p.pace(row.motion.pace)[0], row.motion.way
        further = [(flag.enters(way), limit) for name, limit in self.limits.items()
                   if limit.way is way and self.acts(limit)
                   and (flag := self.at.flags.get(name)) is not None
                   and flag.enters(way) > one.place]
        if not further:
            return
        place, limit = min(further, key=lambda each: each[0])
        room, overrun = place - one.place, one.overrun(velocity)
        if overrun <= room:
            return
        what = (f'at {velocity:g} m/s the axis goes on by {overrun:.4g} m after the {one.name} '
                f'and reaches {limit.input}, which is {room:.4g} m away')
        slower = down(one.velocity(room, velocity))
        if way is Way.AWAY and one.limit is None:  # it does so in every run
            if slower:
                right = str(row.motion.pace), slower, 'm/s'
            else:
                right = 'homing_reverse_distance', down(room), 'm'
            yield self.found(
                Severity.error, 'reverse-into-limit', what,
                'a limit switch behind ends the run with LSTriggered', right[0], overrun,
                right[1], right[2])
            return
        off = (limit.action is not None and limit.action.deceleration is None
               and limit.role is Role.NORMAL)
        yield self.found(
            Severity.warning, 'next-tier', what,
            'that one switches the servo off' if off else "it then brakes with that one's action",
            str(row.motion.pace), overrun, slower, 'm/s')

    def before_the_end(self) -> Iterator[Finding]:
        """Check what ends the search for the mechanical end before it."""
        stop = self.at.stops[Way.TOWARD]
        for name, limit in self.limits.items():
            flag = self.at.flags.get(name)
            if (limit.way is Way.TOWARD and limit.role is Role.NORMAL and limit.action
                    and flag is not None and flag.low < stop):
                yield self.found(
                    Severity.error, 'end-behind-limit',
                    f'{name} rises {stop - flag.low:.4g} m before the mechanical end',
                    'every run ends with LSTriggered', 'mechanical_end_detection_ignore_ls',
                    stop - flag.low, True, '')

    def flags(self) -> Iterator[Finding]:
        """Check that every flag is passed slowly enough to be believed."""
        p, at = self.p, self.at
        used = Input.HOME_SWITCH in p.procedure.inputs
        for name, flag in at.flags.items():
            limit = self.limits.get(name)
            if limit is None and not (used and name is Input.HOME_SWITCH):
                continue
            width = flag.high - flag.low
            for _, row in self.searches:
                way, velocity = row.motion.way, p.pace(row.motion.pace)[0]
                if (limit and limit.way is not way) or flag.leaves(way) >= at.stops[way]:
                    continue
                if width / velocity < p.switch_debounce:
                    yield self.found(
                        Severity.error, 'flag-debounce',
                        f'{name} is passed in {1e3 * width / velocity:.3g} ms at {velocity:g} '
                        f'm/s, less than switch_debounce, {1e3 * p.switch_debounce:g} ms',
                        'it is never believed to be on', 'switch_debounce', width / velocity,
                        down(0.5 * width / velocity), 's')
                elif self._passed(name, row, width, velocity):
                    yield self.found(
                        Severity.info, 'flag-narrow',
                        f'{name} is {width:.4g} m wide, the overrun at {velocity:g} m/s is longer',
                        'the axis stops or turns beyond the flag; that is fine, its edges are '
                        'told apart', str(name), width)

    def _passed(self, name: Input, row: Row, width: float, velocity: float) -> bool:
        """Tell whether the overrun of a flag's own edge goes past the flag."""
        place = self.at.flags[name].enters(row.motion.way)
        return any(one.place == place and one.overrun(velocity) > width
                   for one in (*self.limit_stops(row), *self.event_stops(row)))
