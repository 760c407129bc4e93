# SPDX-License-Identifier: Apache-2.0
"""The recorded position of an axis over time: what was read, and how exactly.

A driver may publish faster than it reads the position. Such a record is a staircase: while the
axis moves, an unchanged position is an old reading, published once more. The record keeps the
readings only. Positions are in the *toward* frame, m or rad; times in s of one clock.
"""

from collections import deque
from itertools import islice, pairwise
from math import inf
from statistics import fmean

#: Readings kept of a track: 1 s of a 2 kHz feedback.
TRACK_LENGTH = 2048
#: An unchanged position is a new reading after this time: the axis stands, though it is told to
#: move, s. Slower than 20 Hz no driver reads.
OLDEST_READING = 0.08
#: A doubt about the time of a sample counts for the edges near it: so long, s.
DOUBT_LASTS = 0.1
#: Times between readings that the usual one is taken from.
HOLDS = 7
#: Readings that are further apart than this many messages make a staircase.
STAIRCASE = 1.5
#: Steps that show whether positions are multiples of a count, and how exactly they are.
COUNTED_STEPS, COUNT_TOLERANCE = 8, 0.01

#: A time and a position.
Sample = tuple[float, float]


class Track:
    """A recorded position over time, at most TRACK_LENGTH readings.

    Attributes:
        samples: the readings, the oldest first.
        time: when the newest message was sampled, s; it may repeat the newest reading.
        position: the newest position.
        grain: the smallest step ever seen: of a coarse encoder its count, of any other next to
            nothing.
        period: time between the newest two messages, s; 0 while there are none.
        doubt: how far the times of the newest readings may be wrong, s.
        noise: how far a reading may be off, as the axis at rest has shown.
    """

    __slots__ = (
        'samples',
        'time',
        'position',
        'grain',
        'period',
        'doubt',
        'noise',
        '_hold',
        '_holds',
        '_changed',
        '_moved',
        '_doubted',
    )

    def __init__(self) -> None:
        self.samples: deque[Sample] = deque(maxlen=TRACK_LENGTH)
        self.time = -1e300
        self.position = self.doubt = self.period = self.noise = 0.0
        self.grain = inf
        self._holds: deque[float] = deque(maxlen=HOLDS)
        self._hold = 0.0  # the usual one of them, s; 0 while there are none
        self._changed: float | None = None  # the newest change while the axis was told to move
        self._doubted = -1e300  # the newest sample with the present doubt
        self._moved = -1e300  # the newest sample taken while the axis was told to move

    def append(
        self, time: float, position: float, doubt: float = 0.0, moving: bool = False
    ) -> bool:
        """Record a sample.

        Args:
            time: when the position was sampled, s.
            position: the position.
            doubt: how far the time may be wrong, s.
            moving: whether the axis is told to move.

        Returns:
            Whether the sample is newer than the newest one; else it is dropped.
        """
        if time <= self.time:
            return False
        known = bool(self.samples)
        step = abs(position - self.position)
        if known:
            self.period = time - self.time
            if 0.0 < step < self.grain:
                self.grain = step
        if doubt or self.doubt:
            self._note_doubt(time, doubt)
        self.time = time
        if moving:
            self._moved = time
        if known and not step and self._is_old_reading(time, moving):
            return True
        if not moving:
            self._changed = None
        elif step:
            if self._changed is not None and step > STAIRCASE * self.grain:
                self._holds.append(time - self._changed)
                self._hold = sorted(self._holds)[len(self._holds) // 2]
            self._changed = time
        self.samples.append((time, position))
        self.position = position
        return True

    def _note_doubt(self, time: float, doubt: float) -> None:
        """Keep the largest doubt until readings have been certain for DOUBT_LASTS."""
        if doubt >= self.doubt or time - self._doubted > DOUBT_LASTS:
            self.doubt, self._doubted = doubt, time

    def _is_old_reading(self, time: float, moving: bool) -> bool:
        """Return whether an unchanged position was read before."""
        since = time - self.samples[-1][0]
        if moving:
            return since < OLDEST_READING
        return time - self._moved < 2.0 * self.late_readings and since < OLDEST_READING

    def restart(self) -> None:
        """Forget when the samples were; where the last one was stays known."""
        self.samples.clear()
        self.time = self._moved = -1e300
        self.period, self._changed = 0.0, None
        self.append(-1e299, self.position)

    def mirror(self) -> None:
        """Turn the track into the other frame."""
        self.samples = deque(((t, -p) for t, p in self.samples), maxlen=TRACK_LENGTH)
        self.position = -self.position

    @property
    def late_readings(self) -> float:
        """The time between two readings of a staircase, s; 0 if each message is a new reading."""
        return self._hold if self._hold > STAIRCASE * self.period else 0.0

    @property
    def interval(self) -> float:
        """The time between two readings, s; 0 while there are none.

        Before the first motion shows it, it is at least the age of the newest reading.
        """
        if self._holds or not self.samples:
            return self.late_readings or self.period
        return max(self.period, self.time - self.samples[-1][0])

    @property
    def count(self) -> float:
        """The count of the encoder; 0 if the newest steps do not show one."""
        newest = islice(reversed(self.samples), COUNTED_STEPS * 4)
        steps = [abs(b[1] - a[1]) for a, b in pairwise(newest) if b[1] != a[1]][:COUNTED_STEPS]
        if len(steps) < COUNTED_STEPS:
            return 0.0
        counts = [step / self.grain for step in steps]
        if all(abs(n - round(n)) < COUNT_TOLERANCE for n in counts):
            return self.grain
        return 0.0

    @property
    def velocity(self) -> float:
        """The mean velocity between the last two readings; 0 while there are none."""
        if len(self.samples) < 2:
            return 0.0
        (t0, p0), (t1, p1) = self.samples[-2], self.samples[-1]
        return (p1 - p0) / (t1 - t0)

    def drift(self, lasts: float) -> float:
        """Return the mean velocity of the newest `lasts` s, from the means of its two halves.

        Noise hardly counts. The record may be shorter; 0 if it says nothing.
        """
        halves: tuple[list[Sample], list[Sample]] = ([], [])
        first = max(self.samples[0][0], self.time - lasts) if self.samples else self.time
        middle = 0.5 * (first + self.time)
        for sample in reversed(self.samples):
            if sample[0] < first:
                break
            halves[sample[0] < middle].append(sample)
        if not all(halves):
            return 0.0
        (t1, p1), (t0, p0) = (tuple(map(fmean, zip(*half, strict=True))) for half in halves)
        return (p1 - p0) / (t1 - t0)

    def jump(self, lasts: float, count: int, fastest: float, noise: float) -> float:
        """Return how far the newest position is from one that the axis cannot have left; else 0.

        Args:
            lasts: how old the readings are that are looked at, s.
            count: how many readings are looked at even if they are older.
            fastest: how fast the axis can be, m/s.
            noise: what does not count, m.
        """
        for n, (time, position) in enumerate(reversed(self.samples)):
            age, apart = self.time - time, self.position - position
            if age > lasts and n >= count:
                break
            if abs(apart) > fastest * age + noise:
                return apart
        return 0.0

    def note_noise(self, lasts: float) -> None:
        """Learn the noise from the newest `lasts` s, in which the axis was at rest.

        That it drifts is no noise: it is the largest distance of a reading from the line between
        its neighbours.
        """
        rest = [sample for sample in self.samples if sample[0] > self.time - lasts]
        if len(rest) > 2:
            triples = zip(rest, rest[1:], rest[2:], strict=False)
            self.noise = max(off_line(*three) for three in triples)

    def covers(self, time: float) -> bool:
        """Return whether there are readings on both sides of a time."""
        return len(self.samples) > 1 and time <= self.samples[-1][0]

    def shows_bend(self, time: float) -> bool:
        """Return whether there is one more reading behind a time that the track covers."""
        return self.samples[-2][0] >= time

    def at(self, time: float) -> float:
        """Return the position at a time that the track covers, interpolated.

        A time before the record gives its oldest position.
        """
        newer = self.samples[-1]
        for older in islice(reversed(self.samples), 1, None):
            if older[0] <= time:
                (t0, p0), (t1, p1) = older, newer
                return p0 + (p1 - p0) * ((time - t0) / (t1 - t0))
            newer = older
        return newer[1]

    def extent(self, begin: float, end: float) -> tuple[float, float]:
        """Return the lowest and the highest position between two times that the track covers."""
        low = high = self.at(end)
        for time, position in reversed(self.samples):
            if time <= begin:
                break
            if time < end:
                low, high = min(low, position), max(high, position)
        first = self.at(begin)
        return min(low, first), max(high, first)

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

    def near(self, begin: float, end: float) -> list[Sample]:
        """Return the readings between two times and two more on each side, newest first."""
        newer: deque[Sample] = deque(maxlen=2)
        between: list[Sample] = []
        older: list[Sample] = []
        for sample in reversed(self.samples):
            if sample[0] > end:
                newer.append(sample)
            elif sample[0] > begin:
                between.append(sample)
            elif len(older) < 2:
                older.append(sample)
            else:
                break
        return [*newer, *between, *older]

    def spread(self, since: float) -> float:
        """Return max - min of the positions not older than a time."""
        low = high = self.position
        for time, position in reversed(self.samples):
            if time < since:
                break
            low, high = min(low, position), max(high, position)
        return high - low


def off_line(first: Sample, middle: Sample, last: Sample) -> float:
    """Return how far a reading is from the line between its neighbours."""
    (t0, p0), (t1, p1), (t2, p2) = first, middle, last
    return abs(p1 - p0 - (p2 - p0) * ((t1 - t0) / (t2 - t0)))


def _vertex(first: Sample, *others: Sample) -> float:
    """Return when the parabola through three samples turns; of two samples the first's time."""
    if len(others) == 1:
        return first[0]
    (t0, p0), (t1, p1), (t2, p2) = first, *others
    v1, v2 = (p1 - p0) / (t1 - t0), (p2 - p1) / (t2 - t1)
    if v1 == v2:
        return t1
    return 0.5 * (t0 + t1 + (t2 - t0) * v1 / (v1 - v2))
