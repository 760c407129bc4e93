"""Stamped samples in, levels and edges with positions at their own time out.

A level change becomes an :class:`Edge` once it has lasted for the debounce; its time is that of
the *first* change, so filtering costs no accuracy. Its position is the feedback interpolated at
that time. All positions are in the axis's *toward* frame, all times in the caller's one clock, s.
"""

import math
from collections import deque
from itertools import islice

from .states import LIMIT_SWITCHES, Input

#: Samples kept of a track: 1 s of a 2 kHz feedback.
TRACK_LENGTH = 2048


class Track:
    """A recorded position over time, at most TRACK_LENGTH samples."""

    __slots__ = ('samples', 'time', 'position')

    def __init__(self) -> None:
        self.samples: deque[tuple[float, float]] = deque(maxlen=TRACK_LENGTH)
        self.time = -1e300
        self.position = 0.0

    def append(self, time: float, position: float) -> bool:
        """Record a sample; one that is not newer than the last is dropped (returns False)."""
        if time <= self.time:
            return False
        self.samples.append((time, position))
        self.time, self.position = time, position
        return True

    def mirror(self) -> None:
        """Turn the track into the other frame."""
        self.samples = deque(((t, -p) for t, p in self.samples), maxlen=TRACK_LENGTH)
        self.position = -self.position

    @property
    def interval(self) -> float:
        """The time between the last two samples, s; 0 while there are none."""
        return self.samples[-1][0] - self.samples[-2][0] if len(self.samples) > 1 else 0.0

    @property
    def velocity(self) -> float:
        """The mean velocity between the last two samples; 0 while there are none."""
        if len(self.samples) < 2:
            return 0.0
        (t0, p0), (t1, p1) = self.samples[-2], self.samples[-1]
        return (p1 - p0) / (t1 - t0)

    def around(self, time: float) -> tuple[tuple[float, float], tuple[float, float]] | None:
        """Return the two samples that enclose a time; None where it is not yet covered.

        A time before the record gives the two oldest samples.
        """
        if time > self.time or len(self.samples) < 2:
            return None
        newer = self.samples[-1]
        for older in islice(reversed(self.samples), 1, None):
            if older[0] <= time:
                return older, newer
            newer = older
        return self.samples[0], self.samples[1]

    def extreme(self, since: float, way: int) -> float:
        """Return the time of the sample that went furthest in a way, of those since a time.

        The first of several; the time itself where there is no sample since.
        """
        found, furthest = since, -math.inf
        for time, position in reversed(self.samples):
            if time < since:
                break
            if position * way >= furthest:
                found, furthest = time, position * way
        return found

    def step_before(self, time: float) -> float:
        """Return the size of the last change of position before a time, 0 where there is none."""
        newer = None
        for at, position in reversed(self.samples):
            if at <= time:
                if newer is not None and position != newer:
                    return abs(newer - position)
                newer = position
        return 0.0

    def spread(self, since: float) -> float:
        """Return max - min of the positions not older than a time."""
        low = high = self.position
        for time, position in reversed(self.samples):
            if time < since:
                break
            low, high = min(low, position), max(high, position)
        return high - low


class Mark:
    """A place of the axis: where an edge, a latch or a motion's end was.

    ``resolved`` is False while the position is extrapolated because the feedback does not yet
    cover the time of the edge. ``uncertainty`` in m.
    """

    __slots__ = ('position', 'uncertainty', 'resolved')

    def __init__(
        self, position: float, uncertainty: float = 0.0, resolved: bool = True
    ) -> None:
        self.position = position
        self.uncertainty = uncertainty
        self.resolved = resolved


class Edge(Mark):
    """A level change: which input, when, which way it went, where, and how the axis traveled.

    ``way`` is the sign of the travel at the edge's time, ``order`` what to sort edges by: their
    time, a limit before another switch.
    """

    __slots__ = ('input', 'time', 'rises', 'way', 'order')

    def __init__(self, switch: Input, time: float, rises: bool) -> None:
        super().__init__(0.0, resolved=False)
        self.input = switch
        self.time = time
        self.rises = rises
        self.way = 0
        self.order = (time, switch not in LIMIT_SWITCHES)

    def locate(self, track: Track) -> bool:
        """Set the position from a track; return whether the track covers the edge's time."""
        found = track.around(self.time)
        if found is None:
            self.position = track.position + track.velocity * (self.time - track.time)
            return False
        (t0, p0), (t1, p1) = found
        self.position = p0 + (p1 - p0) * ((max(self.time, t0) - t0) / (t1 - t0))
        self.uncertainty = abs(p1 - p0) or track.step_before(t0)
        self.resolved = True
        return True


class Switch:
    """One input's level: polarity, debounce, age.

    ``level`` is None until the first message; ``bounces`` counts the changes that the debounce
    swallowed.
    """

    __slots__ = ('input', 'inverted', 'debounce', 'level', 'seen', 'bounces',
                 '_raw', '_first', '_last', '_heard')

    def __init__(self, switch: Input, inverted: bool = False, debounce: float = 0.0) -> None:
        self.input = switch
        self.inverted = inverted
        self.debounce = debounce
        self.level: bool | None = None
        self.seen = -1e300  # arrival of the newest message
        self.bounces = 0
        self._raw: bool = False  # the newest level, believed or not
        self._first: float | None = None  # the first change since the level was last believed
        self._last = self._heard = 0.0  # the newest change, and its arrival

    @property
    def unsettled(self) -> bool:
        """Whether a change waits for its debounce."""
        return self._first is not None

    def set(self, time: float, signal: bool, arrival: float) -> Edge | None:
        """Take a message; return an edge that it (or the time that has passed) confirms."""
        self.seen = arrival
        level = signal != self.inverted
        if self.level is None:
            self.level = self._raw = level
            return None
        confirmed = self._confirm(time - self._last)
        if level != self._raw:
            self._raw = level
            self._last, self._heard = time, arrival
            if self._first is None:
                self._first = time
            else:
                self.bounces += 1
        return confirmed or self._confirm(0.0)

    def poll(self, now: float) -> Edge | None:
        """Return the edge whose level has lasted for the debounce by now, if there is one.

        Counted from the arrival of the last change: a bounce travels as long as what it follows.
        """
        return self._confirm(now - self._heard)

    def _confirm(self, lasted: float) -> Edge | None:
        if self._first is None or lasted < self.debounce:
            return None
        first, self._first = self._first, None
        if self._raw == self.level:
            return None
        self.level = self._raw
        return Edge(self.input, first, self.level)

    def forget(self) -> None:
        """Become unknown: the publisher is gone."""
        self.level, self._first = None, None
