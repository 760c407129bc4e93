# SPDX-License-Identifier: Apache-2.0
"""One quantity from run to run: where it belongs, and whether a new value belongs there too.

The baseline are the last BASELINE accepted values. Its centre is their median. Its scale is their
median distance from the centre (times 1.4826: the standard deviation, if they are normal) and half
of what is uncertain, but no less than the uncertainty and the resolution of the value. A value
that is further than FAR scales from the centre is suspicious and never enters the baseline; two in
a row are a warning.
"""

from collections import deque
from statistics import median
from typing import NamedTuple

#: The number of values in the baseline, and how many are only collected at first.
BASELINE, FIRST = 30, 5
#: How many scales from the centre a value is suspicious.
FAR = 5.0
#: A median distance times this is a standard deviation.
NORMAL = 1.4826
#: The fewer values, the less a median distance tells: the scale is larger by this over n squared.
FEW = 200.0
#: The number of values that are kept for the trends.
MOST = 200


class Comparison(NamedTuple):
    """A value beside its baseline; ``change`` and ``scale`` in m or rad.

    ``known`` is False while values are only collected. ``since`` is the run since which the values
    are suspicious, None if the last one was not.
    """

    change: float
    scale: float
    known: bool
    suspicious: bool
    since: int | None


class Value(NamedTuple):
    """A value of a run; ``value`` lies near the others also where they repeat by a period."""

    run: int
    value: float
    uncertainty: float
    accepted: bool


class Series:
    """The values of one quantity.

    Attributes:
        values: The newest ones, accepted or not.
        since: The run since which they are suspicious, None if they are not.
        suspicious: How many of the last ones were suspicious, in a row.
        period: By what the values repeat (a pitch, a turn); 0: they do not.
    """

    def __init__(self, period: float = 0.0) -> None:
        self.period = period
        self.values: deque[Value] = deque(maxlen=MOST)
        self._accepted: deque[float] = deque(maxlen=BASELINE)
        self.since: int | None = None
        self.suspicious = 0

    @property
    def known(self) -> bool:
        """Whether there is a baseline."""
        return len(self._accepted) >= FIRST

    @property
    def centre(self) -> float:
        """The median of the baseline."""
        return median(self._accepted)

    def scale(self, least: float) -> float:
        """Return the scale of the baseline, no less than what a value can tell, m or rad."""
        centre, count = self.centre, len(self._accepted)
        spread = NORMAL * median(abs(value - centre) for value in self._accepted)
        return max(spread * (1.0 + FEW / count**2) + 0.5 * least, least)

    def compare(self, value: float, least: float, run: int, tolerated: float = 0.0) -> Comparison:
        """Compare a value with the baseline, as the next one of the series.

        Args:
            value: The value.
            least: Its uncertainty or resolution, whichever is larger.
            run: The number of the run.
            tolerated: A larger change is suspicious, too; 0: there is no such bound.
        """
        if not self.known:
            return Comparison(0.0, least, False, False, None)
        change = self._near(value) - self.centre
        scale = self.scale(least)
        bound = min(FAR * scale, tolerated) if tolerated else FAR * scale
        suspicious = abs(change) > bound
        since = (self.since or run) if suspicious else None
        return Comparison(change, scale, True, suspicious, since)

    def add(self, value: float, least: float, run: int, tolerated: float = 0.0) -> Comparison:
        """Compare a value and keep it."""
        found = self.compare(value, least, run, tolerated)
        if self._accepted:
            value = self._near(value)
        self.values.append(Value(run, value, least, not found.suspicious))
        self.since = found.since
        self.suspicious = self.suspicious + 1 if found.suspicious else 0
        if not found.suspicious:
            self._accepted.append(value)
        return found

    def _near(self, value: float) -> float:
        if not self.period or not self._accepted:
            return value
        return value + self.period * round((self._accepted[-1] - value) / self.period)
