"""The parameters of an axis: one frozen dataclass that everything else derives from.

ROS descriptors, the YAML loader, the reference table and the cross-checks all read the fields of
:class:`AxisParameters`; a new parameter is one new field. SI units: m or rad, s. Names are the
WMX3 manual's in snake_case.
"""

import dataclasses
import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from .events import Event
from .motions import Kind, Pace, Way
from .procedures import PROCEDURES, Procedure
from .states import (
    LATCHES,
    LIMIT_PAIRS,
    Direction,
    HomeType,
    Input,
    LSDirection,
    LSType,
    Role,
    Tier,
)


class InvalidParameters(ValueError):
    """Bad parameters; ``faults`` lists every one of them, a line each."""

    def __init__(self, faults: Iterable[str]) -> None:
        self.faults = tuple(faults)
        super().__init__('\n'.join(self.faults))


REQUIRED: Any = object()


@dataclass(frozen=True)
class Spec:
    """What is known of one parameter: its kind, unit, bounds and meaning."""

    text: str
    kind: type
    unit: str = ''
    minimum: float = -math.inf
    maximum: float = math.inf
    open_minimum: bool = False
    name: str = ''
    default: Any = REQUIRED

    @property
    def required(self) -> bool:
        return self.default is REQUIRED

    @property
    def initial(self) -> Any:
        """The default, None where the parameter is required."""
        return None if self.required else self.default

    @property
    def choices(self) -> tuple[str, ...]:
        return tuple(str(c) for c in self.kind) if issubclass(self.kind, Enum) else ()

    @property
    def bounds(self) -> str:
        """Tell the bounds in words, '' where there are none."""
        parts = []
        if self.minimum > -math.inf:
            parts.append(f'{">" if self.open_minimum else ">="} {self.minimum:g}')
        if self.maximum < math.inf:
            parts.append(f'<= {self.maximum:g}')
        return ' and '.join(parts)

    def convert(self, value: object) -> Any:
        """Return the value as this parameter holds it; raise ValueError that says what is wrong.

        Integers are accepted for real parameters.
        """
        if issubclass(self.kind, Enum):
            if isinstance(value, str) and value in self.choices:
                return self.kind(value)
            raise ValueError(
                f'{self.name}: {value!r} is none of {", ".join(self.choices)}'
                + _suggestion(value, self.choices))
        if self.kind is tuple:
            return self._inputs(value)
        if self.kind in (int, float) and isinstance(value, int) and not isinstance(value, bool):
            value = self.kind(value)
        if not isinstance(value, self.kind) or (self.kind is int and isinstance(value, bool)):
            kind = {float: 'a number', int: 'an integer', bool: 'true or false'}
            raise ValueError(
                f'{self.name}: {value!r} is not {kind.get(self.kind, "a string")}'
                + (f' ({self.unit})' if self.unit else ''))
        if isinstance(value, int | float):
            below = value <= self.minimum if self.open_minimum else value < self.minimum
            if not math.isfinite(value) or below or value > self.maximum:
                bounds = self.bounds or 'finite'
                raise ValueError(f'{self.name}: {value!r} {self.unit} must be {bounds} {self.unit}'
                                 .replace('  ', ' ').rstrip())
        return value

    def _inputs(self, value: object) -> tuple[Input, ...]:
        names = tuple(str(i) for i in Input)
        if isinstance(value, str) or not isinstance(value, Iterable):
            raise ValueError(f'{self.name}: {value!r} is not a list of inputs')
        listed = list(value)
        for name in listed:
            if name not in names:
                raise ValueError(f'{self.name}: {name!r} is none of {", ".join(names)}'
                                 + _suggestion(name, names))
        if len(set(listed)) < len(listed):
            raise ValueError(f'{self.name}: an input is listed twice in {listed}')
        return tuple(Input(name) for name in listed)


def _suggestion(value: object, names: Iterable[str]) -> str:
    close = difflib.get_close_matches(str(value), list(names), 1)
    return f'; did you mean {close[0]!r}?' if close else ''


def _parameter(kind: type, default: Any, text: str, unit: str = '', **bounds: Any) -> Any:
    metadata = {'spec': Spec(text, kind, unit, **bounds)}
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


def _ls_type(default: LSType, text: str) -> Any:
    return _parameter(LSType, default, text)


@dataclass(frozen=True, kw_only=True)
class AxisParameters:
    """All parameters of one axis, in SI units (m or rad, s); immutable during a run.

    Build it with :func:`axis_parameters`, which checks every value and the cross-checks.
    """

    home_type: HomeType = _parameter(HomeType, REQUIRED, 'how the axis homes')
    home_direction: Direction = _parameter(
        Direction, Direction.Positive, 'homing direction in raw coordinates')
    joint: str = _parameter(
        str, '', "joint in joint_states and in the setpoints ('': the axis's name)")
    travel: float = _positive(REQUIRED, 'm', 'mechanical travel of the axis')

    homing_velocity_fast: float = _positive(
        0.05, 'm/s', 'velocity of switch searches and reversals')
    homing_velocity_fast_acc: float = _positive(0.5, 'm/s^2', 'acceleration of the fast profile')
    homing_velocity_fast_dec: float = _positive(0.5, 'm/s^2', 'deceleration of the fast profile')
    homing_velocity_slow: float = _positive(
        0.005, 'm/s', 'velocity at which a reference is taken after a coarse pass or on a latch')
    homing_velocity_slow_acc: float = _positive(0.5, 'm/s^2', 'acceleration of the slow profile')
    homing_velocity_slow_dec: float = _positive(0.5, 'm/s^2', 'deceleration of the slow profile')
    homing_reverse_distance: float = _distance(0.0, 'further away after a switch was cleared')
    home_shift_velocity: float = _positive(0.05, 'm/s', 'velocity of the final move')
    home_shift_acc: float = _positive(0.5, 'm/s^2', 'acceleration of the final move')
    home_shift_dec: float = _positive(0.5, 'm/s^2', 'deceleration of the final move')
    home_shift_distance: float = _parameter(
        float, 0.0, 'final move past the home position, along the homing direction', 'm')
    home_position: float = _parameter(
        float, 0.0, 'what the axis reads at the end of the final move', 'm')
    max_jerk: float = _positive(10.0, 'm/s^3', 'jerk of every profile')

    invert_hs_polarity: bool = _flag(False, 'home switch: on when the signal is false')
    invert_positive_ls_polarity: bool = _flag(
        False, 'positive limit switch: on when the signal is false')
    invert_negative_ls_polarity: bool = _flag(
        False, 'negative limit switch: on when the signal is false')
    invert_near_positive_ls_polarity: bool = _flag(
        False, 'near positive limit switch: on when the signal is false')
    invert_near_negative_ls_polarity: bool = _flag(
        False, 'near negative limit switch: on when the signal is false')
    invert_external_positive_ls_polarity: bool = _flag(
        False, 'external positive limit switch: on when the signal is false')
    invert_external_negative_ls_polarity: bool = _flag(
        False, 'external negative limit switch: on when the signal is false')

    multiple_z_pulse: int = _parameter(
        int, 0, 'take the n-th Z-pulse (0 and 1: the first)', minimum=0)
    z_pulse_distance_check: float = _distance(
        0.0, 'expected distance between Z-pulses (0: not checked)')
    z_pulse_distance_tolerance: float = _parameter(
        float, 0.05, 'relative tolerance of z_pulse_distance_check', minimum=0.0, maximum=1.0)
    max_z_pulse_distance: float = _distance(
        0.0, 'bound from the arming edge to the Z-pulse (0: only the search bound)')

    max_hs_on_at_start_reverse_distance: float = _distance(
        0.0, 'bound for clearing a home switch that is on at start (0: only the search bound)')
    max_ls_reverse_distance: float = _distance(
        0.0, 'bound for the reversal from a limit switch (0: only the search bound)')
    max_search_distance: float = _distance(0.0, 'bound of any one search (0: 1.1 x travel)')
    timeout: float = _duration(
        0.0, 'bound of a whole run (0: computed from the bounds and speeds, + 50 %)')

    immediate_stop_at_ls: bool = _flag(
        False, 'where a limit is the reversal or the reference, the command freezes at its edge')
    open_loop_homing: bool = _flag(
        False, 'take the commanded instead of the feedback position at switch edges')
    pause_mode: bool = _flag(False, 'pause before each reversal until `continue`')

    ls_type: LSType = _ls_type(LSType.Dec, 'action of the hardware limit switches')
    positive_ls_type: LSType = _ls_type(
        LSType.none, 'action of the positive one with SeparatePositiveLSNegativeLS')
    negative_ls_type: LSType = _ls_type(
        LSType.none, 'action of the negative one with SeparatePositiveLSNegativeLS')
    ls_dec: float = _positive(1.0, 'm/s^2', 'deceleration at limits, faults and emergency stop')
    ls_slow_dec: float = _positive(0.5, 'm/s^2', 'deceleration of the SlowDec actions')
    all_ls_during_homing: bool = _flag(
        False, 'limit switches act whatever the direction of motion')
    ls_direction: LSDirection = _parameter(
        LSDirection, LSDirection.Normal, 'Reverse swaps the positive and negative limit inputs')
    near_ls_type: LSType = _ls_type(LSType.none, 'action of the near limit switches')
    near_positive_ls_type: LSType = _ls_type(
        LSType.none, 'action of the near positive one with SeparatePositiveLSNegativeLS')
    near_negative_ls_type: LSType = _ls_type(
        LSType.none, 'action of the near negative one with SeparatePositiveLSNegativeLS')
    external_ls_type: LSType = _ls_type(LSType.none, 'action of the external limit switches')
    external_positive_ls_type: LSType = _ls_type(
        LSType.none, 'action of the external positive one with SeparatePositiveLSNegativeLS')
    external_negative_ls_type: LSType = _ls_type(
        LSType.none, 'action of the external negative one with SeparatePositiveLSNegativeLS')

    mechanical_end_detection_pos_diff: float = _distance(
        0.0, 'command minus feedback that means the mechanical end')
    mechanical_end_detection_time: float = _duration(
        0.0, 'how long it must be exceeded')
    mechanical_end_detection_ignore_ls: bool = _flag(
        False, 'limit switches ahead are ignored while searching the mechanical end')
    mechanical_end_detection_first_torque_limit: float = _parameter(
        float, 0.0, 'torque limit while searching the end (0: none)', '%', minimum=0.0)
    mechanical_end_detection_second_torque_limit: float = _parameter(
        float, 0.0, 'torque limit once the end was touched (0: the first)', '%', minimum=0.0)

    switches: tuple[Input, ...] = _parameter(
        tuple,
        (Input.HOME_SWITCH, Input.POSITIVE_LIMIT_SWITCH, Input.NEGATIVE_LIMIT_SWITCH),
        'the inputs that are wired')
    switch_debounce: float = _duration(0.0, 'how long a level must last to be believed')
    switch_timeout: float = _duration(
        0.0, 'largest age of a periodically published switch (0: published on change only)')
    switch_latency: float = _duration(
        0.0, "the switch driver's own delay before publishing, taken off the edge's time")
    feedback_timeout: float = _positive(0.2, 's', 'largest age of the feedback')

    following_error: float = _distance(
        0.0, 'largest |command - feedback| (0: homing_velocity_fast x 0.5 s)')
    wrong_direction_distance: float = _distance(
        0.0, 'commanded distance after which the feedback must not go the other way '
             '(0: 1 % of travel)')
    edge_tolerance: float = _distance(
        0.0, 'how far the second pass may be from the first '
             '(0: homing_velocity_fast x 0.005 s)')

    clear_home_done_on_servo_off: bool = _flag(True, 'servo off: the axis is no longer homed')
    clear_home_done_on_comm_stop: bool = _flag(
        True, 'feedback lost: the axis is no longer homed')

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
    def edge_agreement(self) -> float:
        return self.edge_tolerance or 0.005 * self.homing_velocity_fast

    @property
    def run_timeout(self) -> float:
        """The bound of a whole run, s: every motion of the table twice (the reversal), + 50 %."""
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
        return 1.5 * (2 * needed + self.mechanical_end_detection_time + 0.5)

    def ls_types(self, tier: Tier) -> tuple[LSType, LSType]:
        """Return the actions of the positive and the negative input of a pair."""
        prefix = '' if tier is Tier.HARDWARE else f'{tier}_'
        both: LSType = getattr(self, f'{prefix}ls_type')
        if both is not LSType.SeparatePositiveLSNegativeLS:
            return both, both
        return (getattr(self, f'{prefix}positive_ls_type'),
                getattr(self, f'{prefix}negative_ls_type'))

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
            faults.append(f'homing_velocity_slow: {slow:g} m/s must be <= homing_velocity_fast, '
                          f'{fast:g} m/s')
        if self.homing_reverse_distance >= self.travel:
            faults.append(f'homing_reverse_distance: {self.homing_reverse_distance:g} m must be '
                          f'< travel, {self.travel:g} m')
        if self.max_search_distance > 2 * self.travel:
            faults.append(f'max_search_distance: {self.max_search_distance:g} m must be '
                          f'<= 2 x travel, {2 * self.travel:g} m')
        for name in ('max_ls_reverse_distance', 'max_hs_on_at_start_reverse_distance'):
            if getattr(self, name) > self.search_distance:
                faults.append(f'{name}: {getattr(self, name):g} m must be <= max_search_distance, '
                              f'{self.search_distance:g} m')
        if abs(self.home_shift_distance) > self.travel:
            faults.append(f'home_shift_distance: {self.home_shift_distance:g} m must be within '
                          f'+-travel, {self.travel:g} m')
        procedure = self.procedure
        homes_on_limit = Role.REFERENCE in procedure.limits_ahead.values()
        if homes_on_limit and self.home_shift_distance > 0:
            faults.append(f'home_shift_distance: {self.home_shift_distance:g} m must be <= 0 m '
                          f'for {self.home_type} (it would move on into the limit switch)')
        for needed in sorted(procedure.inputs):
            if needed not in self.switches:
                faults.append(f'switches: {needed} is missing; {self.home_type} needs it')
        if procedure.target:
            faults += self._check_target(procedure.target)
        if self.homes_on_mechanical_end and not self.mechanical_end_detection_pos_diff:
            faults.append('mechanical_end_detection_pos_diff: 0 m must be > 0 m to detect the '
                          'mechanical end')
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
            return [f'switches: {target} is missing; {self.home_type} with home_direction '
                    f'{self.home_direction} needs it']
        if target not in self.inputs:
            return [f'{tier}_ls_type: {target} is disabled (None); {self.home_type} needs it']
        return []


SPECS: Mapping[str, Spec] = {
    f.name: dataclasses.replace(
        f.metadata['spec'], name=f.name,
        default=REQUIRED if f.default is dataclasses.MISSING else f.default)
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
        if name not in SPECS:
            faults.append(f'{name}: no such parameter' + _suggestion(name, SPECS))
            continue
        try:
            good[name] = SPECS[name].convert(value)
        except ValueError as error:
            faults.append(str(error))
    for name, spec in SPECS.items():
        if spec.required and name not in values:
            unit = f', {spec.unit}' if spec.unit else ''
            faults.append(f'{name}: required, but not set ({spec.text}{unit})')
    for tier in ('', 'near_', 'external_'):
        if good.get(f'{tier}ls_type') is LSType.SeparatePositiveLSNegativeLS:
            needed = (f'{tier}positive_ls_type', f'{tier}negative_ls_type')
            faults += [f'{name}: required, but not set ({tier}ls_type is '
                       'SeparatePositiveLSNegativeLS)' for name in needed if name not in values]
    if not faults:
        parameters = AxisParameters(**good)
        faults = parameters.cross_check()
        if not faults:
            return parameters
    raise InvalidParameters(prefix + fault for fault in faults)


def switch_inputs(inputs: Iterable[Input]) -> tuple[Input, ...]:
    """Return those inputs that carry a level (not a latched position, not the servo)."""
    return tuple(i for i in inputs if i not in LATCHES and i is not Input.SERVO_ENABLED)
