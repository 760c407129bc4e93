# SPDX-License-Identifier: Apache-2.0
"""The parameters of an axis: what follows from them, and that they agree with each other.

The parameters themselves stand in axis_fields.py. Units: m or rad, s.
"""

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import sqrt
from typing import Any

from ..procedures import cia402
from ..procedures.events import Event
from ..procedures.motions import Kind, Pace, Way
from ..procedures.procedure import Procedure
from ..procedures.states import (
    LATCHES,
    LIMIT_PAIRS,
    Direction,
    HomeType,
    Input,
    LimitPair,
    LSDirection,
    LSType,
    Role,
)
from ..procedures.tables import PROCEDURES
from . import applying, gantry_checks
from .axis_fields import AxisFields
from .definition import REQUIRED, Definition, Interval, InvalidParameters, read
from .units import Unit

#: Longer than these no ramp and no move of a machine takes, s.
LONGEST_RAMP, LONGEST_MOVE = 1000.0, 3600.0
#: The paces that share the rates of another one.
RATES: Mapping[Pace, Pace] = {Pace.QUICK: Pace.FAST}
#: A drive does not lag longer than this, unless `following_error` says so, s.
LONGEST_LAG = 0.05


@dataclass(frozen=True, kw_only=True, slots=True)
class AxisParameters(AxisFields):
    """The parameters of one axis, and what follows from them; immutable during a run.

    Build it with :func:`axis_parameters`, which checks each value and that they agree.
    """

    @property
    def procedure(self) -> Procedure:
        return PROCEDURES[self.home_type]

    @property
    def limits_ahead(self) -> Mapping[LimitPair, Role]:
        """What a limit switch ahead of each pair means."""
        roles = self.procedure.limits_ahead
        if self.limit_reversal:
            return roles
        return {
            pair: Role.NORMAL if role is Role.REVERSAL else role for pair, role in roles.items()
        }

    @property
    def homes_on_mechanical_end(self) -> bool:
        return Event.END_DETECTED in self.procedure.events

    @property
    def apply_agreement(self) -> float:
        """How far the feedback may be from the homed position once the home is applied, m."""
        return self.apply_tolerance or 1e-4 * self.travel

    @property
    def soft_limits(self) -> Interval | None:
        """The range of homed positions that the relay allows, m; None: any."""
        low, high = self.travel_min, self.travel_max
        return None if low == high else Interval(low, high)

    def pace(self, pace: Pace) -> tuple[float, float, float]:
        """Return (velocity, acceleration, deceleration) of a pace."""
        own: dict[Pace, float] = {
            Pace.FAST: self.homing_velocity_fast,
            Pace.SLOW: self.homing_velocity_slow,
            Pace.SHIFT: self.home_shift_velocity or self.homing_velocity_fast,
            Pace.QUICK: self.rehome_velocity or self.homing_velocity_fast,
        }
        rates = RATES.get(pace, pace)
        return own[pace], getattr(self, f'{rates}_acc'), getattr(self, f'{rates}_dec')

    @property
    def search_distance(self) -> float:
        """The bound of any one search, m."""
        return self.max_search_distance or 1.1 * self.travel

    @property
    def settling_tolerance(self) -> float:
        """How far the feedback may stay behind the command at rest, m."""
        small = 0.01 * self.travel
        return small if self.unit is Unit.rad else min(0.001, small)

    @property
    def margin_before_switch(self) -> float:
        """How far before the remembered switch a quick way ends, m."""
        return self.rehome_margin or self.settling_tolerance

    def following_error_at(self, velocity: float) -> float:
        """Return the largest |command - feedback| at a velocity, m."""
        return self.following_error or LONGEST_LAG * abs(velocity) + self.settling_tolerance

    @property
    def following_error_limit(self) -> float:
        """The largest |command - feedback| at the fast velocity, m."""
        return self.following_error_at(self.homing_velocity_fast)

    @property
    def wrong_direction_limit(self) -> float:
        return self.wrong_direction_distance or 0.01 * self.travel

    @property
    def bounce_distance(self) -> float:
        """How far a switch's contacts may bounce: 5 ms at the fast velocity, m."""
        return 0.005 * self.homing_velocity_fast

    @property
    def flag_bounce_distance(self) -> float:
        """How close behind its rise a home switch's fall is taken for a bounce, m.

        Of a debounced switch none is: its level has lasted.
        """
        return 0.0 if self.switch_debounce else self.bounce_distance

    @property
    def edge_agreement(self) -> float:
        return self.edge_tolerance or self.bounce_distance

    @property
    def repeat_agreement(self) -> float:
        """The largest spread of repeated passes, m."""
        return self.repeat_tolerance or self.edge_agreement

    @property
    def run_timeout(self) -> float:
        """The bound of a whole run, s: every motion of the table twice (the reversal), + 50 %.

        A pass more is every motion once more.
        """
        if self.timeout:
            return self.timeout
        needed = 0.0
        for row in self.procedure.rows.values():
            velocity, acceleration, deceleration = self.pace(row.motion.pace)
            distance = {
                Kind.SEARCH: self.search_distance,
                Kind.APPROACH: self.search_distance,
                Kind.FURTHER: self.homing_reverse_distance,
                Kind.REST: 0.0,
                Kind.HOME: self.travel + abs(self.home_shift_distance),
            }[row.motion.kind]
            ramps = velocity / acceleration + velocity / deceleration
            jerks = (acceleration + deceleration) / self.max_jerk
            needed += distance / velocity + ramps + 2 * jerks
        return 1.5 * ((1 + self.repeat) * needed + self.mechanical_end_detection_time + 0.5)

    def ls_types(self, pair: LimitPair) -> tuple[LSType, LSType]:
        """Return the actions of the positive and the negative input of a pair."""
        prefix = '' if pair is LimitPair.HARDWARE else f'{pair}_'
        both: LSType = getattr(self, f'{prefix}ls_type')
        if both is not LSType.SeparatePositiveLSNegativeLS:
            return both, both
        return (
            getattr(self, f'{prefix}positive_ls_type'),
            getattr(self, f'{prefix}negative_ls_type'),
        )

    def limit_switch(self, pair: LimitPair, way: Way) -> Input:
        """Return the input of a pair that sits at the toward or the away end."""
        positive, negative = LIMIT_PAIRS[pair]
        positive_end = (way is Way.TOWARD) == (self.home_direction is Direction.Positive)
        swapped = self.ls_direction is LSDirection.Reverse
        return positive if positive_end != swapped else negative

    def inverted(self, switch: Input) -> bool:
        """Tell whether an input's polarity is inverted."""
        name = switch.value.replace('home_switch', 'hs').replace('limit_switch', 'ls')
        return bool(getattr(self, f'invert_{name}_polarity', False))

    @property
    def inputs(self) -> tuple[Input, ...]:
        """The inputs that are wired and enabled (a near or external limit needs a type)."""
        disabled = {
            switch
            for pair in (LimitPair.NEAR, LimitPair.EXTERNAL)
            for switch, ls_type in zip(LIMIT_PAIRS[pair], self.ls_types(pair), strict=True)
            if ls_type is LSType.none
        }
        return tuple(switch for switch in self.switches if switch not in disabled)

    def cross_check(self) -> list[str]:
        """Return every contradiction between parameters, a line each."""
        return [self.unit.in_message(fault) for fault in self._contradictions()]

    def _contradictions(self) -> list[str]:
        faults = [
            *self._too_long(),
            *applying.contradictions(self),
            *gantry_checks.contradictions(self),
        ]
        fast, slow = self.homing_velocity_fast, self.homing_velocity_slow
        if slow > fast:
            faults.append(
                f'homing_velocity_slow: {slow:g} m/s must be <= homing_velocity_fast, {fast:g} m/s'
            )
        if self.homing_reverse_distance >= self.travel:
            faults.append(
                f'homing_reverse_distance: {self.homing_reverse_distance:g} m must be '
                f'< travel, {self.travel:g} m'
            )
        if self.max_search_distance > 2 * self.travel:
            faults.append(
                f'max_search_distance: {self.max_search_distance:g} m must be '
                f'<= 2 x travel, {2 * self.travel:g} m'
            )
        for name in ('max_ls_reverse_distance', 'max_hs_on_at_start_reverse_distance'):
            if getattr(self, name) > self.search_distance:
                faults.append(
                    f'{name}: {getattr(self, name):g} m must be <= max_search_distance, '
                    f'{self.search_distance:g} m'
                )
        if abs(self.home_shift_distance) > self.travel:
            faults.append(
                f'home_shift_distance: {self.home_shift_distance:g} m must be within '
                f'+-travel, {self.travel:g} m'
            )
        procedure = self.procedure
        if self.repeat > 1 and Event.REPEAT not in procedure.events:
            able = ', '.join(t for t, one in PROCEDURES.items() if Event.REPEAT in one.events)
            faults.append(
                f'repeat: {self.repeat} must be 1 for {self.home_type}, which has no '
                f'slow pass over a switch or probe ({able} do)'
            )
        end = (
            'limit switch'
            if Role.REFERENCE in procedure.limits_ahead.values()
            else 'mechanical end'
            if self.home_type is HomeType.MechanicalEndDetection
            else ''
        )
        if end and self.home_shift_distance > 0:
            faults.append(
                f'home_shift_distance: {self.home_shift_distance:g} m must be <= 0 m '
                f'for {self.home_type} (it would move on into the {end})'
            )
        bound, delay = self.max_z_pulse_distance, self.z_pulse_arm_delay
        if Event.Z_PULSE in procedure.events and 0.0 < bound <= delay:
            faults.append(
                f'max_z_pulse_distance: {bound:g} m must be > z_pulse_arm_delay, '
                f'{delay:g} m (0: no such bound)'
            )
        for needed in sorted(procedure.inputs):
            if needed not in self.switches:
                faults.append(f'switches: {needed} is missing; {self.home_type} needs it')
        if procedure.target:
            faults += self._check_target(procedure.target)
        if self.homes_on_mechanical_end and not self.mechanical_end_detection_pos_diff:
            faults.append(
                'mechanical_end_detection_pos_diff: 0 m must be > 0 m to detect the mechanical end'
            )
        for pair in LimitPair:
            prefix = '' if pair is LimitPair.HARDWARE else f'{pair}_'
            for side in ('positive', 'negative'):
                name = f'{prefix}{side}_ls_type'
                if getattr(self, name) is LSType.SeparatePositiveLSNegativeLS:
                    faults.append(f'{name}: must be an action, not SeparatePositiveLSNegativeLS')
        return faults

    def _too_long(self) -> list[str]:
        """Return the motions that take longer than a machine can mean."""
        faults = []
        for pace in Pace:
            if pace is Pace.QUICK and not self.rehome_velocity:
                continue
            velocity, *rates = self.pace(pace)
            times = [ramp_time(velocity, rate, self.max_jerk) for rate in rates]
            if max(times) > LONGEST_RAMP:
                rates_of = RATES.get(pace, pace)
                name = f'{rates_of}_{"acc" if times[0] > LONGEST_RAMP else "dec"}'
                rate = getattr(self, name)
                faults.append(
                    f'{name}: with {rate:g} m/s^2 and max_jerk, {self.max_jerk:g} m/s^3, the ramp '
                    f'to {velocity:g} m/s takes {max(times):.3g} s, it must be <= '
                    f'{LONGEST_RAMP:g} s'
                )
        for name, distance, pace in (
            ('homing_reverse_distance', self.homing_reverse_distance, Pace.FAST),
            ('home_shift_distance', abs(self.home_shift_distance), Pace.SHIFT),
        ):
            velocity = self.pace(pace)[0]
            if distance / velocity > LONGEST_MOVE:
                faults.append(
                    f'{name}: {distance:g} m at {velocity:g} m/s takes '
                    f'{distance / velocity:.3g} s, it must be <= {LONGEST_MOVE:g} s'
                )
        return faults

    def _check_target(self, pair: LimitPair) -> list[str]:
        target = self.limit_switch(pair, Way.TOWARD)
        if target not in self.switches:
            return [
                f'switches: {target} is missing; {self.home_type} with home_direction '
                f'{self.home_direction} needs it'
            ]
        if target not in self.inputs:
            return [f'{pair}_ls_type: {target} is disabled (None); {self.home_type} needs it']
        return []


DEFINITIONS: Mapping[str, Definition] = {
    f.name: dataclasses.replace(
        f.metadata['definition'],
        name=f.name,
        default=REQUIRED if f.default is dataclasses.MISSING else f.default,
    )
    for f in dataclasses.fields(AxisParameters)
}


#: The same for a rotary axis.
_BY_UNIT: Mapping[Unit, Mapping[str, Definition]] = {
    unit: {
        name: dataclasses.replace(definition, unit=unit.of(definition.unit))
        for name, definition in DEFINITIONS.items()
    }
    for unit in Unit
}


def axis_parameters(values: Mapping[str, object], axis: str = '') -> AxisParameters:
    """Build the parameters of an axis from plain values (YAML, ROS).

    ``axis`` is put before each name in the messages.

    Raises:
        InvalidParameters: Every fault: unknown names, missing required parameters, bad values
            and, where all values are good, contradictions between them.
    """
    prefix = f'{axis}.' if axis else ''
    unit = Unit.rad if values.get('unit') == Unit.rad else Unit.m
    good, faults = read(values, _BY_UNIT[unit])
    if isinstance(method := good.get('home_type'), cia402.Method):
        faults += _take_method(method, values, good)
    for pair in ('', 'near_', 'external_'):
        if good.get(f'{pair}ls_type') is LSType.SeparatePositiveLSNegativeLS:
            needed = (f'{pair}positive_ls_type', f'{pair}negative_ls_type')
            faults += [
                f'{name}: required, but not set ({pair}ls_type is SeparatePositiveLSNegativeLS)'
                for name in needed
                if name not in values
            ]
    if not faults:
        parameters = AxisParameters(**good)
        faults = parameters.cross_check()
        if not faults:
            return parameters
    raise InvalidParameters(prefix + fault for fault in faults)


def _take_method(
    method: cia402.Method, values: Mapping[str, object], good: dict[str, Any]
) -> list[str]:
    """Put what a CiA 402 method implies into the good values; return what contradicts it."""
    good['home_type'] = method.home_type
    if 'limit_reversal' not in values:
        good['limit_reversal'] = method.limit_reversal
    implied = method.direction
    if implied is None:
        return []
    given = good.get('home_direction') if 'home_direction' in values else None
    good['home_direction'] = implied
    if given in (None, implied):
        return []
    return [
        f'home_direction: {given} contradicts home_type {method.number} ({method}), '
        f'which homes {implied} ({method.home_type}); leave it out, or set it to '
        f'{implied}'
    ]


def ramp_time(velocity: float, acceleration: float, jerk: float) -> float:
    """Return how long the jerk-limited way from rest to a velocity takes, s."""
    peak = min(acceleration, sqrt(velocity * jerk))
    return velocity / peak + peak / jerk


def switch_inputs(inputs: Iterable[Input]) -> tuple[Input, ...]:
    """Return those inputs that carry a level (not a latched position, not the servo)."""
    return tuple(i for i in inputs if i not in LATCHES and i is not Input.SERVO_ENABLED)
