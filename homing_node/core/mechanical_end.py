# SPDX-License-Identifier: Apache-2.0
"""The search for a mechanical end: when it is found, and the torque limit that it wants.

Lengths in m or rad, times in s, torques in %.
"""

import math

from ..parameters.axis import AxisParameters


class MechanicalEnd:
    """Found once the feedback has stayed behind the command for long enough (WMX3 manual).

    ``touched``: since when it is behind, inf while it is not.
    """

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self.touched = math.inf

    def begin(self) -> None:
        """Begin a search."""
        self.touched = math.inf

    def found(self, behind: float, now: float) -> bool:
        """Tell whether the end was found; ``behind`` is command - feedback, asked every cycle."""
        p = self._parameters
        if behind <= p.mechanical_end_detection_pos_diff:
            self.touched = math.inf
            return False
        self.touched = min(self.touched, now)
        return now - self.touched >= p.mechanical_end_detection_time

    def torque_limit(self, searching: bool) -> float:
        """Return the torque limit, 0: none; the second from the touch on, while and after it."""
        p = self._parameters
        if not p.homes_on_mechanical_end:
            return 0.0
        first = p.mechanical_end_detection_first_torque_limit
        if searching and self.touched == math.inf:
            return first
        return p.mechanical_end_detection_second_torque_limit or first
