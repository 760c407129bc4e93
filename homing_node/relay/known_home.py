# SPDX-License-Identifier: Apache-2.0
"""What the relay knows of the home of one axis, and whether the axis may move.

The home comes from the homing node: first by the parameter `<axis>.home_offset` of the relay, in
the hand-over, then confirmed by the latched state of the axis. The relay outlives the homing node:
one that has just started knows no home (`Idle`, not homed, no error), and that says nothing. The
home is lost where the homing node says so with an error, where a run begins, and where the
relay itself sees that the feedback jumps, stops, or has a new publisher.

``TABLE`` is the whole of it. Positions in m or rad, times in s.
"""

import math
from collections.abc import Mapping

from ..core.home_watch import HomeWatch
from ..parameters.axis import AxisParameters
from ..procedures.states import TextEnum

#: The velocity of an axis is measured over this time, or up to twice as long, s.
MEASURED = 0.05
NEVER = (-math.inf, math.nan)


class Knowledge(TextEnum):
    """What is known of a home."""

    Unknown = 'unknown'
    Homing = 'homing'
    Told = 'told'  # in the hand-over: shown, but not confirmed
    Given = 'given'  # by the parameter alone: no run is known of
    Homed = 'homed'
    Lost = 'lost'  # by the homing node's word
    LostHere = 'lost here'  # by what the relay saw; the homing node may not know it yet


class News(TextEnum):
    """What changes the knowledge."""

    Told = 'told'
    SaysHomed = 'says homed'
    SaysHoming = 'says homing'
    SaysNothing = 'says nothing'
    SaysFailed = 'says failed'
    Seen = 'seen'


K, N = Knowledge, News
#: News that is not in a row changes nothing.
TABLE: Mapping[Knowledge, Mapping[News, Knowledge]] = {
    K.Unknown: {
        N.Told: K.Given,
        N.SaysHomed: K.Homed,
        N.SaysHoming: K.Homing,
        N.SaysFailed: K.Lost,
    },
    K.Homing: {
        N.Told: K.Told,
        N.SaysHomed: K.Homed,
        N.SaysNothing: K.Unknown,
        N.SaysFailed: K.Lost,
    },
    K.Told: {
        N.SaysHomed: K.Homed,
        N.SaysNothing: K.Unknown,
        N.SaysFailed: K.Lost,
        N.Seen: K.LostHere,
    },
    # The call of a hand-over may come before the state that the run has begun.
    K.Given: {
        N.SaysHomed: K.Homed,
        N.SaysHoming: K.Told,
        N.SaysFailed: K.Lost,
        N.Seen: K.LostHere,
    },
    K.Homed: {
        N.Told: K.Given,
        N.SaysHoming: K.Homing,
        N.SaysFailed: K.Lost,
        N.Seen: K.LostHere,
    },
    K.Lost: {
        N.Told: K.Given,
        N.SaysHomed: K.Homed,
        N.SaysHoming: K.Homing,
    },
    K.LostHere: {
        N.Told: K.Given,
        N.SaysHoming: K.Homing,
        N.SaysFailed: K.Lost,
    },
}
#: Where the offset is good for `joint_states`.
SHOWN = (K.Told, K.Given, K.Homed)
#: Where the axis may move.
HOMED = (K.Given, K.Homed)
#: What is said of an axis that has no home, without a reason of its own.
REASONS: Mapping[Knowledge, str] = {
    K.Unknown: 'is not homed',
    K.Homing: 'is homing',
    K.Told: 'is homing: its home is being handed over',
}


class KnownHome:
    """The home of one axis.

    Attributes:
        name: the name of the axis.
        joint: its joint.
        parameters: its parameters.
        knowledge: what is known.
        offset: raw minus homed position; None where it is not to be shown.
        raw: the newest feedback; None before the first.
    """

    def __init__(self, name: str, parameters: AxisParameters) -> None:
        self.name = name
        self.joint = parameters.joint or name
        self.parameters = parameters
        self.knowledge = Knowledge.Unknown
        self.offset: float | None = None
        self.raw: float | None = None
        self._why = ''
        self._watch = HomeWatch()
        self._arrival = 0.0
        self._time = 0.0  # of the newest sample
        # Two earlier samples, MEASURED or more apart from each other and from the newest one.
        self._earlier = self._since = NEVER
        p = parameters
        self._leap = 0.01 * p.travel + 2.0 * p.following_error_limit

    @property
    def refusal(self) -> str:
        """Why the axis must not move, '' if it may."""
        if self.knowledge in HOMED:
            return ''
        return f'axis {self.name} {self._why or REASONS[self.knowledge]}'

    @property
    def position(self) -> float | None:
        """The newest homed position; None where it is not known."""
        return None if self.raw is None or self.offset is None else self.raw - self.offset

    @property
    def velocity(self) -> float:
        """How fast the axis has moved lately, m/s or rad/s; 0 where it rests within its noise."""
        time, raw = self._earlier
        if self.raw is None or math.isinf(time):
            return 0.0
        moved, wrap = self.raw - raw, self.parameters.wrap
        if wrap:
            moved = math.remainder(moved, wrap)
        rests = abs(moved) <= self.parameters.settling_tolerance
        return 0.0 if rests else moved / (self._time - time)

    def told(self, offset: float) -> None:
        """Take the home from the parameter."""
        self._take(News.Told, offset)

    def said(self, homed: bool, idle: bool, error: str, message: str, offset: float) -> None:
        """Take a state of the homing node.

        Args:
            homed: whether it knows the home.
            idle: whether no run is on.
            error: the name of an error, '' for none.
            message: the error in words.
            offset: raw minus homed position, if homed.
        """
        if homed:
            self._take(News.SaysHomed, offset)
        elif not idle:
            self._take(News.SaysHoming)
        elif error:
            self._take(News.SaysFailed, why=f'is not homed: {error}: {message}')
        else:
            self._take(News.SaysNothing)

    def feedback(self, time: float, raw: float, arrival: float) -> None:
        """Take a sample: when it was taken by its stamp, the raw position, when it arrived."""
        p, self.raw, self._arrival = self.parameters, raw, arrival
        self._time = time
        if not 0.0 <= time - self._since[0] < MEASURED:
            later = time >= self._since[0]
            self._earlier, self._since = (self._since if later else NEVER), (time, raw)
        jump = self._watch.step(time, raw, self._leap, p.ls_dec, p.wrap)
        if jump:
            self._earlier, self._since = NEVER, (time, raw)
            self._see(f'its feedback jumped by {jump:.6g}')

    def new_publisher(self) -> None:
        """Take that another node publishes the feedback."""
        self._watch = HomeWatch()
        if self.parameters.clear_home_done_on_comm_stop:
            self._see('the publisher of its feedback has changed')

    def check_age(self, now: float) -> None:
        """Lose the home if no feedback has come for too long since the last one."""
        p = self.parameters
        if self.raw is None:
            return
        if p.clear_home_done_on_comm_stop and now - self._arrival > p.feedback_timeout:
            self._see(f'no feedback came for {p.feedback_timeout:g} s (feedback_timeout)')

    def _see(self, text: str) -> None:
        self._take(News.Seen, why=f'has lost its home: {text}: did the driver restart?')

    def _take(self, news: News, offset: float | None = None, why: str = '') -> None:
        row = TABLE[self.knowledge]
        if news in row:
            self.knowledge, self._why = row[news], why
        takes = news in (News.Told, News.SaysHomed)
        if self.knowledge not in SHOWN:
            self.offset = None
        elif takes:
            self.offset = offset
