# SPDX-License-Identifier: Apache-2.0
"""The end of a run: the feedback settles after the command has come to rest."""

from .signals import Track

#: Longest wait for the feedback to settle, s.
SETTLE_TIMEOUT = 0.5
#: The feedback has settled once it moved less than slow velocity x SETTLE_TRAVEL in SETTLE_TIME,
#: and in no fewer than SETTLE_SAMPLES samples, all of them taken with the command at rest.
SETTLE_TIME = 0.008
SETTLE_TRAVEL = 1e-4
SETTLE_SAMPLES = 3


class Settling:
    """Judges whether the feedback has come to rest."""

    def __init__(self) -> None:
        self._since: float | None = None  # the command rests

    def restart(self) -> None:
        """Begin anew: the command moves again, or time jumped."""
        self._since = None

    def over(self, now: float, track: Track, slow_velocity: float) -> bool:
        """Return whether the wait is over; called in each cycle in which the command rests.

        Args:
            now: the present time, s.
            track: the recorded feedback.
            slow_velocity: the axis's slow velocity, m/s or rad/s; it scales what counts as rest.
        """
        if self._since is None:
            self._since = now
        if now - self._since >= SETTLE_TIMEOUT:
            return True
        begin = track.time - max(SETTLE_TIME, SETTLE_SAMPLES * track.interval)
        return begin >= self._since and track.spread(begin) <= SETTLE_TRAVEL * slow_velocity
