# SPDX-License-Identifier: Apache-2.0
"""When an edge was: which times the messages of a switch leave open. doc/edges.md explains it.

A driver publishes a switch in one of three ways, and no message says which:

* on change: the first message of the new level is sent at the edge;
* on change, and it repeats the level at times that have nothing to do with the edges (heartbeat);
* it reads the input in a loop and publishes each reading (polled): the edge lies somewhere between
  the last message of the old level and the first message of the new level.

Until something shows that a driver publishes on change, the edge may lie anywhere in that gap,
which is true of all three. Two things show it:

1. A change comes much earlier after the message before it than repeats follow each other: no loop
   has waited for it. Seen from the other side, a repeat comes that much too early after a change.
2. A message comes after a longer silence than any loop leaves.

A change of such a driver that comes when the next repeat is due is open all the same: the message
of the change may be lost, and the repeat shows the new level. The changes of a polled switch
always come when a repeat is due: a wrong proof (a loop that was held up) does no harm later.

Times are in s of the receiver's clock. No clock is read here.
"""

from collections import deque
from statistics import median
from typing import NamedTuple

#: Intervals between repeats that are remembered.
REMEMBERED = 128
#: Fewer intervals than this say nothing; with this many one early change is proof at once, ...
ENOUGH, MANY = 3, 8
#: ... if they are not shorter than this, s: a quick loop that was held up catches up as early.
SLOW_REPEATS = 0.05
#: A change is early within this part of the shortest interval.
EARLY = 0.5
#: A change is due, as a repeat would be, from this part of the shortest interval on.
DUE = 0.9
#: Polling at 5 Hz with 30 % jitter and a lost message leaves no longer gap, s.
LONGEST_GAP = 0.6
#: Repeats have ceased if a gap is this many times as long as their interval.
CEASED = 10.0


class Opening(NamedTuple):
    """The times that messages leave open for an edge, s.

    Attributes:
        begin: the edge was not earlier; the last message of the old level if the switch may be
            polled.
        end: the edge was not later; the first message of the new level.
        doubt: how far both times may be wrong.
    """

    begin: float
    end: float
    doubt: float = 0.0

    @property
    def middle(self) -> float:
        """The best estimate of the edge's time."""
        return self.end - 0.5 * self.gap

    @property
    def gap(self) -> float:
        """How long the edge may have happened before its first message, s."""
        return self.end - self.begin


class MessageTimes:
    """When the messages of one switch came, and how its driver publishes them.

    Attributes:
        on_change: whether the driver has proved that it publishes on change.
    """

    __slots__ = ('on_change', '_newest', '_doubt', '_changed', '_beat', '_intervals')

    def __init__(self) -> None:
        self.on_change = False
        self._intervals: deque[float] = deque(maxlen=REMEMBERED)
        self._beat = self._newest = -1e300
        self._doubt = 0.0
        self._changed = True  # the newest message did not repeat the one before

    def copy(self) -> 'MessageTimes':
        """Return the same times, for one switch alone."""
        found = MessageTimes()
        found.on_change, found._newest, found._doubt = self.on_change, self._newest, self._doubt
        found._changed, found._beat = self._changed, self._beat
        found._intervals.extend(self._intervals)
        return found

    def is_as(self, other: 'MessageTimes') -> bool:
        """Return whether the times of another switch are the same."""
        return (
            self._newest == other._newest
            and self._doubt == other._doubt
            and self._beat == other._beat
            and self._changed == other._changed
            and self.on_change == other.on_change
            and self._intervals == other._intervals
        )

    def first(self, time: float, doubt: float) -> None:
        """Take the first message, or the first one after time was set back."""
        self._newest, self._doubt = time, doubt
        self._changed = True

    def repeat(self, time: float, doubt: float) -> None:
        """Take a message that repeats the level."""
        gap = time - self._newest
        if gap <= 0.0:
            return
        if gap > LONGEST_GAP:
            self.on_change = True
        if not self._changed:
            self._intervals.append(gap)
        elif self._is_early(gap):
            self.on_change = True
        self._newest = self._beat = time
        self._doubt, self._changed = doubt, False

    def change(self, time: float, doubt: float) -> Opening:
        """Take a message with a new level; return the times that it leaves open for the edge."""
        gap = max(0.0, time - self._newest)
        due = self._is_due(time, gap)
        early = self._is_early(gap)
        if not due and gap > LONGEST_GAP:
            self.on_change = True
        sure = not due and (self.on_change or (early and self._proves_at_once))
        self.on_change = self.on_change or early
        opening = Opening(time, time, doubt)
        if not sure:
            opening = Opening(time - gap, time, max(doubt, self._doubt))
        self.first(max(time, self._newest), doubt)
        return opening

    def set_back(self, now: float) -> None:
        """Forget the times, because simulated time jumped back; the driver stays the same."""
        self._beat = -1e300
        self.first(now, 0.0)

    @property
    def interval(self) -> float:
        """The usual time between repeats, s; 0 while it is not known."""
        return median(self._intervals) if self._intervals else 0.0

    @property
    def _proves_at_once(self) -> bool:
        return len(self._intervals) >= MANY and min(self._intervals) >= SLOW_REPEATS

    def _is_early(self, gap: float) -> bool:
        """Return whether a gap is much shorter than repeats are apart."""
        return len(self._intervals) >= ENOUGH and gap < EARLY * min(self._intervals)

    def _is_due(self, time: float, gap: float) -> bool:
        """Return whether a repeat is due at the time of a change, as far as is known."""
        if len(self._intervals) < ENOUGH:
            return False
        shortest, usual = min(self._intervals), self.interval
        if gap >= DUE * shortest:
            return gap <= max(LONGEST_GAP, CEASED * usual)
        beats = (time - self._beat) / usual
        spread = 1.0 - min(1.0, shortest / usual)
        return self._changed and abs(beats - round(beats)) < 1.0 - DUE + spread
