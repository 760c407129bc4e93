# SPDX-License-Identifier: Apache-2.0
"""The parameters of an axis: one frozen dataclass that everything else derives from.

ROS descriptors, the YAML loader, the reference table and the cross-checks all read the fields of
:class:`AxisParameters`; a new parameter is one new field. SI units: m or rad, s. Names are the
WMX3 manual's in snake_case.
"""

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ..procedures.events import Event
from ..procedures.motions import Kind, Pace, Way
from ..procedures.states import (
    LATCHES,
    LIMIT_PAIRS,
    Direction,
    HomeType,
    IndexMarginAction,
    Input,
    LSDirection,
    LSType,
    Role,
    Tier,
)
from ..procedures.tables import PROCEDURES, Procedure
from .definition import REQUIRED, Definition, InvalidParameters, suggestion


def _parameter(kind: type, default: Any, text: str, unit: str = '', **bounds: Any) -> Any:
    metadata = {'definition': Definition(text, kind, unit, **bounds)}
    if default is REQUIRED:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def _positive(default: Any, unit: str, text: str) -> Any:
    return _parameter(float, default, text, unit, minimum=0.0, open_minimum=True)


def _distance(default: float, text: str) -> Any:
    return _parameter(float, default, text, 'm', minimum=0.0)


def _duration(default: float, text: str) -> Any:
    return _parameter(float, default, text, 's', minimum=0.0)


def _flag(default: bool, text: str) -> Any:
    return _parameter(bool, default, text)


def _inversion(switch: str) -> Any:
    return _flag(False, f'{switch}: on when the signal is false')


def _separate_ls_type(side: str) -> Any:
    return _ls_type(LSType.none, f'action of the {side} one with SeparatePositiveLSNegativeLS')


def _ls_type(default: LSType, text: str) -> Any:
    return _parameter(LSType, default, text)


@dataclass(frozen=True, kw_only=True, slots=True)
class AxisParameters:
    """All parameters of one axis, in SI units (m or rad, s); immutable during a run.

    Build it with :func:`axis_parameters`, which checks every value and the cross-checks.
    """

    home_type: HomeType = _parameter(HomeType, REQUIRED, 'how the axis homes')
    home_direction: Direction = _parameter(
        Direction, Direction.Positive, 'homing direction in raw coordinates'
    )
    joint: str = _parameter(
        str, '', "joint in joint_states and in the setpoints ('': the axis's name)"
    )
    travel: float = _positive(REQUIRED, 'm', 'mechanical travel of the axis')

    homing_velocity_fast: float = _positive(
        0.05, 'm/s', 'velocity of switch searches and reversals'
    )
    homing_velocity_fast_acc: float = _positive(0.5, 'm/s^2', 'acceleration of the fast profile')
    homing_velocity_fast_dec: float = _positive(0.5, 'm/s^2', 'deceleration of the fast profile')
    homing_velocity_slow: float = _positive(
        0.005, 'm/s', 'velocity at which a reference is taken after a coarse pass or on a latch'
    )
    homing_velocity_slow_acc: float = _positive(0.5, 'm/s^2', 'acceleration of the slow profile')
    homing_velocity_slow_dec: float = _positive(0.5, 'm/s^2', 'deceleration of the slow profile')
    homing_reverse_distance: float = _distance(0.0, 'further away after a switch was cleared')
    home_shift_velocity: float = _positive(0.05, 'm/s', 'velocity of the final move')
    home_shift_acc: float = _positive(0.5, 'm/s^2', 'acceleration of the final move')
    home_shift_dec: float = _positive(0.5, 'm/s^2', 'deceleration of the final move')
    home_shift_distance: float = _parameter(
        float, 0.0, 'final move past the home position, along the homing direction', 'm'
    )
    home_position: float = _parameter(
        float, 0.0, 'what the axis reads at the end of the final move', 'm'
    )
    max_jerk: float = _positive(10.0, 'm/s^3', 'jerk of every profile')

    invert_hs_polarity: bool = _inversion('home switch')
    invert_positive_ls_polarity: bool = _inversion('positive limit switch')
    invert_negative_ls_polarity: bool = _inversion('negative limit switch')
    invert_near_positive_ls_polarity: bool = _inversion('near positive limit switch')
    invert_near_negative_ls_polarity: bool = _inversion('near negative limit switch')
    invert_external_positive_ls_polarity: bool = _inversion('external positive limit switch')
    invert_external_negative_ls_polarity: bool = _inversion('external negative limit switch')

    multiple_z_pulse: int = _parameter(
        int, 0, 'take the n-th Z-pulse (0 and 1: the first)', minimum=0, maximum=1_000_000
    )
    z_pulse_distance_check: float = _distance(
        0.0, 'expected distance between Z-pulses (0: not checked)'
    )
    z_pulse_distance_tolerance: float = _parameter(
        float, 0.05, 'relative tolerance of z_pulse_distance_check', minimum=0.0, maximum=1.0
    )
    max_z_pulse_distance: float = _distance(
        0.0, 'bound from the arming edge to the Z-pulse (0: only the search bound)'
    )

    z_pulse_arm_delay: float = _distance(
        0.0, 'how far beyond the arming edge a Z-pulse must lie to count'
    )
    index_margin: float = _parameter(
        float,
        0.1,
        'least distance of the arming edge from a Z-pulse, as a fraction of the pitch',
        minimum=0.0,
        maximum=0.5,
    )
    index_margin_action: IndexMarginAction = _parameter(
        IndexMarginAction, IndexMarginAction.Warn, 'what to do below index_margin'
    )

    max_hs_on_at_start_reverse_distance: float = _distance(
        0.0, 'bound for clearing a home switch that is on at start (0: only the search bound)'
    )
    max_ls_reverse_distance: float = _distance(
        0.0, 'bound for the reversal from a limit switch (0: only the search bound)'
    )
    max_search_distance: float = _distance(0.0, 'bound of any one search (0: 1.1 x travel)')
    timeout: float = _duration(
        0.0, 'bound of a whole run (0: computed from the bounds and speeds, + 50 %)'
    )

    immediate_stop_at_ls: bool = _flag(
        False, 'where a limit is the reversal or the reference, the command freezes at its edge'
    )
    open_loop_homing: bool = _flag(
        False, 'take the commanded instead of the feedback position at switch edges'
    )
    pause_mode: bool = _flag(False, 'pause before each reversal until `continue`')

    ls_type: LSType = _ls_type(LSType.Dec, 'action of the hardware limit switches')
    positive_ls_type: LSType = _separate_ls_type('positive')
    negative_ls_type: LSType = _separate_ls_type('negative')
    ls_dec: float = _positive(1.0, 'm/s^2', 'deceleration at limits, faults and emergency stop')
    ls_slow_dec: float = _positive(0.5, 'm/s^2', 'deceleration of the SlowDec actions')
    all_ls_during_homing: bool = _flag(
        False, 'limit switches act whatever the direction of motion'
    )
    ls_direction: LSDirection = _parameter(
        LSDirection, LSDirection.Normal, 'Reverse swaps the positive and negative limit inputs'
    )
    near_ls_type: LSType = _ls_type(LSType.none, 'action of the near limit switches')
    near_positive_ls_type: LSType = _separate_ls_type('near positive')
    near_negative_ls_type: LSType = _separate_ls_type('near negative')
    external_ls_type: LSType = _ls_type(LSType.none, 'action of the external limit switches')
    external_positive_ls_type: LSType = _separate_ls_type('external positive')
    external_negative_ls_type: LSType = _separate_ls_type('external negative')

    mechanical_end_detection_pos_diff: float = _distance(
        0.0, 'command minus feedback that means the mechanical end'
    )
    mechanical_end_detection_time: float = _duration(0.0, 'how long it must be exceeded')
    mechanical_end_detection_ignore_ls: bool = _flag(
        False, 'limit switches ahead are ignored while searching the mechanical end'
    )
    mechanical_end_detection_first_torque_limit: float = _parameter(
        float, 0.0, 'torque limit while searching the end (0: none)', '%', minimum=0.0
    )
    mechanical_end_detection_second_torque_limit: float = _parameter(
        float, 0.0, 'torque limit once the end was touched (0: the first)', '%', minimum=0.0
    )

    switches: tuple[Input, ...] = _parameter(
        tuple,
        (Input.HOME_SWITCH, Input.POSITIVE_LIMIT_SWITCH, Input.NEGATIVE_LIMIT_SWITCH),
        'the inputs that are wired',
    )
    switch_debounce: float = _duration(0.0, 'how long a level must last to be believed')
    switch_timeout: float = _duration(
        0.0, 'largest age of a periodically published switch (0: published on change only)'
    )
    switch_latency: float = _duration(
        0.0, "the switch driver's own delay before publishing, taken off the edge's time"
    )
    switch_stamp_error: float = _duration(
        0.002, "how far a switch's stamp may be from its edge; for `uncertainty`"
    )
    feedback_timeout: float = _positive(0.2, 's', 'largest age of the feedback')

    following_error: float = _distance(
        0.0, 'largest |command - feedback| (0: homing_velocity_fast x 0.5 s)'
    )
    wrong_direction_distance: float = _distance(
        0.0,
        'commanded distance after which the feedback must not go the other way (0: 1 % of travel)',
    )
    edge_tolerance: float = _distance(
        0.0, 'how far the second pass may be from the first (0: homing_velocity_fast x 0.005 s)'
    )

    repeat: int = _parameter(
        int,
        1,
        'number of slow passes over the reference; home is their mean',
        minimum=1,
        maximum=100,
    )
    repeat_tolerance: float = _distance(0.0, 'largest spread of the passes (0: edge_tolerance)')

    clear_home_done_on_servo_off: bool = _flag(True, 'servo off: the axis is no longer homed')
    clear_home_done_on_comm_stop: bool = _flag(True, 'feedback lost: the axis is no longer homed')

    # ------------------------------------------------------------------ what follows from them

    @property
    def procedure(self) -> Procedure:
        return PROCEDURES[self.home_type]

    @property
    def homes_on_mechanical_end(self) -> bool:
        return Event.END_DETECTED in self.procedure.events

    def pace(self, pace: Pace) -> tuple[float, float, float]:
        """Return (velocity, acceleration, deceleration) of a pace."""
        prefix = pace.value
        velocity = 'home_shift_velocity' if pace is Pace.SHIFT else prefix
        names = (velocity, f'{prefix}_acc', f'{prefix}_dec')
        return tuple(getattr(self, name) for name in names)

    @property
    def search_distance(self) -> float:
        """The bound of any one search, m."""
        return self.max_search_distance or 1.1 * self.travel

    @property
    def following_error_limit(self) -> float:
        return self.following_error or 0.5 * self.homing_velocity_fast

    @property
    def wrong_direction_limit(self) -> float:
        return self.wrong_direction_distance or 0.01 * self.travel

    @property
    def bounce_distance(self) -> float:
        """How far a switch's contacts may bounce: 5 ms at the fast velocity, m."""
        return 0.005 * self.homing_velocity_fast

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
                Kind.FURTHER: self.homing_reverse_distance,
                Kind.REST: 0.0,
                Kind.HOME: self.travel + abs(self.home_shift_distance),
            }[row.motion.kind]
            ramps = velocity / acceleration + velocity / deceleration
            jerks = (acceleration + deceleration) / self.max_jerk
            needed += distance / velocity + ramps + 2 * jerks
        return 1.5 * ((1 + self.repeat) * needed + self.mechanical_end_detection_time + 0.5)

    def ls_types(self, tier: Tier) -> tuple[LSType, LSType]:
        """Return the actions of the positive and the negative input of a pair."""
        prefix = '' if tier is Tier.HARDWARE else f'{tier}_'
        both: LSType = getattr(self, f'{prefix}ls_type')
        if both is not LSType.SeparatePositiveLSNegativeLS:
            return both, both
        return (
            getattr(self, f'{prefix}positive_ls_type'),
            getattr(self, f'{prefix}negative_ls_type'),
        )

    def limit_switch(self, tier: Tier, way: Way) -> Input:
        """Return the input of a pair that sits at the toward or the away end."""
        positive, negative = LIMIT_PAIRS[tier]
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
            for tier in (Tier.NEAR, Tier.EXTERNAL)
            for switch, ls_type in zip(LIMIT_PAIRS[tier], self.ls_types(tier), strict=True)
            if ls_type is LSType.none
        }
        return tuple(switch for switch in self.switches if switch not in disabled)

    def cross_check(self) -> list[str]:
        """Return every contradiction between parameters, a line each."""
        faults = []
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
            faults.append(
                f'repeat: {self.repeat} must be 1 for {self.home_type}, which has no '
                'slow pass over a switch or probe (HSHS and HSTouchProbe do)'
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
        for tier in Tier:
            prefix = '' if tier is Tier.HARDWARE else f'{tier}_'
            for side in ('positive', 'negative'):
                name = f'{prefix}{side}_ls_type'
                if getattr(self, name) is LSType.SeparatePositiveLSNegativeLS:
                    faults.append(f'{name}: must be an action, not SeparatePositiveLSNegativeLS')
        return faults

    def _check_target(self, tier: Tier) -> list[str]:
        target = self.limit_switch(tier, Way.TOWARD)
        if target not in self.switches:
            return [
                f'switches: {target} is missing; {self.home_type} with home_direction '
                f'{self.home_direction} needs it'
            ]
        if target not in self.inputs:
            return [f'{tier}_ls_type: {target} is disabled (None); {self.home_type} needs it']
        return []


DEFINITIONS: Mapping[str, Definition] = {
    f.name: f.metadata['definition']._replace(
        name=f.name, default=REQUIRED if f.default is dataclasses.MISSING else f.default
    )
    for f in dataclasses.fields(AxisParameters)
}


def axis_parameters(values: Mapping[str, object], axis: str = '') -> AxisParameters:
    """Build the parameters of an axis from plain values (YAML, ROS).

    Raises InvalidParameters with every fault: unknown names, missing required parameters, bad
    values and, where all values are good, failed cross-checks. ``axis`` is put before each name.
    """
    prefix = f'{axis}.' if axis else ''
    faults, good = [], {}
    for name, value in values.items():
        if name not in DEFINITIONS:
            faults.append(f'{name}: no such parameter' + suggestion(name, DEFINITIONS))
            continue
        try:
            good[name] = DEFINITIONS[name].convert(value)
        except ValueError as error:
            faults.append(str(error))
    for name, definition in DEFINITIONS.items():
        if definition.required and name not in values:
            unit = f', {definition.unit}' if definition.unit else ''
            faults.append(f'{name}: required, but not set ({definition.text}{unit})')
    for tier in ('', 'near_', 'external_'):
        if good.get(f'{tier}ls_type') is LSType.SeparatePositiveLSNegativeLS:
            needed = (f'{tier}positive_ls_type', f'{tier}negative_ls_type')
            faults += [
                f'{name}: required, but not set ({tier}ls_type is SeparatePositiveLSNegativeLS)'
                for name in needed
                if name not in values
            ]
    if not faults:
        parameters = AxisParameters(**good)
        faults = parameters.cross_check()
        if not faults:
            return parameters
    raise InvalidParameters(prefix + fault for fault in faults)


def switch_inputs(inputs: Iterable[Input]) -> tuple[Input, ...]:
    """Return those inputs that carry a level (not a latched position, not the servo)."""
    return tuple(i for i in inputs if i not in LATCHES and i is not Input.SERVO_ENABLED)
