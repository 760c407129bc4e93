# SPDX-License-Identifier: Apache-2.0
"""Stamped messages of switches in, levels and edges with their own time and position out.

A level change becomes an :class:`Edge` once it has lasted for the debounce; its time is the time
of the *first* change, so that filtering costs no accuracy. edge_time.py decides which times the
messages leave open for an edge; :meth:`Edge.locate` decides where the axis was at those times, and
how exactly that is known. All positions are in the axis's *toward* frame, m or rad; all times are
in s of the caller's one clock.
"""

from itertools import pairwise
from math import inf
from typing import Protocol

from ..procedures.states import LIMIT_SWITCHES, Input
from .edge_time import MessageTimes, Opening
from .track import Track, off_line

#: Smallest uncertainty, m or rad: the rounding of what is computed.
FINEST = 1e-9
#: A change so soon after the last one is a bounce, s.
BOUNCE_TIME = 0.005


class HasLevel(Protocol):
    """An input as a run sees it; ``level`` is None while it is not known."""

    level: bool | None


class Mark:
    """A place of the axis: where an edge, a latch or a motion's end was.

    ``resolved`` is False while the feedback around the time of the edge is not yet complete: the
    position may still change. ``uncertainty`` in m.
    """

    __slots__ = ('position', 'uncertainty', 'resolved')

    def __init__(
        self, position: float, uncertainty: float = FINEST, resolved: bool = True
    ) -> None:
        self.position = position
        self.uncertainty = uncertainty
        self.resolved = resolved


class Edge(Mark):
    """A level change of a switch: when and where it was, and how the axis traveled.

    Attributes:
        input: the switch.
        rises: whether the switch went on.
        opening: the times that the messages leave open.
        time: the best estimate, s.
        speed: how fast the axis was, m/s; 0 until the edge is located.
        way: the sign of the travel at that time.
        order: what to sort edges by: their time, a limit before another switch.
    """

    __slots__ = ('input', 'opening', 'time', 'rises', 'speed', 'way', 'order')

    def __init__(
        self, switch: Input, time: float, rises: bool, doubt: float = 0.0, gap: float = 0.0
    ) -> None:
        """Create an edge that is not located yet.

        Args:
            switch: the switch.
            time: the time of the first message of the new level, s.
            rises: whether the switch went on.
            doubt: how far that time may be wrong, s.
            gap: how long before that message the edge may have happened, s.
        """
        super().__init__(0.0, resolved=False)
        self.opening = Opening(time - gap, time, doubt)
        self.input = switch
        self.time = self.opening.middle
        self.rises = rises
        self.speed = 0.0
        self.way = 0
        self.order = (self.time, switch not in LIMIT_SWITCHES)

    def locate(self, track: Track, feedback: Track | None = None) -> bool:
        """Set the position from a track; return whether the track covers the open times.

        The best estimate is the middle of the places where the axis was at the open times. An edge
        is resolved one reading later: that reading shows how the track bends behind the edge.

        Args:
            track: where the position is looked up.
            feedback: the feedback, if the track is another record (the commands): what they differ
                by is part of the uncertainty.
        """
        begin, end, _ = self.opening
        if not track.covers(end):
            self.position = track.position + track.velocity * (self.time - track.time)
            return False
        low, high = track.extent(begin, end)
        self.position = 0.5 * (low + high)
        self.uncertainty = max(0.5 * (high - low) + self._unknown(track), track.count, FINEST)
        self.resolved = track.shows_bend(end + track.doubt)
        if feedback is not None:
            self.resolved = self.resolved and feedback.covers(end)
            if feedback.covers(end):
                self.uncertainty += abs(feedback.at(self.time) - self.position)
        return True

    def _unknown(self, track: Track) -> float:
        """Return what doubtful times and the line between two readings leave open, m.

        In a doubtful time the axis has moved as far as the track shows, or as it would have at its
        speed. The line is off by no more than the largest distance of a reading from the line
        between its neighbours, where the axis stops between two readings; a parabola needs a
        quarter of that. It is also off by a count, but never by more than the axis moves between
        two readings. Noise that the axis has shown at rest counts whatever it moves.
        """
        begin, end, doubt = self.opening
        doubt += track.doubt
        if track.late_readings:
            doubt += track.period  # a reading is that much older than its first message, at most
        near = track.near(begin, end)
        steps = [abs(newer - older) for (_, newer), (_, older) in pairwise(near)]
        interval = (near[0][0] - near[-1][0]) / len(steps)  # the mean: doubted times may bunch
        bend = max(
            (off_line(*three) for three in zip(near, near[1:], near[2:], strict=False)),
            default=0.0,
        )
        grain = track.grain if track.grain < inf else 0.0
        self.speed = max(max(steps) - grain, sum(steps) / len(steps)) / interval
        moved = self.speed * doubt
        if doubt > 1.5 * interval:  # it may have been faster than it is near the edge
            low, high = track.extent(begin - doubt, min(end + doubt, track.samples[-1][0]))
            first, last = track.extent(begin, end)
            moved = max(moved, first - low, high - last)
        return moved + max(track.noise, min(max(bend, grain), max(grain, *steps)))


class Switch:
    """One input's level: polarity, debounce, age, and how its driver publishes.

    Attributes:
        level: the level that is believed; None until the first message.
        seen: the arrival of the newest message, s.
        bounces: how many changes came before the debounce, or BOUNCE_TIME, had passed since the
            last one.
        messages: when the messages came.
    """

    __slots__ = (
        'input',
        'inverted',
        'debounce',
        'level',
        'seen',
        'bounces',
        'messages',
        '_raw',
        '_pending',
        '_dropped',
        '_last',
        '_heard',
    )

    def __init__(self, switch: Input, inverted: bool = False, debounce: float = 0.0) -> None:
        self.input = switch
        self.inverted = inverted
        self.debounce = debounce
        self.level: bool | None = None
        self.seen = -1e300
        self.bounces = 0
        self.messages = MessageTimes()
        self._raw: bool = False  # the newest level, believed or not
        self._pending: Opening | None = None  # the first change since a level was believed
        self._dropped: Opening | None = None  # the last change that did not last
        self._last = self._heard = -1e300  # the newest change, and its arrival

    @property
    def signal(self) -> bool | None:
        """The newest level on the wire, None before the first message."""
        return None if self.level is None else self._raw != self.inverted

    @property
    def unsettled(self) -> bool:
        """Whether a change waits for its debounce."""
        return self._pending is not None

    def set(self, time: float, signal: bool, arrival: float, doubt: float = 0.0) -> Edge | None:
        """Take a message; return an edge that it (or the time that has passed) confirms.

        Args:
            time: when the level was published, s.
            signal: the level on the wire.
            arrival: when the message arrived, s.
            doubt: how far the time may be wrong, s.
        """
        self.seen = arrival
        level = signal != self.inverted
        if self.level is None:
            self.level = self._raw = level
            self.messages.first(time, doubt)
            return None
        confirmed = self._confirm(time - self._last)
        if level == self._raw:
            self.messages.repeat(time, doubt)
        else:
            self._raw = level
            opening = self.messages.change(time, doubt)
            if self.unsettled or time - self._last < BOUNCE_TIME:
                self.bounces += 1
            if not self.unsettled:
                goes_on = time - self._last < self.debounce  # the messages were slow, not it
                self._pending = (goes_on and self._dropped) or opening
            self._last, self._heard = time, arrival
        return confirmed or self._confirm(0.0)

    def repeat(self, time: float, arrival: float, doubt: float = 0.0) -> Edge | None:
        """Take a message with the level of the one before; the arguments are those of `set`."""
        signal = self.signal
        if signal is None:
            return None
        if self._pending is not None:
            return self.set(time, signal, arrival, doubt)
        self.seen = arrival
        self.messages.repeat(time, doubt)
        return None

    def poll(self, now: float) -> Edge | None:
        """Return the edge whose level has lasted for the debounce by now, if there is one.

        The debounce runs from the arrival of the last change, as both messages travel as long.
        """
        return self._confirm(now - self._heard)

    def turn(self, inverted: bool) -> None:
        """Use a polarity from now on; the known level is turned with it, and is no edge."""
        if inverted != self.inverted:
            self.inverted = inverted
            self._raw = not self._raw
            if self.level is not None:
                self.level = not self.level

    def set_back(self, now: float) -> None:
        """Treat the level as just received, because simulated time jumped back."""
        self.seen = now
        self._last = self._heard = -1e300
        self.messages.set_back(now)

    def _confirm(self, lasted: float) -> Edge | None:
        change = self._pending
        if change is None or lasted < self.debounce:
            return None
        self._pending = self._dropped = None
        if self._raw == self.level:
            self._dropped = change
            return None
        self.level = self._raw
        return Edge(self.input, change.end, self.level, change.doubt, change.gap)
