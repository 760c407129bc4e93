# SPDX-License-Identifier: Apache-2.0
"""What each limit switch of an axis means to a run: which end, which role, which action."""

from collections.abc import Mapping
from typing import NamedTuple

from ..parameters.axis import AxisParameters
from ..procedures.motions import Way
from ..procedures.states import LATCHES, LIMIT_PAIRS, Input, LSType, Role, Tier
from .signals import Edge, Switch


class Action(NamedTuple):
    """A stop: its deceleration in m/s^2 (None: no further setpoint) and what follows it."""

    deceleration: float | None
    servo_off: bool = False


class Limit(NamedTuple):
    """One limit switch as a run sees it.

    ``way`` tells the end it guards, ``role`` what it means (a limit behind is always normal),
    ``action`` what its LS Type does (None: nothing), ``name`` what to call it in a message.
    """

    input: Input
    tier: Tier
    way: Way
    role: Role
    action: Action | None

    @property
    def name(self) -> str:
        side = 'ahead' if self.way is Way.TOWARD else 'behind'
        return f'{self.input.text} ({side})'

    @property
    def bars_home(self) -> bool:
        """Whether it ends a motion into it that would go to the home position."""
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
    ahead = parameters.procedure.limits_ahead
    ignore = parameters.mechanical_end_detection_ignore_ls
    limits = {}
    for tier in Tier:
        for way in (Way.TOWARD, Way.AWAY):
            switch = parameters.limit_switch(tier, way)
            if switch not in wired:
                continue
            ls_type = parameters.ls_types(tier)[LIMIT_PAIRS[tier].index(switch)]
            role = ahead[tier] if way is Way.TOWARD else Role.NORMAL
            if way is Way.TOWARD and ignore and parameters.homes_on_mechanical_end:
                role = Role.IGNORED
            limits[switch] = Limit(switch, tier, way, role, ls_action(ls_type, parameters))
    return limits


class LimitSwitches:
    """The limit switches of a run: their levels, and where they rose and fell.

    Positions are in the *toward* frame, m or rad.
    """

    def __init__(self, parameters: AxisParameters, switches: Mapping[Input, Switch]) -> None:
        self._limits = limits_of(parameters)
        self._switches = switches
        self._bounce_distance = parameters.bounce_distance
        self._rises: dict[Input, Edge] = {}
        self._left: dict[Input, float] = {}

    def get(self, switch: Input) -> Limit | None:
        return self._limits.get(switch)

    def remember(self, edge: Edge) -> None:
        """Remember where the axis came to a limit, should that be a momentary one."""
        limit = self._limits.get(edge.input)
        if limit and edge.rises and edge.way * limit.way > 0:
            self._rises[edge.input] = edge

    def left(self, switch: Input, feedback: float) -> None:
        """Remember where a limit fell."""
        self._left[switch] = feedback

    def bounces(self, switch: Input, feedback: float) -> bool:
        """Tell whether a limit that rises has just been left here."""
        left = self._left.get(switch)
        return left is not None and abs(feedback - left) <= self._bounce_distance

    def pair_on(self) -> tuple[Input, Input] | None:
        """Return a pair whose two limits are on together, if there is one."""
        for pair in LIMIT_PAIRS.values():
            if all(switch in self._limits and self._on(switch) for switch in pair):
                return pair
        return None

    def reversing(self, feedback: float) -> bool:
        """Tell whether the axis is on a limit that means the reversal, or beyond it."""
        return any(
            limit.role is Role.REVERSAL and self._reached(limit, feedback)
            for limit in self._limits.values()
        )

    def blocking(self, way: Way, home: bool, feedback: float) -> Limit | None:
        """Return the limit that forbids a motion that way; ``home``: to the home position."""
        for limit in self._limits.values():
            bars = limit.bars_home if home else limit.role is Role.NORMAL and limit.action
            if limit.way is way and bars and self._reached(limit, feedback):
                return limit
        return None

    def _on(self, switch: Input) -> bool:
        return self._switches[switch].level is True

    def _reached(self, limit: Limit, feedback: float) -> bool:
        """Tell whether the axis is on a limit, or beyond where it rose (a momentary one)."""
        rise = self._rises.get(limit.input)
        return self._on(limit.input) or (
            rise is not None and (feedback - rise.position) * limit.way > 0.0
        )
