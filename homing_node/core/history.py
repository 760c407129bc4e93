# SPDX-License-Identifier: Apache-2.0
"""What an axis remembers of its runs: how many, how they ended, how far its homes spread."""

from collections import Counter, deque
from statistics import pstdev

from ..procedures.states import Error

#: Homes that the spread is taken from.
REMEMBERED = 100


class History:
    """The runs of an axis since the node started.

    ``runs`` counts those that have ended, ``ended`` by how they did; positions in m or rad.
    """

    def __init__(self) -> None:
        self.runs = 0
        self.ended: Counter[Error] = Counter()
        self.homes: deque[float] = deque(maxlen=REMEMBERED)

    def add(self, error: Error, home_position_raw: float) -> None:
        """Take a run that has ended."""
        self.runs += 1
        self.ended[error] += 1
        if error is Error.NoError:
            self.homes.append(home_position_raw)

    def forget_homes(self) -> None:
        """Begin a new spread: the axis homes differently now."""
        self.homes.clear()

    @property
    def homed(self) -> int:
        return self.ended[Error.NoError]

    @property
    def range(self) -> float:
        """Largest minus smallest home position."""
        return max(self.homes) - min(self.homes) if self.homes else 0.0

    @property
    def deviation(self) -> float:
        """Standard deviation of the home positions."""
        return pstdev(self.homes) if self.homes else 0.0
