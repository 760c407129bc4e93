"""What each limit switch of an axis means to a run: which end, which role, which action."""

from typing import NamedTuple

from .motions import Way
from .parameters import AxisParameters
from .states import LATCHES, LIMIT_PAIRS, Input, LSType, Role, Tier


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
