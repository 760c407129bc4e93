# SPDX-License-Identifier: Apache-2.0
"""Which event of the tables a switch's edge or level means, and which edges count."""

from collections.abc import Mapping

from ..parameters.axis import AxisParameters
from ..procedures.events import Event
from ..procedures.motions import Way
from ..procedures.procedure import Row
from ..procedures.states import Error, Input, Role
from .flags import FlagEnds
from .limits import Limit, LimitSwitches
from .signals import Edge, HasLevel

#: How a run ends if a switch never falls on the way back.
STUCK_SWITCH = frozenset(
    {
        Error.LSTriggered,
        Error.SearchDistanceExceeded,
        Error.MaxLSRevDistanceTraveled,
        Error.MaxHSOnAtStartRevDistanceTraveled,
    }
)


class SwitchEvents:
    """The switches of an axis as the rows of its procedure see them."""

    def __init__(
        self, parameters: AxisParameters, switches: Mapping[Input, HasLevel], limits: LimitSwitches
    ) -> None:
        self._parameters = parameters
        self._switches = switches
        self._limits = limits
        target = parameters.procedure.target
        self._target = parameters.limit_switch(target, Way.TOWARD) if target else None
        self._flags = FlagEnds(parameters)
        self._always_on = {name for name, switch in switches.items() if switch.level is True}

    def remember(self, edge: Edge) -> None:
        """Remember where the flags begin and end."""
        if not edge.rises:
            self._always_on.discard(edge.input)
        if edge.way > 0:
            self._flags.add(edge)
        self._limits.remember(edge)

    def on(self, switch: Input) -> bool:
        """Return whether a switch is wired and on."""
        return switch in self._switches and self._switches[switch].level is True

    @property
    def bounce_hint(self) -> str:
        """What to do about a flag that was taken for a bounce, '' if none was."""
        width, p = self._flags.dismissed, self._parameters
        if width is None:
            return ''
        return (
            f'the home switch fell {width:.3g} m behind its rise, which was taken for a bounce '
            f'(within {p.flag_bounce_distance:.3g} m, 5 ms x homing_velocity_fast); set '
            'switch_debounce, or a lower homing_velocity_fast'
        )

    def stuck_hint(self, error: Error, row: Row, of: str = '') -> str:
        """Return a hint if a row waits for the fall of a home switch that was never off, or ''.

        ``of``: whose home switch it is, if there are several.
        """
        waits = error in STUCK_SWITCH and Event.HS_FALLS in row.on
        if not waits or Input.HOME_SWITCH not in self._always_on:
            return ''
        return (
            f'the home switch{of} was on at the start and never fell: is its polarity right '
            '(invert_hs_polarity), or is it stuck on?'
        )

    def events_of(self, switch: Input) -> tuple[Event | None, Event | None, Event | None]:
        """Return the events of a switch: it rises, it falls, it is on though no rise counted."""
        if switch is Input.HOME_SWITCH:
            return Event.HS_RISES, Event.HS_FALLS, Event.HS_ON
        if switch is self._target:
            return Event.LS_RISES, Event.LS_FALLS, Event.LS_ON
        limit = self._limits.get(switch)
        if limit and limit.role is Role.REVERSAL:
            return Event.LIMIT_AHEAD, None, Event.LIMIT_AHEAD
        return None, None, None

    def counts(self, edge: Edge, row: Row) -> bool:
        """Return whether an edge ends a row.

        The axis must have traveled the row's way when it passed the edge, and the edge must be at
        that end of the flag which the row means (flags.py).
        """
        if edge.way * row.motion.way <= 0:
            return False
        if row.motion.way is Way.TOWARD:
            return edge.rises or not self._flags.bounces(edge)
        return self._flags.at_entry(edge)

    def holds(self, condition: Event, feedback: float) -> bool:
        """Return whether a condition of a row holds when the row is entered."""
        if condition is Event.HS_ON:
            return self.on(Input.HOME_SWITCH)
        if condition is Event.LS_ON:
            return self._target is not None and self.on(self._target)
        return self._limits.reversing(feedback)

    def awaits(self, row: Row, limit: Limit, reversed_before: bool) -> bool:
        """Return whether the rise of a limit is an arrow of a row."""
        if limit.role is Role.REVERSAL:
            return Event.LIMIT_AHEAD in row.on and not reversed_before
        return limit.input is self._target and Event.LS_RISES in row.on
