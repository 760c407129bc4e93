# SPDX-License-Identifier: Apache-2.0
"""How fast messages travel on a machine."""

from typing import NamedTuple

from ..parameters.axis import AxisParameters


class Timing(NamedTuple):
    """How fast things travel: rates in Hz, times in s.

    ``latency`` is the time from a switch's edge until the setpoint that answers it takes effect in
    the drive, without the node's own cycle and its ``lead``: how long before it acts a trajectory
    tells a change of the plan (setpoint_lead). ``feedback_rate`` None: not known. ``accuracy`` is
    how well home must be known, m or rad (None: not asked for).
    """

    update_rate: float = 250.0
    feedback_rate: float | None = None
    latency: float = 0.005
    accuracy: float | None = None
    lead: float = 0.0

    @property
    def feedback_period(self) -> float:
        """The time between two feedbacks, s."""
        return 1.0 / (self.feedback_rate or self.update_rate)

    @property
    def feedback_age(self) -> float:
        """The age of the newest feedback at its worst, s."""
        return self.latency + self.feedback_period

    def reaction(self, parameters: AxisParameters, lag: float = 0.0) -> float:
        """Return the time from a switch's edge until the axis begins to brake, s."""
        return (
            self.latency
            + self.lead
            + 1.0 / self.update_rate
            + lag
            + parameters.switch_latency
            + parameters.switch_debounce
        )
