# SPDX-License-Identifier: Apache-2.0
"""The record of one run: what the axis did in each cycle, and what its inputs did.

A rehearsal makes one, and so does a client that listens to a running node. Times in s, positions
raw in m or rad.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from .core.outcome import Outcome


class Happening(NamedTuple):
    """A switch changed, or a latch captured a position.

    `value` is the new raw (electrical) level of a switch, or the raw position that the drive
    latched (`z_pulse`, `touch_probe`), m or rad. `position` is the true position there, `time`
    the exact time inside the step, s.
    """

    time: float
    input: str
    value: bool | float
    position: float


class Sample(NamedTuple):
    """One cycle of a course: time in s, raw positions in m or rad."""

    time: float
    state: str
    position: float
    velocity: float
    acceleration: float
    feedback: float


@dataclass
class Course:
    """The record of one run, made by a rehearsal or from a real graph.

    ``samples`` has one entry a cycle in which the axis had a setpoint; ``happenings`` what the
    switches did, where that is known; ``arrows`` what the machine went through; ``inverted`` the
    switches that are on where their level on the wire is false, where no layout tells it.

    Of a gantry this is the record of the leader; ``followers`` has those of the others, by full
    names, with the same cycles and with positions of their own encoders. There ``forces`` is what
    the spring to the leader bore in each cycle, N, where that is known, and ``mirrored`` says that
    the encoder counts the other way round.
    """

    samples: list[Sample] = field(default_factory=list)
    happenings: list[Happening] = field(default_factory=list)
    outcome: Outcome | None = None
    arrows: Sequence[tuple[object, object]] = ()
    inverted: frozenset[str] = frozenset()
    followers: dict[str, 'Course'] = field(default_factory=dict)
    forces: list[float] = field(default_factory=list)
    mirrored: bool = False

    @property
    def states(self) -> list[str]:
        """The home states in the order in which they were entered."""
        states: list[str] = []
        for sample in self.samples:
            if not states or states[-1] != sample.state:
                states.append(sample.state)
        return states

    @property
    def duration(self) -> float:
        return self.samples[-1].time - self.samples[0].time if self.samples else 0.0

    def skew_of(self, follower: str) -> list[float]:
        """Return how much more a follower had moved than the leader, in each cycle."""
        other = self.followers[follower]
        sign = -1.0 if other.mirrored else 1.0
        ahead = [
            sign * one.feedback - leader.feedback
            for one, leader in zip(other.samples, self.samples, strict=True)
        ]
        return [each - ahead[0] for each in ahead]

    @property
    def largest_skew(self) -> float:
        """The largest of all skews, without their signs."""
        return max(
            (abs(one) for name in self.followers for one in self.skew_of(name)), default=0.0
        )

    @property
    def largest_force(self) -> float | None:
        """The largest force of a spring, N, without its sign; None: not known."""
        forces = [abs(one) for other in self.followers.values() for one in other.forces]
        return max(forces, default=None)
