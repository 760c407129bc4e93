# SPDX-License-Identifier: Apache-2.0
"""The plant: simulated axes with switches, an encoder index and a touch probe.

Pure Python without a clock: time is passed in as steps. Positions are raw positions in m (linear
axis) or rad (rotary axis), times in s. Within a step the feedback is the straight line between
its two ends, and whatever it crosses happens at the time at which that line crosses it.
"""

from collections.abc import Iterator, Sequence
from math import copysign, exp, floor, inf
from operator import itemgetter

from ..course import Happening
from ..procedures.states import Input
from .layout import SWITCHES, AxisLayout, SwitchLayout

NOTHING: tuple[Happening, ...] = ()


class _Switch:
    """The state of one switch, and the positions at which it can change."""

    __slots__ = ('inverted', 'leave_high', 'leave_low', 'name', 'on', 'on_from', 'on_to')

    def __init__(self, name: str, layout: SwitchLayout, position: float) -> None:
        self.name = name
        self.inverted = layout.inverted
        self.on_from, self.on_to = layout.on_from, layout.on_to
        self.leave_low = layout.on_from - layout.hysteresis
        self.leave_high = layout.on_to + layout.hysteresis
        self.on = layout.on_from <= position <= layout.on_to

    def shift(self, by: float) -> None:
        """Move the flag."""
        self.on_from += by
        self.on_to += by
        self.leave_low += by
        self.leave_high += by

    @property
    def level(self) -> bool:
        """The raw level."""
        return self.on is not self.inverted

    def quiet(self, position: float) -> tuple[float, float]:
        """Return the open interval around `position` in which the switch does not change."""
        if self.on:
            return self.leave_low, self.leave_high
        return (-inf, self.on_from) if position < self.on_from else (self.on_to, inf)

    def changes(self, before: float, after: float) -> Iterator[tuple[float, bool]]:
        """Move from `before` to `after` and yield (position, on) of each change, in order."""
        up = after > before
        if not self.on:
            if up and before < self.on_from <= after:
                yield self.on_from, True
            elif not up and after <= self.on_to < before:
                yield self.on_to, True
            else:
                return
            self.on = True
        if up and after > self.leave_high:
            yield self.leave_high, False
        elif not up and after < self.leave_low:
            yield self.leave_low, False
        else:
            return
        self.on = False


class _Index:
    """The marks of an encoder index, latched when the axis comes to them, moving either way.

    A mark belongs to the motion that arrives at it: turning on it, and stopping on it and going
    on, latch it once.
    """

    __slots__ = ('above', 'below', 'offset', 'pitch')

    def __init__(self, offset: float, pitch: float, position: float) -> None:
        self.offset, self.pitch = offset, pitch
        k = floor((position - offset) / pitch)
        while self.mark(k) <= position:
            k += 1
        while self.mark(k - 1) > position:
            k -= 1
        self.above = k  # numbers of the next marks above and below the position ...
        self.below = k - 1 if self.mark(k - 1) < position else k - 2  # ... not the one on it

    def mark(self, k: int) -> float:
        return self.offset + k * self.pitch

    def quiet(self, position: float) -> tuple[float, float]:
        """Return the open interval around `position` without a mark; empty while on a mark."""
        if self.above - self.below > 1:
            return position, position
        return self.mark(self.below), self.mark(self.above)

    def crossed(self, before: float, after: float) -> Iterator[float]:
        """Move from `before` to `after` and yield the marks come to, in order."""
        way = 1 if after > before else -1
        k = self.above if way > 0 else self.below
        while before < (mark := self.mark(k)) <= after or after <= mark < before:
            yield mark
            k += way
        last = k - 2 * way if self.mark(k - way) == after else k - way
        self.above, self.below = (k, last) if way > 0 else (last, k)


class SimulatedAxis:
    """One axis: a drive that follows setpoints, and what its inputs see of it.

    `time` (s), `position` (the feedback, which is also the true position), `command` (what the
    drive follows at this time) and `told` (the last setpoint), those in m or rad, are for reading.
    """

    __slots__ = (
        '_decay',
        '_decay_dt',
        '_goal',
        '_high',
        '_index',
        '_lag',
        '_low',
        '_own_stop',
        '_probe',
        '_quiet_high',
        '_quiet_low',
        '_rate',
        '_remaining',
        '_servo',
        '_silence',
        '_switches',
        '_timeout',
        '_velocity',
        'command',
        'position',
        'time',
        'told',
    )

    def __init__(self, layout: AxisLayout, position: float | None = None) -> None:
        """Put the axis at rest at `position` (default: the layout's start) at time 0.

        Raise ValueError if that is beyond a hard stop.
        """
        self._low, self._high = layout.hard_stops
        self.position = layout.start if position is None else position
        if not self._low <= self.position <= self._high:
            raise ValueError(
                f'position {self.position} is beyond the hard stops [{self._low}, {self._high}]'
            )
        self.time = 0.0
        self.command = self._goal = self.position
        self._remaining = 0.0  # s until the command is at the goal, coming at this rate
        self._rate = 0.0
        self.told = self.position
        self._velocity = 0.0  # at the goal: what the drive goes on with when no setpoint comes
        self._lag = layout.lag
        self._timeout, self._own_stop = layout.command_timeout, layout.stop_dec
        self._silence = 0.0  # s since a setpoint ended, while the drive goes on without the next
        self._decay_dt, self._decay = 0.0, 1.0  # exp(-dt / lag), for the dt it was last needed for
        self._servo = True
        self._switches = [
            _Switch(name, layout.switches[name], self.position)
            for name in SWITCHES
            if name in layout.switches
        ]
        self._index = (
            _Index(layout.index_offset, layout.index_pitch, self.position)
            if layout.index_pitch > 0.0
            else None
        )
        self._probe = layout.touch_probe
        self._find_quiet()

    def follow(self, position: float, over: float = 0.0, velocity: float | None = None) -> None:
        """Take the newest setpoint, in m or rad; a drive whose servo is off ignores it.

        The command goes linearly from where it is to `position` over `over` s; 0 = at once.
        `velocity`, per s, is the axis's at `position`; None: what leads there from the setpoint
        before. It is not how fast the command comes, which makes up for a setpoint that is late.
        """
        if not self._servo or self.timed_out:
            return
        if velocity is None:
            velocity = (position - self.told) / over if over > 0.0 else 0.0
        self._goal = self.told = position
        self._velocity = velocity
        self._silence = 0.0
        if over > 0.0:
            self._remaining = over
            self._rate = (position - self.command) / over
        else:
            self._remaining = self._rate = 0.0
            self.command = position

    def servo(self, on: bool) -> None:
        """Switch the servo; while it is off a brake holds the axis where it is."""
        self._servo = on
        self._silence = 0.0
        if not on:
            self.command = self._goal = self.told = self.position
            self._remaining = self._rate = self._velocity = 0.0

    @property
    def timed_out(self) -> bool:
        """Whether the drive has stopped, or is stopping, because no setpoint came."""
        return self._silence > self._timeout > 0.0

    @property
    def enabled(self) -> bool:
        """Whether the drive heeds setpoints, as it reports it."""
        return self._servo and not self.timed_out

    def move_switch(self, name: str, by: float) -> None:
        """Move a switch's flag by a distance, as if it slipped; no edge comes of it."""
        for switch in self._switches:
            if switch.name == name:
                switch.shift(by)
        self._find_quiet()

    def levels(self) -> dict[str, bool]:
        """Return the raw level of every switch."""
        return {switch.name: switch.level for switch in self._switches}

    def step(self, dt: float) -> Sequence[Happening]:
        """Advance by `dt` s (> 0) and return what happened, in the order of time."""
        start = self.time
        before = self.position
        self.time = start + dt
        if self._timeout and self._velocity and self._remaining <= 0.0:
            self._go_on(dt)
        if self._remaining > 0.0:
            after = self._along_ramp(dt)
        elif before == self.command:
            return NOTHING
        else:
            after = self._settled(dt)
        if after > self._high:
            after = self._high
        elif after < self._low:
            after = self._low
        self.position = after
        if self._quiet_low < after < self._quiet_high or after == before:
            return NOTHING
        return self._happenings(start, dt, before, after)

    def _go_on(self, dt: float) -> None:
        """Make the drive's own setpoint for a step, because none has come."""
        self._silence += dt
        before = self._velocity
        if self.timed_out:
            self._velocity = copysign(max(0.0, abs(before) - self._own_stop * dt), before)
        self._rate = 0.5 * (before + self._velocity)
        self._goal += self._rate * dt
        self._remaining = dt

    def _settled(self, dt: float) -> float:
        """Return the feedback after `dt` s of the command standing still."""
        if not self._lag:
            return self.command
        if dt != self._decay_dt:
            self._decay_dt, self._decay = dt, exp(-dt / self._lag)
        return self.command + (self.position - self.command) * self._decay

    def _along_ramp(self, dt: float) -> float:
        """Return the feedback after `dt` s that begin with the command on its way."""
        offset = self.position - self.command
        ramp = dt if dt < self._remaining else self._remaining
        self._remaining -= ramp
        self.command = self._goal - self._rate * self._remaining
        if not self._lag:
            return self.command
        if ramp != self._decay_dt:
            self._decay_dt, self._decay = ramp, exp(-ramp / self._lag)
        drag = self._rate * self._lag  # what the feedback comes to stay behind
        after = self.command - drag + (offset + drag) * self._decay
        if ramp < dt:
            after = self.command + (after - self.command) * exp((ramp - dt) / self._lag)
        return after

    def _happenings(
        self, start: float, dt: float, before: float, after: float
    ) -> Sequence[Happening]:
        found: list[tuple[float, str, bool | float]] = []
        for switch in self._switches:
            for position, on in switch.changes(before, after):
                found.append((position, switch.name, on is not switch.inverted))
        if self._index is not None:
            for mark in self._index.crossed(before, after):
                found.append((mark, Input.Z_PULSE.value, mark))
        probe = self._probe
        if probe is not None and (before < probe <= after or after <= probe < before):
            found.append((probe, Input.TOUCH_PROBE.value, probe))
        self._find_quiet()
        if len(found) > 1:  # the sort is stable: what is at one position stays in order
            found.sort(key=itemgetter(0), reverse=after < before)
        length = after - before
        return [
            Happening(start + dt * ((position - before) / length), name, value, position)
            for position, name, value in found
        ]

    def _find_quiet(self) -> None:
        """Find the open interval around the position in which nothing happens."""
        position = self.position
        quiet = [switch.quiet(position) for switch in self._switches]
        if self._index is not None:
            quiet.append(self._index.quiet(position))
        if self._probe is not None:
            quiet.append(_quiet_around(self._probe, position))
        self._quiet_low = max((low for low, _ in quiet), default=-inf)
        self._quiet_high = min((high for _, high in quiet), default=inf)


def _quiet_around(mark: float, position: float) -> tuple[float, float]:
    """Return the open interval around `position` without the one mark; empty while on it."""
    if position == mark:
        return position, position
    return (-inf, mark) if position < mark else (mark, inf)
