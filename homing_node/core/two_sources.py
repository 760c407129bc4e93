# SPDX-License-Identifier: Apache-2.0
"""Notices two publishers of one joint: the feedback alternates between two places.

A position that goes out and comes back within two samples, further than the axis can move in that
time, is not a motion. One such excursion may be a disturbed message. Two of them within
``MEMORY`` are two sources. Positions are in m or rad, times in s.
"""

from collections import deque
from math import nan

#: Excursions count together if they are no further apart, s.
MEMORY = 3.0
#: This many excursions are two sources.
ENOUGH = 2
#: How far the two ends of an excursion may be apart, as a part of its length.
SAME_PLACE = 0.25


class TwoSources:
    """The excursions of one joint's feedback.

    Attributes:
        places: The two places between which the feedback alternates, None while there are no two.
    """

    def __init__(self) -> None:
        self.places: tuple[float, float] | None = None
        self._before = self._last = nan  # the two newest positions
        self._excursions: deque[float] = deque(maxlen=ENOUGH)  # their times

    def add(self, time: float, position: float, reach: float) -> None:
        """Note a sample.

        Args:
            time: When it arrived; several sources may have clocks of their own.
            position: Where it says that the joint is.
            reach: How far the axis can move between two samples.
        """
        before, last = self._before, self._last
        self._before, self._last = last, position
        if self.places is not None and time - self._excursions[-1] > MEMORY:
            self.places = None
        out, back = last - before, position - last
        length = min(abs(out), abs(back))
        if not length > reach or out * back >= 0.0 or abs(out + back) > SAME_PLACE * length:
            return
        self._excursions.append(time)
        if len(self._excursions) == ENOUGH and time - self._excursions[0] <= MEMORY:
            self.places = last, position
