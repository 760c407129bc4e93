# SPDX-License-Identifier: Apache-2.0
"""One run of a gantry: its sides together, for its machine.

Who gets which part of it: the switches of all sides as one (switches.py), the rules that
hold in every state (rules.py), how square it is (squareness.py).
"""

from collections.abc import Mapping, Sequence

from ...parameters.axis import AxisParameters
from ...procedures.procedure import Row
from ...procedures.squaring import reference_of
from ...procedures.states import Error, Input
from ..edge_queue import EdgeQueue
from ..machine import Machine
from ..outcome import Failure, MemberHome
from ..profile import Profile
from ..settling import Settling
from ..signals import Edge, Mark
from ..track import Track
from .rules import GantryRules
from .side import Side
from .squareness import Squareness
from .switches import GantrySwitches, awaited


class GantryRun:
    """The sides of a gantry in one run.

    Attributes:
        parameters: those of the gantry as one axis.
        leader: the leader's side.
        followers: the sides of the followers.
        sides: all sides, the leader's first.
        event: the event of the table that is the reference.
        way: which way the reference is passed.
        switches: the switches of all sides.
        rules: what holds in every state.
        squareness: how square it is.
    """

    def __init__(
        self,
        parameters: AxisParameters,
        leader: Side,
        followers: Sequence[Side],
        profile: Profile,
        apart: Sequence[float] = (),
    ) -> None:
        """Begin a run; all sides rest.

        Args:
            parameters: those of the gantry as one axis.
            leader: the leader's side.
            followers: the followers' sides.
            profile: the leader's path.
            apart: how far the followers' feedback is ahead of the leader's where no side is
                ahead; (): as they stand.
        """
        self.parameters, self.leader, self.followers = parameters, leader, tuple(followers)
        self.sides = (leader, *followers)
        self.event, self.way = reference_of(parameters.procedure)
        for side in followers:
            side.apart = side.at_start = side.track.position - leader.track.position
        for side, known in zip(followers, apart, strict=bool(apart)):
            side.apart = known
        self.switches = GantrySwitches(parameters, leader, self.sides, self.event)
        self.rules = GantryRules(parameters, self.sides, self.switches, profile)
        self.squareness = Squareness(parameters, self.sides, self.event)
        self._takes: list[tuple[EdgeQueue, _EdgesOfSide, Track]] = []

    def start(self, machine: Machine) -> None:
        """Work for a machine from now on."""
        self._takes = [
            (side.edges, _EdgesOfSide(self, side, machine), side.track) for side in self.sides
        ]

    def update(self, machine: Machine, now: float) -> None:
        """Give the machine the edges of the group; end the run if a rule is broken."""
        for edges, takes, track in self._takes:
            edges.update(takes, track)
        self.switches.refresh()
        failure = self.rules.broken(machine, now)
        if failure is not None:
            machine.fail(failure)

    def edge(self, side: Side, edge: Edge, machine: Machine) -> None:
        """Take an edge of a side whose place is known."""
        side.seen.edge(edge)
        group = self.switches.located(side, edge)
        if group is None:
            return
        home_switch = group.input is Input.HOME_SWITCH
        apart = self.rules.apart(group) if awaited(machine.row, home_switch) else None
        if apart is not None:
            machine.fail(apart)
        else:
            machine.edge(group)

    def measure(self, marks: Sequence[Mark]) -> None:
        """Take where each side has found its reference, in one pass or more."""
        self.squareness.measure(marks)
        self.switches.home = self.squareness.found

    def at_rest(self, settling: Mapping[Side, Settling]) -> Failure | None:
        """Return why the gantry is not square where it rests; `settling`: that of each side."""
        places: dict[Side, float] = {}
        for side in self.sides:
            place = settling[side].place(side.track)
            if place is None:
                return Failure(
                    Error.FeedbackStale,
                    f'{side.name}: the feedback ended before it had come to rest, so nothing says '
                    'whether the gantry is square',
                )
            places[side] = place
        return self.squareness.at_rest(places)

    @property
    def members(self) -> tuple[MemberHome, ...]:
        """The drives as they are now, raw: the leader, then its followers."""
        return tuple(self._member(side) for side in self.sides)

    def _member(self, side: Side) -> MemberHome:
        follower, sign = side.follower, self.leader.parameters.home_direction.sign
        own = side.parameters.home_direction.sign
        found = self.squareness.found.get(side)
        error = self.squareness.errors.get(side)
        skew = self.rules.skew(side, side.at_start)[0] if follower else 0.0
        return MemberHome(
            follower.short if follower else side.name,
            side.parameters.joint or side.name,
            own * side.track.position,
            sign * skew,
            own * found.position if found else 0.0,
            sign * error.value if error else 0.0,
            error.uncertainty if error else 0.0,
        )

    def forget_edges(self, now: float) -> None:
        """Let edges and latches count from now on only: the followers have moved alone."""
        self.switches.forget(now)
        for side in self.sides:
            side.latches.forget()


class _EdgesOfSide:
    """What takes the edges of a side from its queue."""

    def __init__(self, run: GantryRun, side: Side, machine: Machine) -> None:
        self._run, self._side, self._machine = run, side, machine
        self.way_at = machine.way_at

    @property
    def row(self) -> Row:
        return self._machine.row

    def edge(self, edge: Edge) -> None:
        self._run.edge(self._side, edge, self._machine)
