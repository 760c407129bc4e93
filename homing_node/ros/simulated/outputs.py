# SPDX-License-Identifier: Apache-2.0
"""What the simulated axes publish, and when it is due."""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from std_msgs.msg import Bool, Float64

from ...course import Happening
from ...plant.drivers import SwitchDriver


class Sample(NamedTuple):
    """A feedback sample of all axes; positions in m or rad, velocities per s.

    ``forces``: what the spring of each follower of a gantry bears, N.
    """

    time: float
    position: 'array[float]'
    velocity: 'array[float]'
    forces: Sequence[float] = ()


class Change(NamedTuple):
    """A happening that waits for its time."""

    time: float
    output: 'Output'
    message: Bool | Float64
    happening: Happening | None  # None: the driver of a switch publishes it by itself


@dataclass
class Output:
    """The publisher of one input of an axis."""

    axis: str
    publisher: Any
    level: Bool | None = None  # the last published one; a latch has none
    readers: int = 0
    driver: SwitchDriver | None = None  # of a switch whose level is repeated

    def publish(self, level: bool) -> bool:
        """Publish a level if it has changed; return whether it has."""
        changed: bool = self.level.data != level
        if changed:
            self.level = Bool(data=level)
            self.publisher.publish(self.level)
        return changed

    def greet(self) -> None:
        """Publish the level for readers that came since the last call and ask for no history.

        A switch that is polled is published soon anyway.
        """
        if self.driver is not None and self.driver.polled:
            return
        readers = self.publisher.get_subscription_count()
        if readers > self.readers:
            self.publisher.publish(self.level)
        self.readers = readers


@dataclass
class Lateness:
    """How well the process kept the time, s."""

    worst: float = 0.0  # of publishing a happening
    happenings: int = 0
    hold_ups: int = 0
    held_up: float = 0.0  # in all
