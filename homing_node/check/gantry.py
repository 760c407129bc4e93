# SPDX-License-Identifier: Apache-2.0
"""Checks the sides of a gantry against each other: direction, references, how far they rack.

Each side by itself is checked as an axis is; see check_gantry in __init__.py.
"""

from collections.abc import Iterator, Mapping
from math import inf

from ..parameters.axis import AxisParameters
from ..parameters.gantry import group_parameters
from ..plant.geometry import Geometry, true_home
from ..plant.layout import AxisLayout
from ..plant.timing import Timing
from ..procedures.events import Event
from ..procedures.motions import Way
from ..procedures.squaring import reference_of
from ..procedures.states import Direction, Input
from .axis_check import AxisCheck
from .finding import Finding, Severity, down
from .stopping import stopping_distance

#: What a follower alone need not have: a limit switch of any side stops all of them.
OF_ANY_SIDE = frozenset({'end-unguarded', 'limit-not-wired', 'limit-without-action'})


class Gantry(AxisCheck):
    """What a gantry has that a single axis has not."""

    def __init__(
        self,
        axis: str,
        parameters: AxisParameters,
        followers: Mapping[str, AxisParameters],
        layout: AxisLayout | None,
        timing: Timing,
    ) -> None:
        super().__init__(axis, group_parameters(parameters, followers.values()), timing)
        self.leader, self.followers, self.layout = parameters, followers, layout

    def check(self) -> Iterator[Finding]:
        yield from self.without_reference()
        yield from self.ambiguous_index()
        if self.layout is None:
            return
        sides = self.layout.followers
        for name in sides:
            if name not in self.followers:
                yield self.found(
                    Severity.warning,
                    'side-missing',
                    f'the layout has a follower {name} that the parameters do not have',
                    'nothing moves that side: it racks the gantry from the first motion on',
                    'followers',
                )
        for name, parameters in self.followers.items():
            if name in sides:
                wrong_way = list(self.direction(name, parameters, sides[name]))
                yield from wrong_way or self.square(name, parameters, sides[name])
                yield from self.start(name, sides[name])
                yield from self.in_motion(name, sides[name])
                yield from self.racking(name, sides[name])
            else:
                yield self.found(
                    Severity.warning,
                    'side-missing',
                    f'the layout has no follower {name}',
                    'where its switches are is not checked: add it to followers, with its own '
                    'keys below its name',
                    'followers',
                )

    def without_reference(self) -> Iterator[Finding]:
        """Check that each follower finds a reference of its own."""
        reference = self._reference(self.leader)
        for name, parameters in self.followers.items():
            own = self._reference(parameters)
            if own not in parameters.inputs:
                missing = f'its switches do not have {own}'
                parameter, right = 'switches', f'with {own}'
            elif not self._uses(parameters, own):
                parameter, right = self._option(own), 'true'
                missing = f'{parameter} is false'
            else:
                continue
            yield Finding(
                Severity.info,
                name,
                'side-without-reference',
                f'{name} has no {reference} to home on: {missing}',
                'it goes where the leader goes, and nothing says whether the gantry is square',
                parameter,
                right=right,
            )

    def ambiguous_index(self) -> Iterator[Finding]:
        """Check that the sides cannot take the pulses of different turns.

        A gantry that may be out of square by half a pitch does not tell the turns apart.
        """
        followers = self.followers
        if self._reference(self.leader) is not Input.Z_PULSE or not any(
            Input.Z_PULSE in p.inputs and self._uses(p, Input.Z_PULSE) for p in followers.values()
        ):
            return
        layouts = [] if self.layout is None else [self.layout, *self.layout.followers.values()]
        pitches = [self.p.z_pulse_distance_check, *(layout.index_pitch for layout in layouts)]
        pitch, limit = min(filter(None, pitches), default=inf), self.p.max_skew
        if limit < 0.5 * pitch:
            return
        yield self.found(
            Severity.error,
            'skew-index',
            f'max_skew is {limit:g} m, half the distance of the Z-pulses or more ({pitch:g} m)',
            'the pulses of the sides may be those of different turns, and the gantry would be '
            'squared by a turn: every run ends with IndexAmbiguous',
            'max_skew',
            limit,
            down(0.45 * pitch),
            'm',
        )

    def direction(
        self, name: str, parameters: AxisParameters, layout: AxisLayout
    ) -> Iterator[Finding]:
        """Check that the sides move the same way."""
        opposite = parameters.home_direction is not self.leader.home_direction
        if opposite is layout.mirrored:
            return
        right = self.leader.home_direction
        if layout.mirrored:
            right = next(each for each in Direction if each is not right)
        same = 'the other way round than' if layout.mirrored else 'the same way as'
        yield Finding(
            Severity.error,
            name,
            'side-direction',
            f'the layout says that {name} counts {same} the leader, but its home_direction is '
            f"{parameters.home_direction}, the leader's {self.leader.home_direction}",
            'the sides would move against each other',
            'home_direction',
            str(parameters.home_direction),
            str(right),
        )

    def square(
        self, name: str, parameters: AxisParameters, layout: AxisLayout
    ) -> Iterator[Finding]:
        """Check where the references of the sides are while the gantry is square."""
        p = self.p
        off = self.out_of_square(parameters, layout)
        if off is None or abs(off) <= p.square_tolerance:
            return
        pitch = layout.index_pitch if Input.Z_PULSE in p.procedure.inputs else 0.0
        turns = round(abs(off) / pitch) if pitch else 0
        offset = parameters.switch_offset
        if turns:  # half a pitch or more: core/gantry/squareness.py
            yield Finding(
                Severity.error,
                name,
                'side-index',
                f'the Z-pulse that {name} latches is {abs(off):.4g} m from where switch_offset '
                f'({offset:g} m) says, about {turns} x {pitch:g} m, the distance of the pulses',
                'every run ends with IndexAmbiguous: move the switch that arms the pulse on one '
                'side by half a pitch',
                'switch_offset',
                offset,
                unit='m',
            )
            return
        forced = abs(off) <= p.max_skew
        makes = (
            f'homing leaves the gantry {abs(off):.4g} m out of square'
            if p.square and not p.gantry_homing_retain_sync_offset
            else 'the squareness that is reported is off by that'
        )
        yield Finding(
            Severity.warning if forced else Severity.error,
            name,
            'switch-offset',
            f'switch_offset is {offset:g} m, but the layout has the reference of {name} '
            f"{offset + off:.6g} m from the leader's where the gantry is square",
            makes if forced else 'every run ends with FollowerSwitchMissing or SkewTooLarge',
            'switch_offset',
            offset,
            round(offset + off, 9) + 0.0,
            'm',
        )

    def start(self, name: str, layout: AxisLayout) -> Iterator[Finding]:
        """Check how skewed the layout lets the gantry start."""
        racked = abs(self._along(layout.start, layout) - self._start)
        if racked > self.p.max_skew:
            yield self.found(
                Severity.warning,
                'start-racked',
                f'at the start {name} is {racked:.4g} m out of square, more than max_skew, '
                f'{self.p.max_skew:g} m',
                'a run from there ends with SkewTooLarge: so much is not forced',
                'max_skew',
                self.p.max_skew,
                unit='m',
            )

    def in_motion(self, name: str, layout: AxisLayout) -> Iterator[Finding]:
        """Check how far apart the sides are in motion because one obeys later."""
        assert self.layout is not None
        later = abs(layout.delay + layout.lag - self.layout.delay - self.layout.lag)
        velocity, limit = self._fastest, self.p.max_skew
        if velocity * later <= limit:
            return
        yield self.found(
            Severity.error,
            'skew-in-motion',
            f'{name} obeys {later:.4g} s earlier or later than the leader: at {velocity:g} m/s '
            f'that is a skew of {velocity * later:.4g} m, but max_skew is {limit:g} m',
            'every run ends with SkewTooLarge',
            'homing_velocity_fast',
            velocity,
            down(0.5 * limit / later) if limit else None,
            'm/s',
        )

    def racking(self, name: str, layout: AxisLayout) -> Iterator[Finding]:
        """Tell how far the sides can rack before the skew limit has stopped them."""
        velocity = self._fastest
        most = self.most_skew(velocity, layout)
        newtons = f', {layout.stiffness * most:.3g} N' if layout.stiffness else ''
        yield Finding(
            Severity.info,
            name,
            'racking',
            f'if one side stands while the other moves at {velocity:g} m/s, max_skew '
            f'({self.p.max_skew:g} m) acts, and until all stand the sides are {most:.3g} m out of '
            f'square{newtons}',
            'the machine must bear that; it is less with a lower velocity or max_skew',
        )

    def most_skew(self, velocity: float, layout: AxisLayout) -> float:
        """Return the largest skew if one side stands while the others move at a velocity.

        It goes on until the feedback that shows the skew is used, then until the others stop.
        """
        timing, p = self.timing, self.p
        assert self.layout is not None
        late = max(layout.delay + layout.lag, self.layout.delay + self.layout.lag)
        delay = timing.feedback_age + timing.lead + 1.0 / timing.update_rate + late
        return p.max_skew + velocity * delay + stopping_distance(velocity, p.ls_dec, p.max_jerk)

    def out_of_square(self, parameters: AxisParameters, layout: AxisLayout) -> float | None:
        """Return what a run finds as the squareness of a square gantry, m; None: not known."""
        assert self.layout is not None
        own = self._reference(parameters)
        if own not in parameters.inputs or not self._uses(parameters, own):
            return None
        first = true_home(Geometry(self.leader, self.layout))
        found = true_home(Geometry(parameters, layout))
        if first is None or found is None:
            return None
        return self._along(found, layout) - first - parameters.switch_offset

    @property
    def _fastest(self) -> float:
        """The largest velocity of a run, m/s."""
        return max(self.p.pace(row.motion.pace)[0] for row in self.rows)

    @property
    def _start(self) -> float:
        assert self.layout is not None
        return self.layout.start

    @staticmethod
    def _along(raw: float, layout: AxisLayout) -> float:
        """Return where the leader is when a follower is at a raw position and all is square."""
        return (-raw if layout.mirrored else raw) - layout.square_at

    @staticmethod
    def _reference(parameters: AxisParameters) -> Input:
        """Return the input that the home type takes the home position from."""
        event, _ = reference_of(parameters.procedure)
        if event is Event.Z_PULSE:
            return Input.Z_PULSE
        if event is Event.TOUCH_PROBE:
            return Input.TOUCH_PROBE
        target = parameters.procedure.target
        if event in (Event.LS_RISES, Event.LS_FALLS) and target is not None:
            return parameters.limit_switch(target, Way.TOWARD)
        return Input.HOME_SWITCH

    @classmethod
    def _uses(cls, parameters: AxisParameters, reference: Input) -> bool:
        """Return whether a follower homes on an input of its own."""
        return bool(getattr(parameters, cls._option(reference)))

    @staticmethod
    def _option(reference: Input) -> str:
        """Return the option of WMX3 that lets a follower home on an input."""
        names = {
            Input.HOME_SWITCH: 'hs',
            Input.Z_PULSE: 'z_pulse',
            Input.TOUCH_PROBE: 'touch_probe',
        }
        return f'gantry_homing_use_slave_{names.get(reference, "ls")}'
