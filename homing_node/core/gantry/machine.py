# SPDX-License-Identifier: Apache-2.0
"""The run of a gantry through the table of its home type, and the rows that come after it.

The table stays as it is: the machine gets the edges of the group. Where the table has found its
reference and the axis rests, the rows of procedures/squaring.py follow: the squaring move and the
proving pass, if they are needed and allowed.
"""

from collections.abc import Callable, Mapping
from math import inf

from ...parameters.axis import AxisParameters
from ...procedures.events import Event
from ...procedures.motions import Kind, Motion, Pace, Way
from ...procedures.procedure import Row
from ...procedures.squaring import (
    PROVED,
    PROVING_BACK,
    SQUARING,
    clears_at_start,
    gantry_rows,
)
from ...procedures.states import Error, Input
from ...procedures.steps import HOME_SHIFT_MOVE, HS_CLEAR_REVERSE_AT_START, Step
from ..latches import EVENTS
from ..machine import Machine
from ..movement import Found, Movement
from ..outcome import Failure
from ..phase import Dynamics
from ..profile import Profile
from ..signals import Edge, Mark
from .edges import GroupEdge, GroupMark
from .run import GantryRun
from .side import Side
from .squaring import SquaringMove

#: How long after the axis rests before its references a switch may still tell that it fell, s.
PATIENCE = 0.1
#: Another Z-pulse is further away than this part of the pitch.
NEAREST_PULSE = 0.4
#: A gantry goes back so often before its references at most; a limit that it comes to on that way
#: gets one try, as the end of the travel is behind it.
MOST_TRIES = 5


class GantryMovement(Movement):
    """Commands the motions of a gantry: those of the table, the squaring move, the way back."""

    __slots__ = ('_run', '_lead', '_back', '_tries', '_rests', '_split', '_square', '_proving')

    def __init__(
        self,
        parameters: AxisParameters,
        profile: Profile,
        now: float,
        feedback: float,
        warn: Callable[[str], None],
        run: GantryRun,
    ) -> None:
        super().__init__(parameters, profile, now, feedback, warn)
        self._dynamics = {pace: Dynamics(*parameters.pace(pace)) for pace in Pace}
        self._run = run
        self._lead = profile.lead
        self._back = feedback
        self._tries = 0
        self._rests = inf
        self._split = False  # some sides stood before their references, and others did not
        self._square: SquaringMove | None = None
        self._proving = False

    def heading(self, motion: Motion, reference: Mark | None) -> tuple[Way, float]:
        """Return which way a motion goes, and where to if it has a target."""
        if motion.kind is Kind.BACK:
            return motion.way, self._back
        return super().heading(motion, reference)

    def turn(self, way: Way, now: float, feedback: float) -> None:
        """Begin a new leg."""
        super().turn(way, now, feedback)
        self._forget_latches()

    def follow(self, feedback: float) -> None:
        """Move the turning point as long as the axis overruns it."""
        if self.leg.update(feedback, self._profile.present):
            self.latches.forget()
            self._forget_latches()

    def _forget_latches(self) -> None:
        for side in self._run.followers:
            side.latches.forget()

    def square(self, moves: Mapping[Side, float]) -> None:
        """Prepare the squaring move."""
        self._square = SquaringMove(self._parameters, self._run.leader, moves, self._lead)

    def prepare_proof(self, now: float) -> None:
        """Prepare the way back before the references, of which each has moved with its side."""
        run, p = self._run, self._parameters
        run.forget_edges(now)
        self._tries, self._rests, self._split = 0, inf, False
        way = run.way
        places = [mark.position - side.offset for side, mark in run.squareness.found.items()]
        first = min(places, key=lambda place: place * way)
        self._back = first - way * self._run_up(p)
        self._proving = True

    def _run_up(self, p: AxisParameters) -> float:
        """Return how far before the references the proving pass begins."""
        slow = self._dynamics[Pace.SLOW]
        ramp = slow.velocity**2 / slow.acceleration
        return max(p.homing_reverse_distance, p.max_skew, ramp)

    def start(self, row: Row, cause: Mark, target: float) -> None:
        """Command the motion of a row; the arguments are those of `Movement.start`."""
        super().start(row, cause, target)
        if row.motion.kind is Kind.BACK:
            self._profile.move(target, self._dynamics[row.motion.pace])

    def _own_event_of(
        self, row: Row
    ) -> Callable[[float, float, float], Found | Failure | None] | None:
        own: Mapping[Kind, Callable[[float, float, float], Found | Failure | None]] = {
            Kind.SQUARE: self._squared,
            Kind.BACK: self._is_back,
        }
        return own.get(row.motion.kind) or super()._own_event_of(row)

    def _squared(self, now: float, feedback: float, interval: float) -> Found | Failure | None:
        assert self._square is not None
        ended = self._square.update(now)
        if isinstance(ended, Failure):
            return ended
        return (Event.DONE, Mark(feedback)) if ended else None

    def _is_back(self, now: float, feedback: float, interval: float) -> Found | Failure | None:
        """Return the end of the way back, once each side stands before its switch again.

        A switch with a wide hysteresis needs a longer way. Where some sides are there, the others
        get one try more.
        """
        if not self._profile.done:
            self._rests = inf
            return None
        self._rests = min(self._rests, now)
        run, step = self._run, self._run_up(self._parameters)
        latched = run.event in EVENTS.values()
        missing = [] if latched else run.switches.not_before(run.way)
        if not missing:
            return Event.DONE, Mark(feedback)
        if now - self._rests <= PATIENCE:
            return None
        into_limit = run.way is Way.AWAY and run.switches.guards_reference
        split = len(missing) < len(run.squareness.found)
        if self._tries == (0 if into_limit else MOST_TRIES) or (split and self._split):
            return run.switches.not_back(missing, (self._tries + 1) * step)
        self._tries, self._rests, self._split = self._tries + 1, inf, split
        self._back -= run.way * step
        self._profile.move(self._back, self._dynamics[Pace.FAST])
        return None

    def _latched(self, now: float, feedback: float, interval: float) -> Found | Failure | None:
        """Return the latches of all sides once each has its own."""
        run, cause, way = self._run, self._cause, self._row.motion.way
        if not cause.resolved:
            return None
        event = self._row.latches[0]
        source = next(one for one, of in EVENTS.items() if of is event)
        found: dict[Side, Mark] = {}
        missing: list[Side] = []
        for side in run.sides:
            if not _latches_on(side, source):
                continue
            if side.follower is None:
                one = self._leaders_latch(way, feedback, interval, now)
            else:
                one = side.latches.found(
                    self._row.latches, self._origin(side, way), way, side.track.position
                )
            if isinstance(one, Failure):
                return one
            if one is None:
                missing.append(side)
            else:
                found[side] = one[1]
        if not missing:
            return event, GroupMark(found[run.leader], found)
        if found:
            first = next(iter(found))
            return run.rules.missing_latch(first, found[first], missing, event, self.leg.since)
        return None

    def _leaders_latch(
        self, way: Way, feedback: float, interval: float, now: float
    ) -> Found | Failure | None:
        if not self._proving:
            return super()._latched(now, feedback, interval)
        return self.latches.found(
            self._row.latches, self._origin(self._run.leader, way), way, feedback
        )

    def _origin(self, side: Side, way: Way) -> float:
        """Return beyond where the latches of a side count."""
        run, cause = self._run, self._cause
        if self._proving:
            reach, pitch = self._run_up(self._parameters), self.latches.pitch
            reach = min(reach, NEAREST_PULSE * pitch) if pitch else reach
            return run.squareness.found[side].position - way * reach
        if isinstance(cause, GroupEdge) and side in cause.parts:
            return float(cause.parts[side].position)
        begin = cause.position if isinstance(cause, Edge) else self.leg.feedback
        return begin + side.offset + side.shift


def _latches_on(side: Side, source: Input) -> bool:
    """Return whether a side homes on a latch."""
    p = side.parameters
    if source not in p.inputs or side.follower is None:
        return source in p.inputs
    if source is Input.Z_PULSE:
        return p.gantry_homing_use_slave_z_pulse
    return p.gantry_homing_use_slave_touch_probe


class GantryMachine(Machine):
    """One run of a gantry."""

    __slots__ = ('run',)
    movement: GantryMovement

    def __init__(self, run: GantryRun, profile: Profile, now: float, feedback: float) -> None:
        super().__init__(run.parameters, profile, run.switches.levels, now, feedback)
        self.run = run
        self._rows = dict(gantry_rows(self.procedure))
        self.movement = GantryMovement(self.parameters, profile, now, feedback, self.warn, run)
        run.start(self)

    def _first_step(self) -> Step:
        """Return the step in which the run begins: off a home switch that is on."""
        if (
            clears_at_start(self.procedure)
            and self._switches.on(Input.HOME_SWITCH)
            and not self._limits.reversing(self.feedback)
        ):
            return HS_CLEAR_REVERSE_AT_START
        return super()._first_step()

    def update(self, now: float, feedback: float, interval: float = 0.0, age: float = 0.0) -> None:
        """Follow the motion for a cycle; the run has not finished while a follower moves."""
        super().update(now, feedback, interval, age)
        if self.finished and not self.ending.silent:
            self.finished = all(
                side.follower is None
                or side.follower.profile is None
                or side.follower.profile.done
                for side in self.run.sides
            )

    def latch(self, source: Input, position: float) -> None:
        """Record a latched position of the leader."""
        super().latch(source, position)
        self.run.leader.seen.latch(source, position, self.now, self.profile.velocity)

    def _stuck_hint(self, error: Error) -> str:
        """Return a hint at the home switches that are still on, or ''."""
        sides = ', '.join(side.name for side in self.run.switches.on(Input.HOME_SWITCH))
        return self._switches.stuck_hint(error, self.row, f' of {sides}') if sides else ''

    def _advance(self, event: Event, cause: Mark) -> None:
        """Follow an arrow; the proving pass is no pass of the table, which must agree."""
        coarse = self.passes.coarse
        super()._advance(event, cause)
        if self.step is PROVED:
            self.passes.coarse = coarse

    def _enter(self, step: Step, cause: Mark) -> None:
        """Enter a row; square the gantry before the last move, or prove that it is square."""
        if step is HOME_SHIFT_MOVE:
            failure, step = self._judged(self.step is PROVED)
            if failure is not None:
                self.fail(failure)
                return
        elif step is PROVING_BACK:
            self.movement.prepare_proof(self.now)
        super()._enter(step, cause)

    def _judged(self, proved: bool) -> tuple[Failure | None, Step]:
        """Return what follows the reference: the last move, the squaring move, or the end."""
        run = self.run
        if proved:
            found = self.passes.mean
            run.measure([self._cause])
            failure = run.squareness.unproven()
            failure = failure or run.squareness.moved(found, self.parameters.edge_agreement)
            return failure, HOME_SHIFT_MOVE
        run.measure(self.passes.fine)
        moves = run.squareness.moves()
        if isinstance(moves, Failure):
            return moves, HOME_SHIFT_MOVE
        if not moves:
            return None, HOME_SHIFT_MOVE
        blocked = run.switches.blocked(moves)
        if blocked is not None:
            return blocked, HOME_SHIFT_MOVE
        self.movement.square(moves)
        if not self.parameters.timeout:
            self.rules.deadline += self._proof_time(max(map(abs, moves.values())))
        return None, SQUARING

    def _proof_time(self, move: float) -> float:
        """Return how long the squaring move and the proving pass may take, s."""
        p = self.parameters
        way = 2.0 * (p.max_skew + max(p.homing_reverse_distance, p.max_skew) + p.search_distance)
        return 1.5 * (2.0 + (move + way) / p.homing_velocity_slow + way / p.homing_velocity_fast)
