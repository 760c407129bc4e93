# SPDX-License-Identifier: Apache-2.0
"""The search for a mechanical end: when it is found, and the torque limit that it wants.

Lengths in m or rad, times in s, torques in %.
"""

import math

from ..parameters.axis import AxisParameters
from ..procedures.states import Error
from .outcome import Failure
from .signals import FINEST, Mark

#: The feedback has stopped while it moves slower than this part of the slow velocity, ...
STOPPED = 0.1
#: ... for at least this time, s, and for so many of its readings.
STOPPED_TIME, STOPPED_READINGS = 0.02, 3


class MechanicalEnd:
    """Found once the feedback has stopped behind the command for long enough (WMX3 manual).

    A drive that lags is behind the command, too, but its feedback moves on. A drive that begins to
    follow only later looks like an end at first; then it passes the place.

    Attributes:
        touched: since when the axis stands behind the command, s; inf while it does not.
        moved: how far the feedback has moved since it stopped, m or rad.
        place: where the end was found, m or rad; None before.
    """

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self.place: Mark | None = None
        self.begin()

    def begin(self) -> None:
        """Begin a search."""
        self.touched = self._behind = math.inf
        self.moved = 0.0
        self._stopped: tuple[float, float] | None = None  # since when, and where

    def found(self, command: float, feedback: float, now: float, interval: float) -> bool:
        """Return whether the end was found; called in each cycle.

        Args:
            command: the commanded position.
            feedback: the newest feedback.
            now: the present time, s.
            interval: the time between two readings of the feedback, s.
        """
        p = self._parameters
        least = max(STOPPED_TIME, STOPPED_READINGS * interval)
        stood = self._stands(feedback, now, max(least, p.mechanical_end_detection_time))
        if command - feedback <= p.mechanical_end_detection_pos_diff:
            self._behind = math.inf
        else:
            self._behind = min(self._behind, now)
        self.touched = self._behind if stood >= least else math.inf
        return (
            now - self.touched >= p.mechanical_end_detection_time
            and stood >= p.mechanical_end_detection_time
        )

    def find(self, feedback: float) -> Mark:
        """Keep the feedback as the place of the end, and return it."""
        self.place = Mark(feedback, max(FINEST, self.moved))
        return self.place

    def passed(self, feedback: float) -> Failure | None:
        """Return what is wrong if the axis has passed the place of the end: nothing holds it."""
        if self.place is None:
            return None
        allowed = max(self._parameters.mechanical_end_detection_pos_diff, self.place.uncertainty)
        by = feedback - self.place.position
        if by <= allowed:
            return None
        return Failure(
            Error.FollowingError,
            f'the axis went {by:.6g} m on behind the mechanical end, more than {allowed:.6g} m',
            'does the drive follow late, or does the end give way? '
            'mechanical_end_detection_time may be too short',
        )

    def _stands(self, feedback: float, now: float, window: float) -> float:
        """Return for how long the feedback has stood, s."""
        if self._stopped is None:
            self._stopped = now, feedback
        since, at = self._stopped
        self.moved = abs(feedback - at)
        slow = STOPPED * self._parameters.homing_velocity_slow
        if self.moved > slow * max(now - since, window):
            self._stopped, self.moved = (now, feedback), 0.0
        return now - self._stopped[0]

    def torque_limit(self, searching: bool) -> float:
        """Return the torque limit, 0: none; the second from the touch on, while and after it."""
        p = self._parameters
        if not p.homes_on_mechanical_end:
            return 0.0
        first = p.mechanical_end_detection_first_torque_limit
        if searching and self.touched == math.inf:
            return first
        return p.mechanical_end_detection_second_torque_limit or first
