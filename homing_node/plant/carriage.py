# SPDX-License-Identifier: Apache-2.0
"""What moves along an axis, with the switches, the encoder index and the touch probe there.

Positions are raw positions in m (linear axis) or rad (rotary axis), times in s. Within a step the
position is the straight line between its two ends, and whatever it crosses happens at the time at
which that line crosses it.
"""

from collections.abc import Iterator, Sequence
from math import floor, inf
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


class Carriage:
    """What moves along an axis; how it is moved is up to the class that derives from it.

    ``time`` (s) and ``position`` (m or rad, the feedback and the truth) are for reading.
    """

    __slots__ = (
        '_high',
        '_index',
        '_low',
        '_probe',
        '_quiet_high',
        '_quiet_low',
        '_switches',
        'position',
        'time',
    )

    def __init__(self, layout: AxisLayout, position: float | None = None) -> None:
        """Put the carriage at `position` (default: the layout's start) at time 0.

        Raise ValueError if that is beyond a hard stop.
        """
        self._low, self._high = layout.hard_stops
        self.position = layout.start if position is None else position
        if not self._low <= self.position <= self._high:
            raise ValueError(
                f'position {self.position} is beyond the hard stops [{self._low}, {self._high}]'
            )
        self.time = 0.0
        fitted = {**layout.stays_off, **layout.switches}
        self._switches = [
            _Switch(name, fitted[name], self.position) for name in SWITCHES if name in fitted
        ]
        self._index = (
            _Index(layout.index_offset, layout.index_pitch, self.position)
            if layout.index_pitch > 0.0
            else None
        )
        self._probe = layout.touch_probe
        self._find_quiet()

    def move_switch(self, name: str, by: float) -> None:
        """Move a switch's flag by a distance, as if it slipped; no edge comes of it."""
        for switch in self._switches:
            if switch.name == name:
                switch.shift(by)
        self._find_quiet()

    def levels(self) -> dict[str, bool]:
        """Return the raw level of every switch."""
        return {switch.name: switch.level for switch in self._switches}

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
