# SPDX-License-Identifier: Apache-2.0
"""The switches of all sides of a gantry in a run, as the machine gets them.

The home switch and the limit that the type homes on are *captured*: their edges count when the
last side's has come. Any other limit is that of the group as soon as one side's is on.
"""

from collections.abc import Mapping, Sequence
from copy import copy

from ...parameters.axis import AxisParameters, switch_inputs
from ...parameters.gantry import leaders_input
from ...procedures.events import Event
from ...procedures.motions import Kind, Way
from ...procedures.procedure import Row
from ...procedures.states import LIMIT_SWITCHES, Error, Input, Role
from ..limits import Action, limits_of
from ..machine import Machine
from ..outcome import Failure
from ..signals import Edge, Mark
from .edges import Captures, GroupEdge, GroupLevel
from .side import Side


class GantrySwitches:
    """The switches of the sides.

    Attributes:
        levels: the levels of the group, by the leader's inputs.
        captures: the captured switches of the group.
        home: the reference of each side, once it was found.
        apart: whether a side waits for another one at a captured switch.
    """

    def __init__(
        self, parameters: AxisParameters, leader: Side, sides: tuple[Side, ...], event: Event
    ) -> None:
        """Take the levels at the start of a run.

        Args:
            parameters: those of the gantry as one axis.
            leader: the leader's side.
            sides: all sides.
            event: the event of the table that is the reference.
        """
        self._stop = Action(parameters.ls_dec)
        self._limits = limits_of(parameters)
        self._leader, self._sides = leader, sides
        target = parameters.procedure.target
        self._target = parameters.limit_switch(target, Way.TOWARD) if target else None
        on_limit = event in (Event.LS_RISES, Event.LS_FALLS)
        self._reference = self._target if on_limit else Input.HOME_SWITCH
        self._on_home_switch = event in (Event.HS_RISES, Event.HS_FALLS)
        self._rises = event in (Event.HS_RISES, Event.LS_RISES)
        self._near = parameters.edge_agreement
        self._inputs: Mapping[Side, Mapping[Input, Input]] = {
            side: {
                leaders_input(leader.parameters, side.parameters, own): own
                for own in switch_inputs(side.parameters.inputs)
            }
            for side in sides
        }
        self.levels: dict[Input, GroupLevel] = {}
        self.captures: dict[Input, Captures[Side]] = {}
        self.home: Mapping[Side, Mark] = {}
        self._unresolved: list[GroupEdge[Side]] = []
        self._since = -1e300  # edges from before count no more
        for source in switch_inputs(parameters.inputs):
            captured = source in (Input.HOME_SWITCH, self._target)
            self.levels[source] = GroupLevel(self._levels_of(source), captured)
            if captured:
                levels = {
                    side: bool(self._level(side, source))
                    for side in sides
                    if self._uses(side, source)
                }
                self.captures[source] = Captures(source, levels, leader)
        self.apart = not self._agree()

    def take(self, side: Side, edge: Edge, machine: Machine) -> Edge | None:
        """Take an edge of a side; return the edge for the leader's own queue, if it is one.

        A limit acts at once, whichever side it is on.
        """
        source = self.source(side, edge)
        level = self.levels[source]
        before = level.level
        level.update(self._levels_of(source))
        limit = source in LIMIT_SWITCHES
        if source in self.captures:
            if not self._uses(side, source):
                self._unused(side, source, edge, machine)
                return None
            if limit and edge.rises:
                self._limit_rises(side, source, machine)
            elif limit:
                machine.limit_falls(source)
            side.edges.add(edge)
            return None
        if level.level is before:
            return None
        if limit and edge.rises:
            self._limit_rises(side, source, machine)
        elif limit:
            machine.limit_falls(source)
        if edge.input is not source:
            edge = copy(edge)
            edge.input = source
        return edge

    def located(self, side: Side, edge: Edge) -> GroupEdge[Side] | None:
        """Take an edge whose place is known; return the edge of the group that it completes."""
        captures = self.captures[self.source(side, edge)]
        if edge.time < self._since:
            captures.note(side, edge)
            self.apart = not self._agree()
            return None
        group = captures.add(side, edge)
        self.apart = not self._agree()
        if group is not None:
            group.refresh(self._leader.track)
            if not group.resolved:
                self._unresolved.append(group)
        return group

    def refresh(self) -> None:
        """Locate again those edges of the group whose places may still change."""
        if self._unresolved:
            for edge in self._unresolved:
                edge.refresh(self._leader.track)
            self._unresolved = [edge for edge in self._unresolved if not edge.resolved]

    def forget(self, now: float) -> None:
        """Let edges count from now on only: the followers have moved alone."""
        self._since = now
        for captures in self.captures.values():
            captures.forget()
        self.apart = not self._agree()

    def not_before(self, way: Way) -> list[Side]:
        """Return which sides do not stand before their reference switch yet.

        ``way``: which way the reference is passed.
        """
        captures = self.captures.get(self._reference) if self._reference else None
        return [] if captures is None else captures.not_before(self._rises, way)

    def not_back(self, missing: Sequence[Side], far: float) -> Failure:
        """Return that sides do not come to stand before their reference switch."""
        names, change = ', '.join(side.name for side in missing), 'fall' if self._rises else 'rise'
        source = self._reference or Input.HOME_SWITCH
        return Failure(
            Error.FollowerSwitchMissing,
            f'the {source.text} of {names} did not {change} on the way back, {far:.6g} m beyond '
            'the references',
            'is it stuck, its cable cut, or its hysteresis wider than homing_reverse_distance?',
        )

    @property
    def guards_reference(self) -> bool:
        """Whether the reference is a limit switch."""
        return self._reference in LIMIT_SWITCHES

    def blocked(self, moves: Mapping[Side, float]) -> Failure | None:
        """Return which limit that is on forbids a move of a follower alone."""
        for side, move in moves.items():
            for source, limit in self._limits.items():
                into = move * limit.way > 0.0 and source in self._inputs[side]
                acts = limit.role in (Role.NORMAL, Role.REVERSAL) and limit.action is not None
                if into and acts and self._level(side, source):
                    seen = f'the {limit.name} of {side.name} is on'
                    return Failure(Error.LSTriggered, f'{seen}; a motion into it is not started')
        return None

    def on(self, source: Input) -> list[Side]:
        """Return the sides on which a captured switch is on that they home on."""
        used = [side for side in self._sides if self._uses(side, source)]
        return [side for side in used if self._level(side, source)]

    def source(self, side: Side, edge: Edge) -> Input:
        """Return the input of the group that an edge of a side belongs to."""
        return leaders_input(self._leader.parameters, side.parameters, edge.input)

    def _uses(self, side: Side, source: Input) -> bool:
        """Return whether a side homes on an input of the group."""
        if source not in self._inputs[side] or side.follower is None:
            return source in self._inputs[side]
        p = side.parameters
        on_home = source is Input.HOME_SWITCH
        return p.gantry_homing_use_slave_hs if on_home else p.gantry_homing_use_slave_ls

    def _agree(self) -> bool:
        return all(captures.agree for captures in self.captures.values())

    def _level(self, side: Side, source: Input) -> bool | None:
        return side.readings.switches[self._inputs[side][source]].level

    def _levels_of(self, source: Input) -> list[bool | None]:
        """Return the levels of an input of the group, of the sides that have it in use."""
        captured = source in (Input.HOME_SWITCH, self._target)
        return [
            self._level(side, source)
            for side in self._sides
            if source in self._inputs[side] and (not captured or self._uses(side, source))
        ]

    def _limit_rises(self, side: Side, source: Input, machine: Machine) -> None:
        kind, stopping = machine.row.motion.kind, machine.ending.stopping
        near = kind is Kind.SQUARE or (kind is Kind.BACK and not self._on_home_switch)
        if source is self._target and near:
            return  # the gantry is near its reference: both are bounded
        if source is self._target is self._reference and kind is Kind.HOME and not self._rises:
            home = self.home.get(side)
            if home is not None and side.track.position >= home.position - self._near:
                return  # it is back where this limit has fallen
        if kind is Kind.SQUARE:
            text = f'the {source.text} rose while the followers moved alone'
            machine.fail(Failure(Error.LSTriggered, text), self._stop)
        else:
            machine.limit_rises(source)
        if machine.ending.stopping and not stopping:
            seen, then, hint = machine.ending.message.partition('; ')
            machine.ending.message = f'{seen} (the limit switch of {side.name}){then}{hint}'

    def _unused(self, side: Side, source: Input, edge: Edge, machine: Machine) -> None:
        """Take the edge of a switch that a follower has, but does not home on."""
        motion = machine.row.motion
        into = motion.kind is Kind.SEARCH and motion.way is Way.TOWARD
        if source in LIMIT_SWITCHES and edge.rises and into:
            text = f'the {source.text} of {side.name} rose, which does not home on it'
            machine.fail(Failure(Error.LSTriggered, text), self._stop)


def awaited(row: Row, home_switch: bool) -> bool:
    """Return whether a row waits for an edge of the home switch, or of the target limit."""
    if home_switch:
        return Event.HS_RISES in row.on or Event.HS_FALLS in row.on
    return Event.LS_RISES in row.on or Event.LS_FALLS in row.on


def awaits_rise(row: Row, home_switch: bool) -> bool:
    """Return whether a row waits for a rise of the home switch, or of the target limit."""
    return (Event.HS_RISES if home_switch else Event.LS_RISES) in row.on
