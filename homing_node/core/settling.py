# SPDX-License-Identifier: Apache-2.0
"""The end of a run: the feedback settles after the command, and the axis rests."""

from statistics import fmean
from typing import NamedTuple

from ..parameters.axis import AxisParameters
from ..procedures.states import Error, HomeType
from .outcome import Failure
from .track import Track

#: Longest wait for the feedback to settle, s.
SETTLE_TIMEOUT = 0.5
#: The feedback has settled once it moved less than slow velocity x SETTLE_TRAVEL in SETTLE_TIME,
#: and in no fewer than SETTLE_SAMPLES samples, all of them taken with the command at rest.
SETTLE_TIME = 0.008
SETTLE_TRAVEL = 1e-4
SETTLE_SAMPLES = 3


class Rest(NamedTuple):
    """Where a run left the axis at rest, raw, m or rad."""

    command: float
    feedback: float

    def holds(self, feedback: float, parameters: AxisParameters, period: float) -> bool:
        """Return whether the axis still rests there, so that the next run starts at the command.

        If the axis was moved, or did not follow its command, the next run starts at the feedback.

        Args:
            feedback: the newest feedback, raw, m or rad.
            parameters: the parameters of the next run.
            period: the time between two updates, s.
        """
        if parameters.home_type is HomeType.CurrentPos:
            return False
        moved, behind = abs(feedback - self.feedback), abs(self.command - self.feedback)
        return (
            moved <= parameters.homing_velocity_slow * period
            and behind <= parameters.settling_tolerance
        )


def jammed(behind: float, tolerance: float) -> Failure:
    """Return the failure of an axis that rests away from its command, m or rad."""
    return Failure(
        Error.FollowingError,
        f'command - feedback is {behind:.6g} m at rest, more than {tolerance:.6g} m',
        'is the axis jammed, or its drive too weak?',
    )


def never_moved(gone: float) -> Failure:
    """Return the failure of an axis that stood while its command went some way, m or rad."""
    return Failure(
        Error.FollowingError,
        f'the command went {gone:.6g} m and came back, and the feedback did not move',
        'is the drive on, and does it follow the setpoints? What closed the switch?',
    )


class Settling:
    """Judges whether the feedback has come to rest.

    ``lead``: how long before its time a setpoint is told, s.
    """

    def __init__(self, lead: float = 0.0) -> None:
        self._lead = lead
        self._since: float | None = None  # the command rests

    def restart(self) -> None:
        """Begin anew: the command moves again, or time jumped."""
        self._since = None

    def over(self, now: float, track: Track, slow_velocity: float, follows: bool = True) -> bool:
        """Return whether the wait is over; called in each cycle in which the command rests.

        Args:
            now: the present time, s.
            track: the recorded feedback.
            slow_velocity: the axis's slow velocity, m/s or rad/s; it scales what counts as rest.
            follows: whether the feedback is where the command is.
        """
        if self._since is None:
            self._since = now + self._lead
        if now - self._since >= SETTLE_TIMEOUT:
            return True
        begin = track.time - _window(track)
        rests = begin >= self._since and track.spread(begin) <= SETTLE_TRAVEL * slow_velocity
        return rests and follows

    def place(self, track: Track) -> float | None:
        """Return where the axis has come to rest; None: too little was read since then.

        It is the mean of what `over` has judged; of feedback that does not settle, of more.
        """
        since, begin = self._since, track.time - _window(track)
        if since is None or begin < since:
            return None
        begin = min(begin, track.time - 0.25 * (track.time - since))
        places = [place for time, place in track.near(begin, track.time) if time >= begin]
        return fmean(places) if places else track.position


def _window(track: Track) -> float:
    """Return for how long an axis must stand, s."""
    return max(SETTLE_TIME, SETTLE_SAMPLES * track.interval)
