# SPDX-License-Identifier: Apache-2.0
"""How far and how long a motion may go: turning points, and the bounds of every row.

Positions are in the *toward* frame, m or rad; times in s are passed in.
"""

import math
from collections.abc import Callable

from ..parameters.axis import AxisParameters, ramp_time
from ..procedures.events import Event
from ..procedures.motions import Bound, Kind, Pace, Way
from ..procedures.procedure import Row
from ..procedures.states import Error
from .outcome import Failure
from .track import Track

#: How long a drive may still lag for the velocity that it had before, s.
LAG_LASTS = 0.15
#: A message of the feedback may be so late, s: it is compared with the commands since its time.
#: One that is older counts as an axis that does not follow.
LATEST = 0.1
#: The message for an event that did not come.
NOT_SEEN = {
    Event.HS_RISES: 'the home switch did not rise',
    Event.HS_FALLS: 'the home switch did not fall',
    Event.LS_RISES: 'the limit switch did not rise',
    Event.LS_FALLS: 'the limit switch did not fall',
    Event.Z_PULSE: 'no Z-pulse came',
    Event.TOUCH_PROBE: 'the touch probe did not trigger',
    Event.END_DETECTED: 'the mechanical end was not found',
}
HINTS = {
    Bound.LS_REVERSE: 'is the home switch between the limits?',
    Bound.HS_ON_AT_START: 'is the switch stuck on, or its polarity inverted?',
    Bound.SEARCH: 'is the switch wired, and the direction right?',
}


class Leg:
    """One stretch of travel in one way, measured from its turning point.

    Attributes:
        way: the way.
        before: the leg from which the axis turned; None if it began at rest.
        since: when this leg was commanded, s.
        feedback: the feedback at the turning point.
        command: the command at the turning point.
        gone: how far the command has gone from there.
        traveled: how far the feedback has gone from there.
        against: how far the feedback went the other way. An axis that follows late overruns as far
            as its command did; that does not count.
    """

    __slots__ = (
        'way',
        'before',
        'since',
        'feedback',
        'command',
        'gone',
        'traveled',
        'against',
        '_sign',
        '_behind',
    )

    def __init__(
        self,
        way: Way,
        feedback: float,
        command: float,
        since: float,
        before: 'Leg | None' = None,
    ) -> None:
        self.way, self.since = way, since
        self.before = before if before and before.way else None
        self._sign = float(way)
        self.feedback = feedback
        self._turn(feedback, command)
        self.gone = self.traveled = self.against = 0.0

    def update(self, feedback: float, command: float) -> bool:
        """Move the turning point while the axis overruns it; return whether the command does."""
        sign = self._sign
        gone = (command - self.command) * sign
        overruns = gone < 0.0
        if overruns:
            gone = 0.0
            self._turn(feedback, command)
        traveled = (feedback - self.feedback) * sign
        if traveled < 0.0:
            self.feedback, traveled = feedback, 0.0
        self.gone, self.traveled = gone, traveled
        self.against = self._behind - feedback * sign
        return overruns

    def _turn(self, feedback: float, command: float) -> None:
        """Set the command's turning point; `against` counts from whichever lies further back."""
        self.command = command
        self._behind = min(feedback * self._sign, command * self._sign)

    def way_at(self, time: float, track: Track) -> int | None:
        """Return the sign of the axis's travel at a time that the track covers.

        A message may be older than several turns, because a contact still bounces when its edge
        has already turned the axis.

        Returns:
            0 before a leg that began at rest, None while the feedback does not yet show where the
            axis turned.
        """
        if self.before is None:
            return self.way if time >= self.since else Way.NONE
        if time < self.since:
            return self.before.way_at(time, track)
        return track.traveled(time, self.since, self.way)


class Rules:
    """The bounds of every motion: distance, following error, direction, and the run's time.

    Attributes:
        distance: how far the present motion may go, m or rad.
        deadline: when the run must have ended, s.
        least_limit: no following error is smaller than this.
    """

    def __init__(self, parameters: AxisParameters, now: float) -> None:
        self._parameters = parameters
        self.deadline = now + parameters.run_timeout
        self._wrong_direction = parameters.wrong_direction_limit
        self._least_following = 0.0
        if parameters.homes_on_mechanical_end:  # the command turns beyond the end
            velocity, _, deceleration = parameters.pace(Pace.SLOW)
            stop = ramp_time(velocity, deceleration, parameters.max_jerk)
            behind = parameters.mechanical_end_detection_pos_diff + velocity * (
                parameters.mechanical_end_detection_time + 0.5 * stop
            )
            self._least_following = 2.0 * behind
        self.least_limit = max(parameters.following_error_at(0.0), self._least_following)
        self.distance = math.inf
        self._velocity = self._before = 0.0  # of this row, of the row before it
        self._entered = now
        self._searches_end = False
        self._missed = ''
        self._bound = Bound.SEARCH
        self._name = ''

    def enter(self, row: Row, velocity: float, now: float) -> None:
        """Take the bounds of a row.

        Args:
            row: the row.
            velocity: the velocity of the command; a drive still lags for it after the row began.
            now: the present time, s.
        """
        p, self._bound = self._parameters, row.bound
        own: float = getattr(p, row.bound)
        self._name = str(row.bound if own else Bound.SEARCH)
        if not own and row.bound is Bound.HS_ON_AT_START:
            self._bound = Bound.SEARCH
        searching = row.motion.kind in (Kind.SEARCH, Kind.APPROACH)
        self.distance = own or p.search_distance if searching else math.inf
        self._before, self._entered = self._velocity, now
        self._velocity = max(p.pace(row.motion.pace)[0], abs(velocity))
        self._searches_end = Event.END_DETECTED in row.on
        missed = [NOT_SEEN[event] for event in row.on if event in NOT_SEEN]
        self._missed = ' and '.join(missed) or 'the axis did not arrive'

    def broken(
        self,
        leg: Leg,
        commanded: Callable[[float], float],
        feedback: float,
        now: float,
        interval: float,
        age: float = 0.0,
    ) -> Failure | None:
        """Return the rule that the motion breaks, None while it keeps them all.

        Args:
            leg: the present stretch of travel.
            commanded: returns the position that was commanded so many s before the present.
            feedback: the newest feedback.
            now: the present time, s.
            interval: the time between two readings of the feedback, s; the axis goes on meanwhile.
            age: how old the newest feedback is by its stamp, s.
        """
        gone, distance = leg.gone, self.distance
        if gone > distance or leg.traveled > distance:
            return Failure(
                self._bound.error,
                f'{self._missed} within {self.distance:.6g} m ({self._name})',
                HINTS[self._bound],
            )
        behind = commanded(0.0) - feedback
        if abs(behind) > self.least_limit and not self._searches_end:
            then = commanded(min(max(0.0, age), LATEST)) - feedback
            behind = _nearest(behind, then)
            failure = self._too_far_behind(behind, now, interval)
            if failure is not None:
                return failure
        against, limit = leg.against, self._wrong_direction
        if gone >= limit and against > 0.5 * limit:
            return Failure(
                Error.WrongDirection,
                f'the feedback went {against:.6g} m against the command, which went {gone:.6g} m '
                f'({limit:.6g} m is wrong_direction_distance)',
                'is the encoder inverted?',
            )
        if now > self.deadline:
            return Failure(
                Error.Timeout, f'not ended within {self._parameters.run_timeout:.6g} s (timeout)'
            )
        return None

    def lags(self, behind: float, then: float, now: float, interval: float) -> Failure | None:
        """Return why another drive of the axis is too far from its command, None if it is not.

        Args:
            behind: command minus feedback, now.
            then: the same with the command of the time of the feedback.
            now: the present time, s.
            interval: the time between two readings of its feedback, s.
        """
        return self._too_far_behind(_nearest(behind, then), now, interval)

    def _too_far_behind(self, behind: float, now: float, interval: float) -> Failure | None:
        """Return why the feedback is too far from the command, None if a drive may lag so far.

        A drive lags for a while for the velocity of the row before.
        """
        velocity = self._velocity
        if now - self._entered < LAG_LASTS + 2.0 * interval:
            velocity = max(velocity, self._before)
        limit = max(self._parameters.following_error_at(velocity), self._least_following)
        if abs(behind) <= limit + velocity * interval:
            return None
        return Failure(
            Error.FollowingError,
            f'command - feedback is {behind:.6g} m, more than {limit:.6g} m (following_error)',
            'does the axis follow the setpoints, and does its feedback arrive? A drive that lags '
            f'by {abs(behind) / velocity:.3g} s or more at {velocity:.3g} m/s needs '
            f'following_error: {2.0 * abs(behind):.2g} or more',
        )


def _nearest(present: float, then: float) -> float:
    """Return the smallest difference to the commands from the time of a feedback to the present.

    A message that comes late is no following error; and its stamp need not be true.
    """
    if present * then <= 0.0:
        return 0.0
    return min(present, then, key=abs)
