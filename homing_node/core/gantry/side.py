# SPDX-License-Identifier: Apache-2.0
"""One side of a gantry in a run, and where it was at a time.

Positions are in the *toward* frame, m or rad; times in s.
"""

from ...parameters.axis import AxisParameters
from ..edge_queue import EdgeQueue
from ..latches import Latches
from ..readings import Readings
from ..remembered import Seen
from ..track import Track
from .follower import Follower


class Side:
    """One side of a gantry in a run: the leader's, or a follower's.

    Attributes:
        name: for messages: the axis, or the full name of the follower.
        parameters: its parameters.
        readings: what it has received.
        follower: the follower; None for the leader.
        shift: its `switch_offset`.
        apart: its feedback less the leader's when they last stood where they shall.
        since: since when that holds, s.
        at_start: the same at the start of the run.
        edges: its edges that wait for its feedback.
        latches: its latched positions since the axis turned.
        seen: its edges of captured switches, and its latches, of the whole run.
    """

    def __init__(
        self,
        name: str,
        parameters: AxisParameters,
        readings: Readings,
        leader: AxisParameters,
        follower: Follower | None = None,
    ) -> None:
        self.name, self.parameters, self.readings = name, parameters, readings
        self.follower = follower
        self.shift = leader.home_direction.sign * parameters.switch_offset if follower else 0.0
        self.apart = self.at_start = 0.0
        self.since = -1e300
        self.edges = EdgeQueue(parameters)
        self.latches = Latches(parameters)
        self.seen = Seen()

    @property
    def track(self) -> Track:
        return self.readings.track

    @property
    def offset(self) -> float:
        """Its command less the leader's, while all move together."""
        return self.follower.offset if self.follower else 0.0


def place_at(track: Track, time: float) -> float:
    """Return the position at a time; after the newest reading it is that reading's."""
    if not track.samples or time >= track.samples[-1][0]:
        return track.position
    return track.at(time)


def time_at(track: Track, position: float) -> float:
    """Return when a track was last at a position."""
    newer = track.samples[-1]
    for older in reversed(track.samples):
        if (older[1] - position) * (newer[1] - position) <= 0.0:
            return older[0]
        newer = older
    return newer[0]
