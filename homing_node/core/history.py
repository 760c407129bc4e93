# SPDX-License-Identifier: Apache-2.0
"""The runs of an axis since the node started: how they ended, and how far their homes spread."""

from collections import Counter, deque
from statistics import pstdev

from ..procedures.states import Error

#: The number of homes from which the spread is computed.
REMEMBERED = 100


class History:
    """The runs of an axis that have ended.

    Attributes:
        runs: the number of homing runs.
        count: the number of all runs, jogs as well.
        ended: their number by error; NoError counts the homed ones.
        homes: the newest home positions, raw, m or rad.
    """

    def __init__(self) -> None:
        self.runs = self.count = 0
        self.ended: Counter[Error] = Counter()
        self.homes: deque[float] = deque(maxlen=REMEMBERED)

    def add(self, error: Error, home_position_raw: float) -> None:
        """Record a homing run that has ended."""
        self.count += 1
        self.runs += 1
        self.ended[error] += 1
        if error is Error.NoError:
            self.homes.append(home_position_raw)

    def jogged(self) -> None:
        """Record that a jog has ended."""
        self.count += 1

    def fails(self, error: Error) -> None:
        """Record that the last run has failed after all: its home was not taken over."""
        self.ended[Error.NoError] -= 1
        self.ended[error] += 1

    def forget_homes(self) -> None:
        """Forget the home positions, because the axis homes differently now."""
        self.homes.clear()

    @property
    def homed(self) -> int:
        return self.ended[Error.NoError]

    @property
    def range(self) -> float:
        """Largest minus smallest home position, m or rad."""
        return max(self.homes) - min(self.homes) if self.homes else 0.0

    @property
    def deviation(self) -> float:
        """Standard deviation of the home positions, m or rad."""
        return pstdev(self.homes) if self.homes else 0.0
