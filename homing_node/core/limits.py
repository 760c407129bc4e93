# SPDX-License-Identifier: Apache-2.0
"""What the limit switches of an axis mean to a run, and what the rise of one does.

A limit has an end that it guards, a role that the home type gives it (the manual's page), and the
action of its LS Type. The table RESPONSES says what its rise does: it depends on the end, on what
the axis does at that moment, and on the role. A rise takes two ways:

    the message of a rise
      |
      +-- at once ------> Machine.limit_rises: RESPONSES (ignore, brake harder, act, end the run,
      |                        ^                or leave it to the present row)
      |                        |
      |                       no, the row that would have taken it has just ended
      |                        |
      +-- in EdgeQueue -> Machine.edge: does the present row take it?
          until feedback       |
          shows where it      yes
          was                  |
                               v
                          the row's arrow: the reversal, or the reference

So a stop begins at once, but an arrow is taken in the order of the edges' own times, and from
where the edge was. What the machine does with either stands in machine.py.

Source: WMX3 manual, "Limit Switches During Homing", "LS Type".
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from ..parameters.axis import AxisParameters
from ..procedures.motions import Way
from ..procedures.states import (
    LATCHES,
    LIMIT_PAIRS,
    Error,
    Input,
    LimitPair,
    LSType,
    Role,
    TextEnum,
)
from .outcome import Failure
from .series_limits import SeriesLimits
from .signals import Edge, HasLevel


class Action(NamedTuple):
    """A stop.

    Attributes:
        deceleration: m/s^2 or rad/s^2; None: no further setpoint.
        servo_off: whether the servo is switched off once the axis is at rest.
    """

    deceleration: float | None
    servo_off: bool = False


class Limit(NamedTuple):
    """One limit switch as a run sees it.

    Attributes:
        input: its input.
        pair: the pair that it belongs to.
        way: the end that it guards: TOWARD if it is ahead, AWAY if it is behind.
        role: what it means; a limit behind is always normal.
        action: what its LS Type does; None for LS Type None.
    """

    input: Input
    pair: LimitPair
    way: Way
    role: Role
    action: Action | None

    @property
    def name(self) -> str:
        side = 'ahead' if self.way is Way.TOWARD else 'behind'
        return f'{self.input.text} ({side})'

    @property
    def blocks_home(self) -> bool:
        """Whether a motion to the home position must not go into this limit."""
        if self.role is Role.NORMAL:
            return self.action is not None
        return self.role is not Role.IGNORED


def ls_action(ls_type: LSType, parameters: AxisParameters) -> Action | None:
    """Return what an LS Type does (WMX3 manual, LS Type)."""
    dec, slow = parameters.ls_dec, parameters.ls_slow_dec
    return {
        LSType.none: None,
        LSType.ServoOff: Action(None, True),
        LSType.DecServoOff: Action(dec, True),
        LSType.Dec: Action(dec),
        LSType.SlowDecServoOff: Action(slow, True),
        LSType.SlowDec: Action(slow),
    }[ls_type]


def limits_of(parameters: AxisParameters) -> dict[Input, Limit]:
    """Return the limit switches that are wired and enabled, by input."""
    wired = [i for i in parameters.inputs if i not in LATCHES]
    ahead = parameters.limits_ahead
    ignore = parameters.mechanical_end_detection_ignore_ls
    limits = {}
    for pair in LimitPair:
        for way in (Way.TOWARD, Way.AWAY):
            switch = parameters.limit_switch(pair, way)
            if switch not in wired:
                continue
            ls_type = parameters.ls_types(pair)[LIMIT_PAIRS[pair].index(switch)]
            role = ahead[pair] if way is Way.TOWARD else Role.NORMAL
            if way is Way.TOWARD and ignore and parameters.homes_on_mechanical_end:
                role = Role.IGNORED
            limits[switch] = Limit(switch, pair, way, role, ls_action(ls_type, parameters))
    return limits


class Situation(TextEnum):
    """What the axis does when a limit rises, seen from that limit."""

    STOPPING_INTO = 'the run has ended, and the axis stops; it still moves into the limit'
    STOPPING = 'the run has ended; the axis moves away from the limit, or rests'
    AWAITED = 'the present row has an arrow for this limit'
    TURNING_FOR_IT = 'it moves into the limit, and turns because this limit has risen before'
    BRAKING_INTO = 'it moves into the limit, but brakes: to turn, to pause, or after the reference'
    INTO = 'it moves into the limit, or is about to'
    HOME_INTO = 'it moves to the home position, into the limit'
    HOME_AT_ITS_EDGE = 'it moves to the home position, which is at the edge of this limit'
    JUST_LEFT = 'it moves away from the limit, which fell here a moment ago'
    AWAY = 'it moves away from the limit'
    AT_REST = 'it rests, or comes to rest away from the limit'


class Response(TextEnum):
    """What the rise of a limit does."""

    IGNORE = 'nothing'
    ARROW = 'nothing at once: the edge takes the arrow of the present row'
    BRAKE_HARDER = 'brake with the deceleration of the LS Type, if that is harder'
    ACT = 'the action of the LS Type, if that is a harder stop'
    FAIL = 'the action of the LS Type; the run ends with LSTriggered'
    FAIL_ALWAYS = 'the same, and with LS Type None a stop with ls_dec'
    FAIL_SWAPPED = 'the same; the message asks whether the limit inputs are swapped'


#: Without an action (LS Type None), these responses are nothing.
NEED_ACTION = frozenset({Response.BRAKE_HARDER, Response.ACT, Response.FAIL})
#: These end the run.
FAILS = frozenset({Response.FAIL, Response.FAIL_ALWAYS, Response.FAIL_SWAPPED})

_IGNORE, _ARROW, _HARDER = Response.IGNORE, Response.ARROW, Response.BRAKE_HARDER
_ACT, _FAIL, _ALWAYS = Response.ACT, Response.FAIL, Response.FAIL_ALWAYS
_SWAPPED = Response.FAIL_SWAPPED

# A table reads like the manual's.
# fmt: off

#: The responses of a limit ahead: situation -> (reversal, reference, normal).
AHEAD: Mapping[Situation, tuple[Response, Response, Response]] = MappingProxyType({
    #                          reversal  reference  normal
    Situation.STOPPING_INTO:  (_ACT,     _ACT,      _ACT),
    Situation.STOPPING:       (_IGNORE,  _IGNORE,   _IGNORE),
    Situation.AWAITED:        (_ARROW,   _ARROW,    _ARROW),
    Situation.TURNING_FOR_IT: (_IGNORE,  _IGNORE,   _IGNORE),
    Situation.BRAKING_INTO:   (_HARDER,  _HARDER,   _HARDER),
    Situation.INTO:           (_FAIL,    _FAIL,     _FAIL),
    Situation.HOME_INTO:      (_ALWAYS,  _ALWAYS,   _FAIL),
    Situation.HOME_AT_ITS_EDGE: (_ALWAYS, _IGNORE,  _FAIL),
    Situation.AWAY:           (_IGNORE,  _IGNORE,   _IGNORE),
    Situation.AT_REST:        (_IGNORE,  _IGNORE,   _IGNORE),
})

#: The responses of a limit behind, whose role is always normal.
BEHIND: Mapping[Situation, Response] = MappingProxyType({
    Situation.STOPPING_INTO:  _ACT,
    Situation.STOPPING:       _IGNORE,
    Situation.INTO:           _FAIL,
    Situation.JUST_LEFT:      _IGNORE,
    Situation.AWAY:           _SWAPPED,
    Situation.AT_REST:        _IGNORE,
})

# fmt: on

ROLES = (Role.REVERSAL, Role.REFERENCE, Role.NORMAL)

#: The two tables as one: (the end that the limit guards, situation, role) -> response.
RESPONSES: Mapping[tuple[Way, Situation, Role], Response] = MappingProxyType(
    {
        (Way.TOWARD, situation, role): response
        for situation, responses in AHEAD.items()
        for role, response in zip(ROLES, responses, strict=True)
    }
    | {(Way.AWAY, situation, Role.NORMAL): response for situation, response in BEHIND.items()}
)


class Rise(NamedTuple):
    """A limit's rise: what the axis does at that moment.

    Attributes:
        velocity: the command's, toward positive, m/s or rad/s.
        heading: which way the present motion leads; NONE if it is a stop or a pause.
        stopping: the run has ended, and the axis stops.
        braking: the axis brakes to turn, to pause, or because the reference was taken.
        to_home: the present motion goes to the home position.
        at_its_edge: the axis has all but reached the home position, at the edge of this limit.
        awaited: the present row has an arrow for this limit.
        turned_by_it: an edge of this limit led into the present row.
        just_left: the limit fell here a moment ago, so that its rise is a bounce.
        all_ls: ``all_ls_during_homing``: a normal limit acts whichever way the axis moves.
    """

    velocity: float
    heading: Way
    stopping: bool = False
    braking: bool = False
    to_home: bool = False
    at_its_edge: bool = False
    awaited: bool = False
    turned_by_it: bool = False
    just_left: bool = False
    all_ls: bool = False


def situation_of(limit: Limit, rise: Rise) -> Situation:
    """Return what the axis does, seen from a limit that rises."""
    into = rise.velocity * limit.way > 0.0
    away = rise.velocity * limit.way < 0.0
    acts_both_ways = rise.all_ls and limit.role is Role.NORMAL
    if rise.stopping:
        acts = into or (away and acts_both_ways)
        return Situation.STOPPING_INTO if acts else Situation.STOPPING
    if rise.awaited:
        return Situation.AWAITED
    if limit.way is Way.AWAY:
        if away:
            return Situation.JUST_LEFT if rise.just_left else Situation.AWAY
    elif into and rise.braking:
        return Situation.TURNING_FOR_IT if rise.turned_by_it else Situation.BRAKING_INTO
    if into or rise.heading is limit.way or (away and acts_both_ways):
        if limit.way is Way.AWAY or not rise.to_home:
            return Situation.INTO
        return Situation.HOME_AT_ITS_EDGE if rise.at_its_edge else Situation.HOME_INTO
    return Situation.AWAY if away else Situation.AT_REST


def response_to(limit: Limit, rise: Rise) -> Response:
    """Return what the rise of a limit does."""
    if limit.role is Role.IGNORED:
        return Response.IGNORE
    response = RESPONSES[limit.way, situation_of(limit, rise), limit.role]
    if limit.action is None and response in NEED_ACTION:
        return Response.IGNORE
    return response


def failure_of(response: Response, limit: Limit, second: bool, bounce_hint: str) -> Failure:
    """Return why the rise of a limit ends a run.

    Args:
        response: one of FAILS.
        limit: the limit.
        second: whether a limit ahead has turned the axis before in this run.
        bounce_hint: what to say of a contact that bounces, '' if none does.
    """
    if response is Response.FAIL_SWAPPED:
        return Failure(
            Error.LSTriggered,
            f'the {limit.name} rose while the axis moved toward',
            'are the limit inputs swapped, or is home_direction wrong?',
        )
    again = ' for the second time in this run' if second else ''
    return Failure(Error.LSTriggered, f'the {limit.name} rose{again}', bounce_hint)


def ahead_again(bounce_hint: str) -> Failure:
    """Return why a run ends whose axis meets a limit ahead after it has turned at one."""
    return Failure(
        Error.LSTriggered,
        'a limit ahead was hit for the second time in this run',
        bounce_hint or 'is the home switch between the limits, and does it hold its level?',
    )


class LimitSwitches:
    """The limit switches of a run: their levels, and where they rose and fell.

    Positions are in the *toward* frame, m or rad.
    """

    def __init__(
        self,
        parameters: AxisParameters,
        switches: Mapping[Input, HasLevel],
        series: SeriesLimits | None = None,
    ) -> None:
        self._limits = limits_of(parameters)
        self._switches = switches
        self._series = series or SeriesLimits()
        self._bounce_distance = parameters.bounce_distance
        self._rises: dict[Input, Edge] = {}
        self._left: dict[Input, float] = {}

    def get(self, switch: Input) -> Limit | None:
        return self._limits.get(switch)

    def rising(self, switch: Input, way: float, feedback: float) -> Limit | None:
        """Return the limit that rises while the axis moves a way (its sign).

        Of a pair in series, only the limit that the axis moves into rises, and a bounce of the
        limit that it leaves is no rise.
        """
        limit = self._limits.get(switch)
        if limit is None or limit.pair not in self._series.pairs:
            return limit
        if limit.way * way <= 0.0 or self.bounces(switch, feedback):
            return None
        self._series.rose(limit.pair, switch)
        return limit

    def remember(self, edge: Edge) -> None:
        """Remember where the axis came to a limit, because the limit may be a momentary one."""
        limit = self._limits.get(edge.input)
        if limit and edge.rises and edge.way * limit.way > 0:
            self._rises[edge.input] = edge

    def cleared(self, switch: Input) -> None:
        """Forget where the axis came to a limit, because it has gone back to where it is off."""
        self._rises.pop(switch, None)

    def left(self, switch: Input, feedback: float) -> None:
        """Remember where a limit fell."""
        self._left[switch] = feedback

    def bounces(self, switch: Input, feedback: float) -> bool:
        """Return whether a limit that rises fell here a moment ago."""
        left = self._left.get(switch)
        return left is not None and abs(feedback - left) <= self._bounce_distance

    def contradiction(self) -> Failure | None:
        """Return the failure of a pair whose levels do not say where the axis is, or None."""
        for pair, (positive, negative) in LIMIT_PAIRS.items():
            if not all(one in self._limits and self._on(one) for one in (positive, negative)):
                continue
            if pair not in self._series.pairs:
                return Failure(
                    Error.LimitsBothOn,
                    f'{positive.text} and {negative.text} are on together',
                    'wiring, or polarity (invert_..._ls_polarity)?',
                )
            if not self._series.end_known(pair):
                return Failure(
                    Error.LimitsBothOn,
                    f'{positive.text} and {negative.text} are one input, and it is on: it does '
                    'not say at which end the axis is',
                    'move the axis off its limit switch by hand',
                )
        return None

    def reversing(self, feedback: float) -> bool:
        """Return whether the axis is on a limit that means the reversal, or beyond it."""
        return any(
            limit.role is Role.REVERSAL and self._reached(limit, feedback)
            for limit in self._limits.values()
        )

    def blocking(self, way: Way, home: bool, feedback: float) -> Limit | None:
        """Return the limit that forbids a motion, None if no limit does.

        Args:
            way: the way of the motion.
            home: whether it goes to the home position.
            feedback: the newest feedback, m or rad.
        """
        for limit in self._limits.values():
            bars = limit.blocks_home if home else limit.role is Role.NORMAL and limit.action
            if limit.way is way and bars and self._reached(limit, feedback):
                return limit
        return None

    def _on(self, switch: Input) -> bool:
        return self._switches[switch].level is True

    def _reached(self, limit: Limit, feedback: float) -> bool:
        """Return whether the axis is on a limit, or beyond where a momentary limit rose."""
        rise = self._rises.get(limit.input)
        on = self._on(limit.input) and self._series.is_at(limit.pair, limit.input)
        return on or (rise is not None and (feedback - rise.position) * limit.way > 0.0)
