# SPDX-License-Identifier: Apache-2.0
"""How the drivers of a machine publish: switches on change, with a heartbeat or polled.

No clock: times are passed in, s. The same seed gives the same messages.
"""

import random
from collections.abc import Iterable, Iterator
from math import inf

#: Repeats of a level that the axis has heard before time 0.
PAST_REPEATS = 40
#: When a switch that is published on change told its level, s.
LONG_AGO = -10.0


class SwitchDriver:
    """Decides when the level of one switch is published.

    Args:
        level: the level at time 0.
        period: time between messages that repeat the level, s; 0: none.
        polled: whether a change waits for the next of those messages.
        jitter: by which part of itself a period may be longer or shorter.
        seed: of the phase and of the jitter.
    """

    def __init__(
        self, level: bool, period: float, polled: bool, jitter: float, seed: object
    ) -> None:
        self._level = level
        self._period, self._jitter = period, jitter
        self._random = random.Random(repr(seed))
        self.polled = polled
        self._next = self._random.uniform(-period, 0.0) - PAST_REPEATS * period

    @property
    def due(self) -> float:
        """When the next message is due that no change causes, s."""
        return self._next if self._period else inf

    def past(self) -> Iterator[tuple[float, bool]]:
        """Yield the messages before time 0: when they were sent, and the level."""
        if not self._period:
            yield LONG_AGO, self._level
        yield from self._until(0.0)

    def step(
        self, until: float, changes: Iterable[tuple[float, bool]]
    ) -> Iterator[tuple[float, bool]]:
        """Yield the messages up to a time, whose changes of the level are given in order."""
        for time, level in changes:
            yield from self._until(time)
            self._level = level
            if not self.polled:
                yield time, level
        yield from self._until(until)

    def _until(self, time: float) -> Iterator[tuple[float, bool]]:
        while self._period and self._next <= time:
            yield self._next, self._level
            self._next += self._period * (1.0 + self._random.uniform(-self._jitter, self._jitter))
