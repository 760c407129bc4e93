# SPDX-License-Identifier: Apache-2.0
"""One run of a gantry: its sides, what holds for all of them, and how square it is.

The rules of a gantry stand here, beside the table of the home type (doc/gantry.md):

- Skew: no side may get further ahead of the leader than `max_skew`, compared at equal times.
- A reference edge counts when the last side's is captured; after the first one the others must
  come within `max_skew` and their offsets.
- A limit of any side, a stale input of any side, a following error of any side stop all.

Positions are in the *toward* frame, m or rad; times in s are passed in.
"""

from collections.abc import Mapping, Sequence
from copy import copy
from statistics import fmean

from ..parameters.axis import AxisParameters, switch_inputs
from ..parameters.gantry import leaders_input
from ..procedures.events import Event
from ..procedures.motions import Kind, Way
from ..procedures.procedure import Row
from ..procedures.squaring import reference_of
from ..procedures.states import LIMIT_SWITCHES, Error, Input
from .edge_queue import EdgeQueue
from .gantry_edges import Captures, GroupEdge, GroupLevel, GroupMark, least_uncertainty
from .gantry_follower import Follower
from .latches import Latches
from .limits import Action
from .machine import Machine
from .outcome import Failure
from .profile import Profile
from .readings import Readings
from .signals import Edge, Mark
from .track import Track

#: A message of a switch may be so late, s: before that its edge is not missing.
LATE = 0.05
#: The parts of a pitch by which squareness may differ from a whole number of pitches.
OFF_PITCH = 0.25


class Side:
    """One side of a gantry in a run: the leader's, or a follower's.

    Attributes:
        name: for messages: the axis, or the full name of the follower.
        parameters: its parameters.
        readings: what it has received.
        follower: the follower; None for the leader.
        shift: its `switch_offset`.
        apart: its feedback less the leader's when they last stood where they shall.
        at_start: the same at the start of the run.
        edges: its edges that wait for its feedback.
        latches: its latched positions since the axis turned.
    """

    def __init__(
        self,
        name: str,
        parameters: AxisParameters,
        readings: Readings,
        leader: AxisParameters,
        follower: Follower | None = None,
    ) -> None:
        self.name, self.parameters, self.readings = name, parameters, readings
        self.follower = follower
        self.shift = leader.home_direction.sign * parameters.switch_offset if follower else 0.0
        self.apart = self.at_start = 0.0
        self.edges = EdgeQueue(parameters)
        self.latches = Latches(parameters)

    @property
    def track(self) -> Track:
        return self.readings.track

    @property
    def offset(self) -> float:
        """Its command less the leader's, while all move together."""
        return self.follower.offset if self.follower else 0.0


class Squareness:
    """How far a side is out of square, and how far that may be off, m or rad."""

    __slots__ = ('error', 'uncertainty')

    def __init__(self, error: float, uncertainty: float) -> None:
        self.error, self.uncertainty = error, uncertainty


class GantryRun:
    """The sides of a gantry in one run.

    Attributes:
        leader: the leader's side.
        followers: the sides of the followers.
        levels: the switches of the group, for the machine.
        squareness: of each side that has a reference, as it was found last.
        found: the newest reference of each side.
        largest_skew: the largest |skew| so far.
        profile: the leader's path.
    """

    def __init__(
        self,
        parameters: AxisParameters,
        leader: Side,
        followers: Sequence[Side],
        profile: Profile,
    ) -> None:
        """Begin a run; all sides rest.

        Args:
            parameters: those of the gantry as one axis.
            leader: the leader's side.
            followers: the followers' sides.
            profile: the leader's path.
        """
        self.parameters, self.leader, self.followers = parameters, leader, followers
        self.sides = (leader, *followers)
        self.profile = profile
        self.squareness: dict[Side, Squareness] = {}
        self.found: dict[Side, Mark] = {}
        self.largest_skew = 0.0
        self.machine: Machine | None = None  # by `start`
        self._takes: list[tuple[Side, _EdgesOfSide]] = []
        self.event, self.way = reference_of(parameters.procedure)
        for side in followers:
            side.apart = side.at_start = side.track.position - leader.track.position
        self._since = -1e300  # edges from before count no more
        self._unresolved: list[GroupEdge[Side]] = []
        self._unsettled_start = leader.track.position
        target = parameters.procedure.target
        self._target = parameters.limit_switch(target, Way.TOWARD) if target else None
        self._inputs: dict[Side, dict[Input, Input]] = {
            side: {
                leaders_input(leader.parameters, side.parameters, own): own
                for own in switch_inputs(side.parameters.inputs)
            }
            for side in self.sides
        }
        self.levels: dict[Input, GroupLevel] = {}
        self.captures: dict[Input, Captures[Side]] = {}
        for source in switch_inputs(parameters.inputs):
            captured = source is Input.HOME_SWITCH or source is self._target
            self.levels[source] = GroupLevel(self._levels_of(source), captured)
            if captured:
                levels = {
                    side: bool(self._level(side, source))
                    for side in self.sides
                    if self._uses(side, source)
                }
                self.captures[source] = Captures(source, levels, leader)

    # ------------------------------------------------------------------------------- the switches

    def _uses(self, side: Side, source: Input) -> bool:
        """Return whether a side homes on an input of the group."""
        if source not in self._inputs[side] or side.follower is None:
            return source in self._inputs[side]
        p = side.parameters
        on_home = source is Input.HOME_SWITCH
        return p.gantry_homing_use_slave_hs if on_home else p.gantry_homing_use_slave_ls

    def _level(self, side: Side, source: Input) -> bool | None:
        return side.readings.switches[self._inputs[side][source]].level

    def _levels_of(self, source: Input) -> list[bool | None]:
        """Return the levels of an input of the group, of the sides that have it in use."""
        captured = source is Input.HOME_SWITCH or source is self._target
        return [
            self._level(side, source)
            for side in self.sides
            if source in self._inputs[side] and (not captured or self._uses(side, source))
        ]

    def take(self, side: Side, edge: Edge) -> Edge | None:
        """Take an edge of a side; return the edge for the leader's own queue, if it is one.

        A limit acts at once, whichever side it is on.
        """
        source = leaders_input(self.leader.parameters, side.parameters, edge.input)
        level = self.levels[source]
        before = level.level
        level.update(self._levels_of(source))
        machine = self.machine
        assert machine is not None
        limit = source in LIMIT_SWITCHES
        if source in self.captures:
            if not self._uses(side, source):
                self._unused(side, source, edge)
                return None
            if limit and edge.rises:
                self._limit_rises(side, source)
            elif limit:
                machine.limit_falls(source)
            side.edges.add(edge)
            return None
        if level.level is before:
            return None
        if limit and edge.rises:
            self._limit_rises(side, source)
        elif limit:
            machine.limit_falls(source)
        if edge.input is not source:
            edge = copy(edge)
            edge.input = source
        return edge

    def _limit_rises(self, side: Side, source: Input) -> None:
        machine = self.machine
        assert machine is not None
        before = machine.ending.stopping
        if machine.row.motion.kind is Kind.BACK and source is self._target:
            return  # it homes where the limit falls, and comes to it again
        if machine.row.motion.kind is Kind.SQUARE:
            text = f'the {source.text} rose while the followers moved alone'
            machine.fail(Failure(Error.LSTriggered, text), Action(self.parameters.ls_dec))
        else:
            machine.limit_rises(source)
        if machine.ending.stopping and not before:
            machine.ending.message += f' (the limit switch of {side.name})'

    def _unused(self, side: Side, source: Input, edge: Edge) -> None:
        """Take the edge of a switch that a follower has, but does not home on."""
        machine = self.machine
        assert machine is not None
        row = machine.row
        into = row.motion.kind is Kind.SEARCH and row.motion.way is Way.TOWARD
        if source in LIMIT_SWITCHES and edge.rises and into:
            text = f'the {source.text} of {side.name} rose, which does not home on it'
            machine.fail(Failure(Error.LSTriggered, text), Action(self.parameters.ls_dec))

    def forget_edges(self, now: float) -> None:
        """Let edges count from now on only: the followers have moved alone."""
        self._since = now
        for captures in self.captures.values():
            captures.forget()
        for side in self.sides:
            side.latches.forget()

    def passed_back(self) -> bool:
        """Return whether each side has passed its reference switch since it turned."""
        captures = self.captures.get(self._reference_input)
        return captures is None or all(captures.passed(side) for side in captures.sides)

    @property
    def _reference_input(self) -> Input:
        on_limit = self.event in (Event.LS_RISES, Event.LS_FALLS)
        return self._target if on_limit and self._target else Input.HOME_SWITCH

    # --------------------------------------------------------------------------------- each cycle

    def update(self, now: float) -> None:
        """Give the machine the edges of the group; end the run if a rule is broken."""
        machine = self.machine
        assert machine is not None
        for side, takes in self._takes:
            side.edges.update(takes, side.track)
        if self._unresolved:
            for edge in self._unresolved:
                edge.refresh(self.leader.track)
            self._unresolved = [edge for edge in self._unresolved if not edge.resolved]
        failure = self._stale(now) or self._skewed(machine) or self._lagging(machine, now)
        failure = failure or self._missing(machine)
        if failure is not None:
            machine.fail(failure)

    def start(self, machine: Machine) -> None:
        """Work for a machine from now on."""
        self.machine = machine
        self._takes = [(side, _EdgesOfSide(self, side, machine)) for side in self.sides]

    def edge(self, side: Side, edge: Edge, machine: Machine) -> None:
        """Take an edge of a side whose place is known."""
        if edge.time < self._since:
            return
        source = leaders_input(self.leader.parameters, side.parameters, edge.input)
        group = self.captures[source].add(side, edge)
        if group is None:
            return
        group.refresh(self.leader.track)
        if not group.resolved:
            self._unresolved.append(group)
        apart = self._apart(group) if _awaited(machine.row, source is Input.HOME_SWITCH) else None
        if apart is not None:
            machine.fail(apart)
        else:
            machine.edge(group)

    def _stale(self, now: float) -> Failure | None:
        for side in self.followers:
            p = side.parameters
            if now - side.readings.arrival > p.feedback_timeout or p.switch_timeout:
                stale = side.readings.stale(now)
                if stale is not None:
                    return stale._replace(seen=f'{side.name}: {stale.seen}')
        return None

    def skew(self, side: Side, since: float | None = None) -> tuple[float, float]:
        """Return how far a side is ahead of the leader, and how far that may be off.

        Both places are those of the newest time that both feedbacks know.

        Args:
            side: the side.
            since: where it was ahead of the leader by nothing; by default `apart`.
        """
        one, other = side.track, self.leader.track
        time = min(one.time, other.time)
        apart = side.apart if since is None else since
        unsure = abs(self.profile.velocity) * sum(
            track.doubt + track.late_readings for track in (one, other)
        )
        return _at(one, time) - _at(other, time) - apart, unsure

    def _skewed(self, machine: Machine) -> Failure | None:
        limit = self.parameters.max_skew
        if machine.row.motion.kind is Kind.SQUARE:
            return None  # squaring.py bounds that move
        for side in self.followers:
            skew, unsure = self.skew(side)
            self.largest_skew = max(self.largest_skew, abs(skew))
            if abs(skew) - unsure > limit:
                ahead = 'ahead of' if skew > 0.0 else 'behind'
                return Failure(
                    Error.SkewTooLarge,
                    f'{side.name} is {abs(skew):.6g} m {ahead} the leader, more than {limit:.6g} '
                    'm (max_skew)',
                    'is a side jammed, its motor off, its encoder inverted, or its cable swapped?',
                )
        return None

    def _lagging(self, machine: Machine, now: float) -> Failure | None:
        for side in self.followers:
            track, follower = side.track, side.follower
            assert follower is not None
            behind = follower.commanded() - track.position
            then = follower.commanded(min(max(0.0, now - track.time), LATE)) - track.position
            failure = machine.rules.lags(behind, then, now, track.interval)
            if failure is not None:
                return failure._replace(seen=f'{side.name}: {failure.seen}')
        return None

    def _missing(self, machine: Machine) -> Failure | None:
        """Return which side has not found its switch, though another one has."""
        row = machine.row
        if row.motion.kind is not Kind.SEARCH:
            return None
        for source, captures in self.captures.items():
            if not _awaited(row, source is Input.HOME_SWITCH):
                continue
            found = captures.pending
            if found is not None:
                edge, first, missing = found
                if captures.way != row.motion.way:
                    continue  # a bounce from before it turned
                failure = self._too_far(first, edge.time, missing, source.text, edge.uncertainty)
                if failure is not None:
                    return failure
            elif stuck := captures.stuck:
                far = abs(self.leader.track.position - self._unsettled_start)
                reach = self._reach(stuck[0], self.leader)
                if far > 2.0 * reach + self.parameters.homing_reverse_distance:
                    return self._no_switch(stuck, source.text, far, 'fall', 'others are off')
        return None

    def missing_latch(
        self, first: Side, mark: Mark, missing: Sequence[Side], event: Event
    ) -> Failure | None:
        """Return which side has not latched a reference, though another one has."""
        time = _time_at(first.track, mark.position)
        pitch = self.parameters.z_pulse_distance_check if event is Event.Z_PULSE else 0.0
        text = 'Z-pulse' if event is Event.Z_PULSE else 'touch probe'
        return self._too_far(first, time, missing, text, mark.uncertainty + pitch)

    def _apart(self, group: GroupEdge[Side]) -> Failure | None:
        """Return which side has passed its switch too far from the first one."""
        track = self.leader.track
        first = min(group.parts, key=lambda side: group.parts[side].time)
        place, unsure = _at(track, group.parts[first].time), group.parts[first].uncertainty
        for side, edge in group.parts.items():
            far = abs(_at(track, edge.time) - place)
            if far > self._reach(side, first) + unsure + edge.uncertainty:
                return self._no_switch(
                    [side], edge.input.text, far, 'change', f'{first.name} had passed its own'
                )
        return None

    def _too_far(
        self, first: Side, time: float, missing: Sequence[Side], what: str, more: float
    ) -> Failure | None:
        track = self.leader.track
        known = min(side.track.time for side in self.sides) - LATE
        if known <= time:
            return None
        far = abs(_at(track, known) - _at(track, time))
        late = [side for side in missing if far > self._reach(side, first) + more]
        if not late:
            return None
        return self._no_switch(late, what, far, 'change', f'{first.name} has passed its own')

    def _reach(self, side: Side, first: Side) -> float:
        """Return how far apart the references of two sides may be."""
        return self.parameters.max_skew + abs(side.shift - first.shift)

    def _no_switch(
        self, sides: Sequence[Side], what: str, far: float, change: str, other: str
    ) -> Failure:
        names = ', '.join(side.name for side in sides)
        return Failure(
            Error.FollowerSwitchMissing,
            f'the {what} of {names} did not {change} within {far:.6g} m, though {other} '
            '(max_skew and switch_offset)',
            'is it dead or stuck, its cable cut, or its polarity wrong?',
        )

    # --------------------------------------------------------------------------------- squareness

    def measure(self, marks: Sequence[Mark]) -> None:
        """Take where each side has found its reference, in one pass or more."""
        passes = [mark.parts for mark in marks if isinstance(mark, GroupEdge | GroupMark)]
        if not passes:
            return
        self.found = dict(passes[-1])
        self.squareness = {}
        for side in self.followers:
            parts = [parts for parts in passes if side in parts and self.leader in parts]
            if parts:
                apart = fmean(one[side].position - one[self.leader].position for one in parts)
                self.squareness[side] = Squareness(
                    apart - side.offset - side.shift,
                    max(
                        least_uncertainty(one[side], side.readings.finest)
                        + least_uncertainty(one[self.leader], self.leader.readings.finest)
                        for one in parts
                    ),
                )

    def moves(self) -> Failure | Mapping[Side, float]:
        """Return by how much each follower must move to be square, or why it must not."""
        p = self.parameters
        errors = {side: found.error for side, found in self.squareness.items()}
        for side, error in errors.items():
            ambiguous = self._ambiguous(side, error)
            if ambiguous is not None:
                return ambiguous
        low, high = min(errors.values(), default=0.0), max(errors.values(), default=0.0)
        low, high = min(low, 0.0), max(high, 0.0)
        if high - low > p.max_skew:
            listed = ', '.join(f'{side.name} by {error:.6g} m' for side, error in errors.items())
            return Failure(
                Error.SkewTooLarge,
                f'out of square: {listed}; that is more than {p.max_skew:.6g} m (max_skew), and '
                'is not forced',
                'is switch_offset right? Else free the gantry with its drives off',
            )
        if not p.square or p.gantry_homing_retain_sync_offset:
            return {}
        return {side: error for side, error in errors.items() if abs(error) > p.square_tolerance}

    def _ambiguous(self, side: Side, error: float) -> Failure | None:
        """Return why the Z-pulse of a side may belong to another turn."""
        pitch = self.leader.latches.pitch
        if self.event is not Event.Z_PULSE or not pitch:
            return None
        turns = round(abs(error) / pitch)
        if not turns or abs(abs(error) - turns * pitch) > OFF_PITCH * pitch:
            return None
        return Failure(
            Error.IndexAmbiguous,
            f'the Z-pulse of {side.name} is {error:.6g} m from where it belongs, about '
            f'{turns} x {pitch:.6g} m, the distance of the pulses',
            "does its home switch arm the pulse of the same turn as the leader's?",
        )

    def unproven(self) -> Failure | None:
        """Return which side is not square, though it was squared."""
        for side, found in self.squareness.items():
            limit = self.parameters.square_tolerance + found.uncertainty
            if abs(found.error) > limit:
                return Failure(
                    Error.NotSquare,
                    f'after the squaring move {side.name} is {found.error:.6g} m out of square, '
                    f'more than {self.parameters.square_tolerance:.6g} m (square_tolerance) and '
                    f'the uncertainty, {found.uncertainty:.6g} m',
                    'are the cables of two sides swapped, or is a coupling loose?',
                )
        return None


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


def _at(track: Track, time: float) -> float:
    """Return the position at a time; after the newest reading it is that reading's."""
    if not track.samples or time >= track.samples[-1][0]:
        return track.position
    return track.at(time)


def _time_at(track: Track, position: float) -> float:
    """Return when a track was last at a position."""
    newer = track.samples[-1]
    for older in reversed(track.samples):
        if (older[1] - position) * (newer[1] - position) <= 0.0:
            return older[0]
        newer = older
    return newer[0]


def _awaited(row: Row, home_switch: bool) -> bool:
    """Return whether a row waits for an edge of the home switch, or of the target limit."""
    if home_switch:
        return Event.HS_RISES in row.on or Event.HS_FALLS in row.on
    return Event.LS_RISES in row.on or Event.LS_FALLS in row.on
