# SPDX-License-Identifier: Apache-2.0
"""Checks every stop: how far the axis goes on behind a switch, and what comes after it."""

from collections.abc import Iterator
from math import isfinite

from ..core.limits import Limit
from ..procedures.events import Event
from ..procedures.motions import Way
from ..procedures.procedure import Row
from ..procedures.states import Input, LimitPair, Role
from ..procedures.steps import Step
from .axis_with_layout import SIDES, AxisWithLayout, Stop, ls_type_of
from .finding import Finding, Severity, down


class Overruns(AxisWithLayout):
    """Stops that take too long: into a hard stop, a limit switch, or off a short flag."""

    def check(self) -> Iterator[Finding]:
        for step, row in self.searches:
            if Event.END_DETECTED in row.on:
                yield from self.before_the_end()
                continue
            limits, events = list(self.limit_stops(row)), list(self.event_stops(step, row))
            if self._known(row.motion.way):
                yield from self.hard_stop(step, row, limits, events)
            for one in events + limits:
                yield from self.next_pair(row, one)
        yield from self.flags()

    def _known(self, way: Way) -> bool:
        """Tell whether it is known where the hard stop and the limits before it are."""
        return isfinite(self.at.stops[way]) and all(
            name in self.at.flags for name, limit in self.limits.items() if limit.way is way
        )

    def hard_stop(
        self, step: Step, row: Row, limits: list[Stop], events: list[Stop]
    ) -> Iterator[Finding]:
        """Check whether a search can end at the hard stop."""
        stop = self.at.stops[row.motion.way]
        guards = sorted((one for one in limits if one.place < stop), key=lambda one: one.place)
        sure = [one for one in events if one.place < stop]
        hit = list(self._hits(row, sure, guards))
        yield from hit
        passable = self._passable(row, sure)
        if not guards and not hit:
            yield self._unguarded(
                Severity.error if passable else Severity.warning,
                'an axis that starts beyond its reference goes'
                if passable
                else f'if {step.state} misses its switch, the axis goes',
                row,
            )
        for guard in guards[:1]:
            yield from self._coasting(row, guard)
            missed = not passable and any(one.place < guard.place for one in sure)
            yield from self._hits(
                row, [guard], guards, f'if {step.state} misses its switch, ' if missed else ''
            )

    def _hits(
        self, row: Row, firsts: list[Stop], guards: list[Stop], when: str = ''
    ) -> Iterator[Finding]:
        """Say which stops end at the hard stop, if they are what the axis comes to first.

        A limit switch that comes later may brake harder, but only one that does brake. ``when``
        tells what must fail before that happens.
        """
        way, velocity = row.motion.way, self.p.pace(row.motion.pace)[0]
        for first in firsts:
            one = min(
                [
                    first,
                    *(
                        guard._replace(overrun=guard.braked)
                        for guard in guards
                        if guard.place > first.place and guard.braked
                    ),
                ],
                key=lambda each: each.place + each.overrun(velocity),
            )
            room, overrun = self.at.stops[way] - one.place, one.overrun(velocity)
            if overrun > room:
                parameter, right, unit = self.shorter(row, one, room)
                yield self.found(
                    Severity.warning if when else Severity.error,
                    'hard-stop',
                    f'{when}at {velocity:g} m/s the axis goes on by {overrun:.4g} m after the '
                    f'{one.name}, into the hard stop {SIDES[way]}, which is {room:.4g} m away',
                    f'it takes up to {1e3 * self.delay:.3g} ms until it brakes, then the stop '
                    'itself',
                    parameter,
                    overrun,
                    right,
                    unit,
                )

    def _coasting(self, row: Row, one: Stop) -> Iterator[Finding]:
        limit = one.limit
        if limit is not None and one.coasts:
            room = self.at.stops[limit.way] - one.place
            yield self.found(
                Severity.warning,
                'coasting',
                f'{limit.input} switches the servo off, {room:.4g} m before the hard stop '
                f'{SIDES[limit.way]}',
                f'how far the axis goes on from {self.p.pace(row.motion.pace)[0]:g} m/s is up to '
                'its brake',
                ls_type_of(limit),
                room,
                'DecServoOff',
                '',
            )

    def _unguarded(self, severity: Severity, subject: str, row: Row) -> Finding:
        velocity, way = self.p.pace(row.motion.pace)[0], row.motion.way
        pair = next((limit.pair for limit in self.limits.values() if limit.way is way), None)
        if pair is None:
            right = 'switches', f'with {self.p.limit_switch(LimitPair.HARDWARE, way)}'
        else:
            right = 'ls_type' if pair is LimitPair.HARDWARE else f'{pair}_ls_type', 'Dec'
        return self.found(
            severity,
            'end-unguarded',
            f'{subject} on into the hard stop {SIDES[way]} at {velocity:g} m/s',
            'no limit switch acts before it',
            right[0],
            velocity,
            right[1],
            '',
        )

    def _passable(self, row: Row, sure: list[Stop]) -> bool:
        """Tell whether a search can begin beyond all that it waits for."""
        if row.motion.way is Way.AWAY:  # it begins at what it leaves
            return False
        if row.latches:
            return not sure or row is self.searches[0][1]
        flag = self.at.flags.get(Input.HOME_SWITCH)
        if Event.HS_RISES in row.on and flag is not None:
            return flag.leaves(Way.TOWARD) < self.at.stops[Way.TOWARD]
        return Event.HS_FALLS in row.on

    def next_pair(self, row: Row, one: Stop) -> Iterator[Finding]:
        """Check whether the overrun of a switch reaches the next limit switch."""
        velocity, way = self.p.pace(row.motion.pace)[0], row.motion.way
        further = [
            (flag.enters(way), limit)
            for name, limit in self.limits.items()
            if limit.way is way
            and self.acts(limit)
            and (flag := self.at.flags.get(name)) is not None
            and flag.enters(way) > one.place
        ]
        if not further:
            return
        place, limit = min(further, key=lambda each: each[0])
        room, overrun = place - one.place, one.overrun(velocity)
        if overrun <= room:
            return
        what = (
            f'at {velocity:g} m/s the axis goes on by {overrun:.4g} m after the {one.name} '
            f'and reaches {limit.input}, which is {room:.4g} m away'
        )
        parameter, right, unit = self.shorter(row, one, room)
        if way is Way.AWAY and one.limit is None:  # it does so in every run
            yield self.found(
                Severity.error,
                'reverse-into-limit',
                what,
                'a limit switch behind ends the run with LSTriggered',
                parameter,
                overrun,
                right,
                unit,
            )
            return
        yield self.found(
            Severity.warning,
            'next-tier',
            what,
            _meeting(one, limit),
            parameter,
            overrun,
            right,
            unit,
        )

    def before_the_end(self) -> Iterator[Finding]:
        """Check what ends the search for the mechanical end before it."""
        stop = self.at.stops[Way.TOWARD]
        for name, limit in self.limits.items():
            flag = self.at.flags.get(name)
            if (
                limit.way is Way.TOWARD
                and limit.role is Role.NORMAL
                and limit.action
                and flag is not None
                and flag.low < stop
            ):
                yield self.found(
                    Severity.error,
                    'end-behind-limit',
                    f'{name} rises {stop - flag.low:.4g} m before the mechanical end',
                    'every run ends with LSTriggered',
                    'mechanical_end_detection_ignore_ls',
                    stop - flag.low,
                    True,
                    '',
                )

    def flags(self) -> Iterator[Finding]:
        """Check that every flag is passed slowly enough to be believed."""
        p, at = self.p, self.at
        used = Input.HOME_SWITCH in p.procedure.inputs
        for name, flag in at.flags.items():
            limit = self.limits.get(name)
            if limit is None and not (used and name is Input.HOME_SWITCH):
                continue
            for step, row in self.searches:
                way, velocity = row.motion.way, p.pace(row.motion.pace)[0]
                if (limit and limit.way is not way) or flag.leaves(way) >= at.stops[way]:
                    continue
                width = flag.leaves(way) - flag.enters(way)
                if width / velocity < p.switch_debounce:
                    yield self.found(
                        Severity.warning if limit and way is Way.AWAY else Severity.error,
                        'flag-debounce',
                        f'{name} is passed in {1e3 * width / velocity:.3g} ms at {velocity:g} '
                        f'm/s, less than switch_debounce, {1e3 * p.switch_debounce:g} ms',
                        'it is never believed to be on',
                        'switch_debounce',
                        width / velocity,
                        down(0.5 * width / velocity),
                        's',
                    )
                elif (
                    way is Way.TOWARD
                    and Event.HS_FALLS in row.on
                    and name is Input.HOME_SWITCH
                    and width <= p.flag_bounce_distance
                ):
                    yield self.found(
                        Severity.error,
                        'flag-bounce',
                        f'{name} is on over {width:.4g} m; without switch_debounce a fall within '
                        f'{p.flag_bounce_distance:.4g} m (5 ms x homing_velocity_fast) of the '
                        'rise is taken for a bounce',
                        'the flag is never found, and runs end with LSTriggered',
                        'switch_debounce',
                        0.0,
                        down(0.5 * width / velocity),
                        's',
                    )
                elif self._passed(name, step, row, width, velocity):
                    yield self.found(
                        Severity.info,
                        'flag-narrow',
                        f'{name} is on over {width:.4g} m, the overrun at {velocity:g} m/s is '
                        'longer',
                        'the axis stops or turns beyond the flag; that is fine, its edges are '
                        'told apart',
                        str(name),
                        width,
                    )

    def _passed(self, name: Input, step: Step, row: Row, width: float, velocity: float) -> bool:
        """Tell whether the overrun of a flag's own edge goes past the flag."""
        place = self.at.flags[name].enters(row.motion.way)
        return any(
            one.place == place and one.overrun(velocity) > width
            for one in (*self.limit_stops(row), *self.event_stops(step, row))
        )


def _meeting(one: Stop, limit: Limit) -> str:
    """Tell what a limit switch does to an axis that a stop has not yet brought to rest."""
    if limit.action is None:
        return 'that one does not act'
    if limit.action.deceleration is not None:
        return "it then brakes with that one's action"
    if one.limit and one.limit.role is Role.NORMAL:
        return 'that one switches the servo off'
    return 'it then brakes with ls_dec'
