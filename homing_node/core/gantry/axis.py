# SPDX-License-Identifier: Apache-2.0
"""A gantry: an axis with followers, which homes square. No clock, no thread, no I/O.

The leader is an axis like any other; its run is that of the whole gantry. Give the followers
their messages as the axis gets its own, then call :meth:`GantryAxis.update`: it returns the
leader's setpoint, and each follower has its own. What is particular to a gantry is explained in
doc/gantry.md.
"""

from collections.abc import Mapping
from typing import Any

from ...parameters.axis import AxisParameters
from ...parameters.definition import InvalidParameters
from ...parameters.gantry import group_parameters
from ...procedures.motions import Kind
from ...procedures.states import Error, Input
from ..axis import VELOCITY_SPAN, Setpoint
from ..ending import Ending
from ..jog import Jog
from ..machine import Machine
from ..outcome import MemberHome, Outcome
from ..profile import Profile
from ..readings import Readings
from ..remembered import Remembered, Seen
from ..settling import jammed
from ..signals import Edge
from .follower import Follower
from .home import GantryHome
from .machine import GantryMachine
from .run import GantryRun
from .side import Side


class GantryAxis(GantryHome):
    """An axis with followers.

    Attributes:
        followers: its followers.
        largest_skew: the largest |skew| in the run in progress or in the last one, m or rad.
    """

    #: The class of the followers.
    follower_class: type[Follower] = Follower

    def __init__(
        self,
        name: str,
        parameters: AxisParameters,
        period: float,
        lead: float,
        followers: Mapping[str, AxisParameters],
    ) -> None:
        """Make a gantry at rest.

        Args:
            name: the name of the axis.
            parameters: the leader's parameters.
            period: the period of the cycle, s.
            lead: how long before its time a setpoint is told, s.
            followers: the parameters of the followers, by their full names.
        """
        self.followers: tuple[Follower, ...] = ()
        self.largest_skew = 0.0
        self._run: GantryRun | None = None
        self._group = group_parameters(parameters, followers.values())
        super().__init__(name, parameters, period, lead)
        self.followers = tuple(
            self.follower_class(full_name, own, self) for full_name, own in followers.items()
        )
        self._ended = self._members_at_rest()
        self.configure(parameters)

    def configure(
        self, parameters: AxisParameters, followers: Mapping[str, AxisParameters] | None = None
    ) -> None:
        """Use new parameters; ``followers``: those of the followers, by their full names.

        The directions stay: with another one a side would be driven against the others.

        Raises:
            RuntimeError: a run is in progress.
            InvalidParameters: a direction is another one than before.
        """
        before = {full: drive.parameters for full, drive in self.drives.items()}
        after = {self.name: parameters, **(followers or {})}
        if self.followers and not self.running:
            turned = [
                f'{full}.home_direction: {p.home_direction} was {before[full].home_direction} at '
                'the start; a gantry keeps it until the next start'
                for full, p in after.items()
                if p.home_direction is not before[full].home_direction
            ]
            if turned:
                raise InvalidParameters(turned)
        super().configure(parameters)
        for follower in self.followers:
            follower.configure((followers or {}).get(follower.name, follower.parameters))
        own = [follower.parameters for follower in self.followers]
        self._group = group_parameters(parameters, own)
        self.profile = Profile(self.period, self._group.max_jerk, lead=self.lead)

    @property
    def drives(self) -> Mapping[str, Any]:
        """The axis and its followers, which all receive messages, by their full names."""
        return {self.name: self, **{follower.name: follower for follower in self.followers}}

    @property
    def seen_by_drive(self) -> Mapping[str, Seen]:
        """The edges of the captured switches, and the latches, of each drive in the run."""
        run = self._run
        if run is None or self.machine is None:
            return {}
        return {**super().seen_by_drive, **{side.name: side.seen for side in run.sides}}

    # ------------------------------------------------------------------------- what followers tell

    def take_from(self, follower: Follower, edge: Edge) -> None:
        """Take an edge of a follower's switch."""
        if self._run is not None and self.machine is not None:
            self._take_side(self._run.followers[self.followers.index(follower)], edge)

    def latch_from(self, follower: Follower, source: Input, position: float) -> None:
        """Take a latched position of a follower, in its *toward* frame."""
        if self._run is not None and self.machine is not None:
            side = self._run.followers[self.followers.index(follower)]
            side.seen.latch(source, position, self.machine.now, self.profile.velocity)
            side.latches.add(source, position)

    # ----------------------------------------------------------------------------------- requests

    def refusal(self, now: float, verify: bool = False) -> Outcome | None:
        """Return why a run cannot start now, None if it can."""
        if verify and not self.running:
            return self._failed(
                Error.InvalidParameter, 'a gantry cannot be verified; home it instead'
            )
        found = super().refusal(now, verify)
        if found is not None:
            return found
        for follower in self.followers:
            readings = follower.readings
            unready = readings.unready(now, follower.parameters.joint) or readings.motion()
            if unready is not None:
                return self._failed(unready.error, f'{follower.name}: {unready.seen}')
        leader, limit = self.readings.track.position, self._group.max_skew
        for follower, apart in zip(self.followers, self._apart, strict=bool(self._apart)):
            skew = follower.readings.track.position - leader - apart
            if abs(skew) > limit:
                ahead = 'ahead of' if skew > 0.0 else 'behind'
                return self._failed(
                    Error.SkewTooLarge,
                    f'{follower.name} is {abs(skew):.6g} m {ahead} the leader, more than '
                    f'{limit:.6g} m (max_skew), since before the run that failed: square the '
                    'gantry, then switch its servo off and on',
                )
        return None

    def jog_refusal(self, now: float, jog: Jog) -> Outcome | None:
        """Return why the gantry cannot jog."""
        return self._failed(Error.InvalidParameter, 'a gantry cannot jog: home it instead')

    def _new_machine(self, now: float, known: Remembered | None) -> Machine:
        """Return the run that begins, of all sides."""
        leader = Side(self.name, self.parameters, self.readings, self.parameters)
        sides = []
        for follower in self.followers:
            follower.begin(self.profile.position)
            sides.append(
                Side(
                    follower.name,
                    follower.parameters,
                    follower.readings,
                    self.parameters,
                    follower,
                )
            )
        self._run = GantryRun(self._group, leader, sides, self.profile, self._apart)
        return GantryMachine(self._run, self.profile, now, self.readings.track.position)

    def cycles_were_missed(self, elapsed: float) -> None:
        """Take that no cycle came for a time, s."""
        super().cycles_were_missed(elapsed)
        if self.machine is not None and self._moved:
            for follower in self.followers:
                if follower.profile is not None:
                    follower.profile.skip(elapsed)

    def time_jumped_back(self, now: float) -> None:
        """Forget the times of all that was received, because simulated time jumped back."""
        super().time_jumped_back(now)
        for follower in self.followers:
            follower.time_jumped_back(now)
        for side in self._run.sides if self._run is not None else ():
            side.edges.clear()

    # --------------------------------------------------------------------------------- each cycle

    def update(self, now: float) -> Setpoint | None:
        """Advance by one period; return the leader's setpoint if a run moves the gantry."""
        machine, run = self.machine, self._run
        moving = self.profile.velocity != 0.0
        self._watch_trip(now)
        for follower in self.followers:
            readings, own = follower.readings, follower.profile
            if follower.returning:
                follower.come_back()
            readings.moving = moving or (own is not None and own.velocity != 0.0)
            if readings.unsettled:
                follower.settle(now)
            follower.setpoint = None
        if machine is None or run is None:
            if self.homed:
                self._watch_followers(now)
            return super().update(now)
        if not machine.finished:
            stopping = machine.ending.stopping
            run.update(machine, now)
            if machine.ending.error is Error.FollowingError and not stopping:
                self._stop_where_it_is(machine, now)
            elif machine.ending.stopping:
                for follower in self.followers:
                    follower.brake(machine.ending.demanded)
        setpoint = super().update(now)
        self.largest_skew = run.rules.largest_skew
        if setpoint is not None:
            for follower in self.followers:
                follower.advance()
        return setpoint

    def _watch_followers(self, now: float) -> None:
        """Lose the home if the feedback of a follower does not come any more."""
        for follower in self.followers:
            if self.parameters.clear_home_done_on_comm_stop and not (
                follower.readings.feedback_is_fresh(now)
            ):
                limit = follower.parameters.feedback_timeout
                text = f'{follower.name}: no feedback came for {limit:g} s (feedback_timeout)'
                self._lose_home(Error.FeedbackStale, text)

    def _take(self, edge: Edge) -> None:
        if self._run is None or self.machine is None:
            super()._take(edge)
        else:
            self._take_side(self._run.leader, edge)

    def _take_side(self, side: Side, edge: Edge) -> None:
        assert self._run is not None and self.machine is not None
        for_leader = self._run.switches.take(side, edge, self.machine)
        if for_leader is not None:
            self._edges.add(for_leader)

    def _stop_where_it_is(self, machine: Machine, now: float) -> None:
        """Plan the stop of each side from where it is."""
        fastest, deceleration = self.readings.top_speed, self._group.ls_dec
        stops: list[tuple[Ending | Follower, Readings]] = [(machine.ending, self.readings)]
        stops += [(follower, follower.readings) for follower in self.followers]
        for one, readings in stops:
            track = readings.track
            velocity = min(fastest, max(-fastest, track.drift(VELOCITY_SPAN)))
            position = track.position + velocity * max(0.0, now - track.time)
            one.stop_from(position, velocity, deceleration)

    def _finish(self, now: float) -> Setpoint | None:
        """End the run as soon as the feedback of all sides has settled after their commands."""
        machine = self.machine
        assert machine is not None
        if self._moved and not machine.ending.silent:
            failed = machine.ending.error is not Error.NoError
            for follower in self.followers:
                p, readings = follower.parameters, follower.readings
                own, stale = follower.profile, readings.stale(now)
                if stale is not None:
                    machine.fail(stale._replace(seen=f'{follower.name}: {stale.seen}'))
                if own is not None and not own.arrived:
                    return self._wait(now)
                behind = follower.commanded() - readings.track.position
                followed = abs(behind) <= p.settling_tolerance
                settled = follower.settling.over(
                    now, readings.track, p.homing_velocity_slow, followed or failed
                )
                if readings.feedback_is_fresh(now) and not settled:
                    return self._wait(now)
                if not (followed or failed):
                    stuck = jammed(behind, p.settling_tolerance)
                    machine.fail(stuck._replace(seen=f'{follower.name}: {stuck.seen}'))
        setpoint = super()._finish(now)
        if self.machine is None and not (machine.ending.silent or self.powered):
            self._come_back(now)
        return setpoint

    def _outcome(self, machine: Machine) -> Outcome:
        """Return how a run has ended; one that has moved must have left the gantry square."""
        run = self._run
        if run is not None and self._moved and machine.ending.error is Error.NoError:
            own = {follower.name: follower.settling for follower in self.followers}
            failure = run.at_rest({s: own.get(s.name, self._settling) for s in run.sides})
            if failure is not None:
                machine.fail(failure)
        return super()._outcome(machine)

    def _come_back(self, now: float) -> None:
        """Let the leader's command go to where it is, because its drive is off."""
        self.returning = self._moved and self.readings.feedback_is_fresh(now)
        if self.returning:
            self.profile.come_back(self.readings.track.position)

    def _wait(self, now: float) -> Setpoint:
        """Go on for a cycle in which a follower has not settled."""
        self.profile.update()
        return self._setpoint(now)

    def _end(self, outcome: Outcome) -> None:
        machine, run = self.machine, self._run
        if run is not None:
            self._ended = run.members
            outcome = outcome._replace(members=self._ended)
            alone = machine is not None and machine.row.motion.kind is Kind.SQUARE
            known = outcome.error is Error.NoError or alone  # where the sides are: by references
            self._apart = (
                () if known or not self.servo_on else tuple(side.apart for side in run.followers)
            )
        now = machine.now if machine is not None else 0.0
        silent = machine is None or machine.ending.silent or not machine.finished
        self._run = None
        super()._end(outcome)
        for follower in self.followers:
            follower.end(now, silent, self._moved)

    # ------------------------------------------------------------------------------ what is shown

    @property
    def levels(self) -> list[tuple[str, bool | None]]:
        """The levels of the leader's inputs, then of the followers', such as y2.home_switch."""
        return super().levels + [
            (f'{follower.short}.{source}', level)
            for follower in self.followers
            for source, level in follower.readings.levels
        ]

    @property
    def members(self) -> tuple[MemberHome, ...]:
        """The drives of the gantry as they are now, the leader first."""
        if self._run is not None:
            return self._run.members
        raw = [self.raw_position, *(follower.raw_position for follower in self.followers)]
        return tuple(
            member._replace(position=position)
            for member, position in zip(self._ended, raw, strict=True)
        )

    def _members_at_rest(self) -> tuple[MemberHome, ...]:
        """Return the drives before the first run."""
        first = MemberHome(self.name, self.parameters.joint or self.name)
        return first, *(MemberHome(one.short, one.parameters.joint) for one in self.followers)

    def homed_position_of(self, follower: Follower) -> float:
        """Return where a follower is in the homed coordinates of the gantry, as it is now homed.

        A follower that stands as the last run has left it reads the same as the leader.
        """
        ahead = follower.sign * follower.raw_position - follower.offset
        return (follower.sign * self._sign) * (self._sign * ahead - self.outcome.home_offset)
