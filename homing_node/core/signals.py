# SPDX-License-Identifier: Apache-2.0
"""Stamped samples in, levels and edges with positions at their own time out.

A level change becomes an :class:`Edge` once it has lasted for the debounce; its time is that of
the *first* change, so filtering costs no accuracy. Its position is the feedback interpolated at
that time. All positions are in the axis's *toward* frame, all times in the caller's one clock, s.
"""

from collections import deque
from itertools import islice, pairwise
from math import inf

from ..procedures.states import LIMIT_SWITCHES, Input

#: Samples kept of a track: 1 s of a 2 kHz feedback.
TRACK_LENGTH = 2048

#: Smallest uncertainty, m or rad: the rounding of what is computed.
FINEST = 1e-9
#: A change so soon after the last one is a bounce, s.
BOUNCE_TIME = 0.005

#: A time and a position.
Sample = tuple[float, float]
#: Of a level: its time, how far that may be wrong, and whether it is a stamp.
Change = tuple[float, float, bool]


class Track:
    """A recorded position over time, at most TRACK_LENGTH samples.

    ``grain`` is the smallest step ever seen: of a coarse encoder its count, of any other next to
    nothing. ``doubted`` is the time of the newest sample whose time may be wrong, ``doubt`` by how
    much, s.
    """

    __slots__ = ('samples', 'time', 'position', 'grain', 'doubted', 'doubt')

    def __init__(self) -> None:
        self.samples: deque[Sample] = deque(maxlen=TRACK_LENGTH)
        self.time = self.doubted = -1e300
        self.position = self.doubt = 0.0
        self.grain = inf

    def append(self, time: float, position: float, doubt: float = 0.0) -> bool:
        """Record a sample; one that is not newer than the last is dropped (returns False)."""
        if time <= self.time:
            return False
        step = abs(position - self.position)
        if 0.0 < step < self.grain and self.samples:
            self.grain = step
        if doubt:
            self.doubted, self.doubt = time, doubt
        self.samples.append((time, position))
        self.time, self.position = time, position
        return True

    def restart(self) -> None:
        """Forget when the samples were; where the last one was stays known."""
        self.samples.clear()
        self.time = self.doubted = -1e300
        self.append(-1e299, self.position)

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

    def around(self, time: float) -> tuple[Sample, Sample] | None:
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

    def traveled(self, time: float, since: float, way: int) -> int | None:
        """Return the sign of the travel at a time, of a track that turns to a way.

        ``since`` is when it was told to turn; until the furthest sample since then it travels on.
        The turning point lies where a parabola through that sample and its neighbours has its
        vertex; None until the feedback has turned (a coarse encoder shows equal samples before).
        """
        samples = list(self.samples)
        at = furthest = len(samples) - 1
        while at >= 0 and samples[at][0] >= since:
            if (samples[at][1] - samples[furthest][1]) * way < 0.0:
                furthest = at
            at -= 1
        if samples[furthest][0] < since:
            return -way
        if furthest:
            before = samples[furthest - 1]
            if (before[1] - samples[furthest][1]) * way < 0.0:
                return way  # it has not yet turned from that way, when it was told so before
            if time <= before[0]:
                return -way
        if furthest == len(samples) - 1:
            return None
        turn = _vertex(*samples[max(0, furthest - 1) : furthest + 2])
        return way if time > turn else -way

    def near(self, time: float) -> list[Sample]:
        """Return the samples around a time, two on each side as far as they are there."""
        newer: deque[Sample] = deque(maxlen=2)
        older: list[Sample] = []
        for sample in reversed(self.samples):
            if sample[0] > time:
                newer.append(sample)
            elif len(older) < 2:
                older.append(sample)
            else:
                break
        return [*newer, *older]

    def spread(self, since: float) -> float:
        """Return max - min of the positions not older than a time."""
        low = high = self.position
        for time, position in reversed(self.samples):
            if time < since:
                break
            low, high = min(low, position), max(high, position)
        return high - low


def _vertex(first: Sample, *others: Sample) -> float:
    """Return when the parabola through three samples turns; of two samples the first's time."""
    if len(others) == 1:
        return first[0]
    (t0, p0), (t1, p1), (t2, p2) = first, *others
    v1, v2 = (p1 - p0) / (t1 - t0), (p2 - p1) / (t2 - t1)
    if v1 == v2:
        return t1
    return 0.5 * (t0 + t1 + (t2 - t0) * v1 / (v1 - v2))


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
    """A level change: which input, when, which way it went, where, and how the axis traveled.

    ``way`` is the sign of the travel at the edge's time, ``order`` what to sort edges by: their
    time, a limit before another switch. ``doubt`` is how far its time may be wrong, s;
    ``stamped``: that is a stamp that is believed.
    """

    __slots__ = ('input', 'time', 'rises', 'way', 'order', 'doubt', 'stamped')

    def __init__(
        self, switch: Input, time: float, rises: bool, doubt: float = 0.0, stamped: bool = True
    ) -> None:
        super().__init__(0.0, resolved=False)
        self.doubt, self.stamped = doubt, stamped
        self.input = switch
        self.time = time
        self.rises = rises
        self.way = 0
        self.order = (time, switch not in LIMIT_SWITCHES)

    def locate(self, track: Track) -> bool:
        """Set the position from a track; return whether the track covers the edge's time.

        Resolved is an edge one sample later: that shows how the track bends behind it.
        """
        found = track.around(self.time)
        if found is None:
            self.position = track.position + track.velocity * (self.time - track.time)
            return False
        (t0, p0), (t1, p1) = found
        self.position = p0 + (p1 - p0) * ((max(self.time, t0) - t0) / (t1 - t0))
        self.uncertainty = self._uncertainty(track)
        self.resolved = track.samples[-2][0] >= self.time
        return True

    def _uncertainty(self, track: Track) -> float:
        """Return what the edge's time and the line between two samples leave open, m.

        The line is off by half of the largest second difference of the samples around it, where
        the axis stops within an interval; a parabola needs a quarter of that. With stamps that are
        believed it is at most the travel of one feedback interval (of a coarse encoder one count).
        """
        near = track.near(self.time)
        steps = [abs(newer - older) for (_, newer), (_, older) in pairwise(near)]
        interval = (near[0][0] - near[-1][0]) / len(steps)  # the mean: doubted times may bunch
        bend = (
            max(
                (
                    abs(a - 2.0 * b + c)
                    for (_, a), (_, b), (_, c) in zip(near, near[1:], near[2:], strict=False)
                ),
                default=0.0,
            )
            / 2.0
        )
        grain = track.grain if track.grain < inf else 0.0
        doubt = track.doubt if track.doubted >= near[-1][0] else 0.0
        known = max(steps) / interval * (self.doubt + doubt) + bend + grain
        if self.stamped and not doubt:
            known = min(known, max(grain, *steps))
        return max(known, FINEST)


class Switch:
    """One input's level: polarity, debounce, age.

    ``level`` is None until the first message; ``bounces`` counts the changes that
    came before the debounce, or BOUNCE_TIME, had passed since the last one.
    """

    __slots__ = (
        'input',
        'inverted',
        'debounce',
        'level',
        'seen',
        'bounces',
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
        self.seen = -1e300  # arrival of the newest message
        self.bounces = 0
        self._raw: bool = False  # the newest level, believed or not
        self._pending: Change | None = None  # the first one since the level was last believed
        self._dropped: Change | None = None  # the last one that came to nothing
        self._last = self._heard = -1e300  # the newest change, and its arrival

    @property
    def unsettled(self) -> bool:
        """Whether a change waits for its debounce."""
        return self._pending is not None

    def set(
        self,
        time: float,
        signal: bool,
        arrival: float,
        doubt: float = 0.0,
        stamped: bool = True,
    ) -> Edge | None:
        """Take a message; return an edge that it (or the time that has passed) confirms.

        ``doubt`` and ``stamped`` are those of an edge.
        """
        self.seen = arrival
        level = signal != self.inverted
        if self.level is None:
            self.level = self._raw = level
            return None
        confirmed = self._confirm(time - self._last)
        if level != self._raw:
            self._raw = level
            if self.unsettled or time - self._last < BOUNCE_TIME:
                self.bounces += 1
            if not self.unsettled:
                goes_on = time - self._last < self.debounce  # the messages were slow, not it
                self._pending = (goes_on and self._dropped) or (time, doubt, stamped)
            self._last, self._heard = time, arrival
        return confirmed or self._confirm(0.0)

    def poll(self, now: float) -> Edge | None:
        """Return the edge whose level has lasted for the debounce by now, if there is one.

        Counted from the arrival of the last change: a bounce travels as long as what it follows.
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
        """Take the level as told now: the times before come once more."""
        self.seen = now
        self._last = self._heard = -1e300

    def _confirm(self, lasted: float) -> Edge | None:
        change = self._pending
        if change is None or lasted < self.debounce:
            return None
        self._pending = self._dropped = None
        if self._raw == self.level:
            self._dropped = change
            return None
        self.level = self._raw
        time, doubt, stamped = change
        return Edge(self.input, time, self.level, doubt, stamped)
