# SPDX-License-Identifier: Apache-2.0
"""Checks what the parameters of an axis tell, wherever its switches are."""

from collections.abc import Iterator
from functools import partial
from math import sqrt

from ..parameters.axis import DEFINITIONS
from ..parameters.units import Unit
from ..procedures.events import Event
from ..procedures.motions import Pace
from ..procedures.states import Role
from .axis_check import AxisCheck
from .finding import Finding, Severity, down, up
from .stopping import fastest, stopping_distance, turning_distance

#: From here on a linear axis is unusually long or fast: a value in mm; m, m/s.
LONG_AXIS, FAST_AXIS = 20.0, 5.0
#: Of the time that a stop takes at the given deceleration; from here on the jerk decides.
SLOWED = 1.5


class ParametersOnly(AxisCheck):
    """What the parameters of an axis tell, wherever its switches are."""

    def check(self, with_layout: bool = False) -> Iterator[Finding]:
        """Yield the findings; a layout, if there is one, judges some of them better."""
        yield from self.slow_velocity()
        yield from self.stops()
        yield from self.bounds()
        yield from self.z_pulses()
        yield from self.mechanical_end()
        if not with_layout:
            yield from self.length()
            yield from self.far_end()

    def slow_velocity(self) -> Iterator[Finding]:
        """Find a slow velocity that no motion of the home type uses."""
        p, name = self.p, 'homing_velocity_slow'
        default = DEFINITIONS[name].default
        if p.homing_velocity_slow != default and all(
            row.motion.pace is not Pace.SLOW for row in self.rows
        ):
            yield self.found(
                Severity.info,
                'parameter-unused',
                f'{name} is set, but {p.home_type} has no slow pass: it takes its reference at '
                'homing_velocity_fast',
                'it does nothing',
                name,
                p.homing_velocity_slow,
                default,
                'm/s',
            )

    def length(self) -> Iterator[Finding]:
        """Find a travel that is given in mm."""
        travel = self.p.travel
        if self.p.unit is Unit.m and travel > LONG_AXIS:
            yield self.found(
                Severity.warning,
                'travel',
                f'travel is {travel:g} m, longer than an axis usually is',
                'parameters are in m: is it given in mm?',
                'travel',
                travel,
                travel / 1000.0,
                'm',
            )

    def far_end(self) -> Iterator[Finding]:
        """Find bounds that a search over the whole travel does not keep."""
        p = self.p
        if p.max_search_distance and p.max_search_distance < p.travel and self.searches:
            yield self.found(
                Severity.warning,
                'search-bound',
                f'max_search_distance is {p.max_search_distance:g} m, less than travel, '
                f'{p.travel:g} m',
                'a run from the far end may not find its switch',
                'max_search_distance',
                p.max_search_distance,
                up(1.1 * p.travel),
                'm',
            )
        if p.timeout and self.searches:
            pace = self.searches[0][1].motion.pace
            least = p.travel / p.pace(pace)[0] + abs(p.home_shift_distance) / p.pace(Pace.SHIFT)[0]
            if p.timeout < least:
                yield self.found(
                    Severity.warning,
                    'timeout',
                    f'timeout is {p.timeout:g} s, but a search over the travel and the final '
                    f'move take {least:.4g} s',
                    'a run from the far end ends with Timeout (0: computed)',
                    'timeout',
                    p.timeout,
                    0.0,
                    's',
                )

    # ------------------------------------------------------------------------------------- motion

    def stops(self) -> Iterator[Finding]:
        """Find stops that are longer than the axis, or than they need be."""
        p = self.p
        for pace in dict.fromkeys(row.motion.pace for _, row in self.searches):
            velocity, _, deceleration = p.pace(pace)
            distance = stopping_distance(velocity, deceleration, p.max_jerk)
            if distance >= p.travel:
                right = fastest(
                    partial(stopping_distance, deceleration=deceleration, jerk=p.max_jerk),
                    p.travel,
                    velocity,
                )
                yield self.found(
                    Severity.error,
                    'stop-longer-than-travel',
                    f'a stop from {velocity:g} m/s takes {distance:.4g} m, all of the travel of '
                    f'{p.travel:g} m',
                    'whatever stops the axis, it hits an end'
                    + (
                        '; parameters are in m/s: is it given in mm/s?'
                        if p.unit is Unit.m and velocity > FAST_AXIS
                        else ''
                    ),
                    str(pace),
                    distance,
                    down(right),
                    'm/s',
                )
        if not self.searches:
            return
        velocity = max(p.pace(row.motion.pace)[0] for _, row in self.searches)
        yield from self._jerk(velocity)
        if p.ls_dec < p.homing_velocity_fast_dec:
            yield self.found(
                Severity.warning,
                'soft-ls-dec',
                f'ls_dec is {p.ls_dec:g} m/s^2, less than homing_velocity_fast_dec, '
                f'{p.homing_velocity_fast_dec:g} m/s^2',
                'an emergency stop or a limit would stop the axis more slowly than an ordinary '
                'turn',
                'ls_dec',
                p.ls_dec,
                p.homing_velocity_fast_dec,
                'm/s^2',
            )
        if p.ls_slow_dec > p.ls_dec:
            yield self.found(
                Severity.warning,
                'hard-ls-slow-dec',
                f'ls_slow_dec is {p.ls_slow_dec:g} m/s^2, more than ls_dec, {p.ls_dec:g} m/s^2',
                'SlowDec would be the harder stop',
                'ls_slow_dec',
                p.ls_slow_dec,
                p.ls_dec,
                'm/s^2',
            )

    def _jerk(self, velocity: float) -> Iterator[Finding]:
        """Find a jerk that decides how long a stop takes, for the hardest stop that it softens."""
        p = self.p
        softened = {}
        for name in ('homing_velocity_fast_dec', 'ls_dec'):
            deceleration: float = getattr(p, name)
            distance = stopping_distance(velocity, deceleration, p.max_jerk)
            ideal = velocity / deceleration * velocity / 2
            if sqrt(velocity * p.max_jerk) < deceleration and distance > SLOWED * ideal:
                softened[name] = deceleration
        if softened:
            name = max(softened, key=lambda each: softened[each])
            distance = stopping_distance(velocity, softened[name], p.max_jerk)
            yield self.found(
                Severity.info,
                'jerk-decides',
                f'a stop from {velocity:g} m/s never reaches {name} of {softened[name]:g} m/s^2 '
                f'and takes {distance:.4g} m',
                'max_jerk lets the deceleration grow too slowly',
                'max_jerk',
                p.max_jerk,
                up(softened[name] ** 2 / velocity),
                'm/s^3',
            )

    def bounds(self) -> Iterator[Finding]:
        """Find bounds that no run can keep."""
        p = self.p
        reverses = Role.REVERSAL in p.limits_ahead.values()
        velocity, acceleration, deceleration = p.pace(Pace.FAST)
        overrun = (
            0.0
            if p.immediate_stop_at_ls
            else turning_distance(velocity, velocity, acceleration, deceleration, p.max_jerk)
        )
        if reverses and 0.0 < p.max_ls_reverse_distance <= overrun:
            yield self.found(
                Severity.warning,
                'ls-reverse-bound',
                f'max_ls_reverse_distance is {p.max_ls_reverse_distance:g} m, but the axis '
                f'overruns a limit switch by {overrun:.4g} m before it turns',
                'the distance counts from where it turns: the reversal always ends with '
                'MaxLSRevDistanceTraveled',
                'max_ls_reverse_distance',
                p.max_ls_reverse_distance,
                up(p.travel),
                'm',
            )

    def z_pulses(self) -> Iterator[Finding]:
        """Find settings of the Z-pulse that contradict each other, or do nothing."""
        p = self.p
        count = max(1, p.multiple_z_pulse)
        if Event.Z_PULSE not in p.procedure.events:
            for name in (
                'multiple_z_pulse',
                'z_pulse_distance_check',
                'max_z_pulse_distance',
                'z_pulse_arm_delay',
            ):
                if getattr(p, name):
                    yield self.found(
                        Severity.info,
                        'parameter-unused',
                        f'{name} is set, but {p.home_type} uses no Z-pulse',
                        'it does nothing',
                        name,
                        getattr(p, name),
                        0.0,
                    )
            return
        expected, bound = p.z_pulse_distance_check, p.max_z_pulse_distance
        if expected and count == 1:
            yield self.found(
                Severity.info,
                'parameter-unused',
                f'z_pulse_distance_check is {expected:g} m, but only one Z-pulse is taken',
                'there is no distance to check',
                'multiple_z_pulse',
                float(count),
                2.0,
            )
        if expected and count > 1 and bound and bound < expected:
            yield self.found(
                Severity.error,
                'z-pulse-bound',
                f'max_z_pulse_distance is {bound:g} m, less than z_pulse_distance_check, '
                f'{expected:g} m',
                'the next Z-pulse is always beyond the bound',
                'max_z_pulse_distance',
                bound,
                up(1.2 * expected),
                'm',
            )
        if (count - 1) * expected > p.search_distance:
            yield self.found(
                Severity.error,
                'z-pulse-count',
                f'{count} Z-pulses at {expected:g} m take {(count - 1) * expected:.4g} m, more '
                f'than max_search_distance, {p.search_distance:g} m',
                'the search ends before the last one',
                'multiple_z_pulse',
                float(count),
                float(1 + int(p.search_distance / expected)),
            )

    def mechanical_end(self) -> Iterator[Finding]:
        """Find what goes wrong at the mechanical end."""
        p = self.p
        if not p.homes_on_mechanical_end:
            return
        velocity, acceleration, deceleration = p.pace(Pace.SLOW)
        wait = p.mechanical_end_detection_time
        after = velocity * (wait + self.timing.feedback_age + 1.0 / self.timing.update_rate)
        behind = (
            p.mechanical_end_detection_pos_diff
            + after
            + stopping_distance(velocity, min(acceleration, deceleration), p.max_jerk)
        )
        allowed = max(p.following_error_limit, 2 * p.mechanical_end_detection_pos_diff)
        if behind > allowed:
            yield self.found(
                Severity.error,
                'end-following-error',
                f'the command goes {behind:.4g} m past the mechanical end, more than '
                f'{allowed:.4g} m (following_error)',
                f'it goes on for mechanical_end_detection_time ({wait:g} s) and until it has '
                'turned; the run ends with FollowingError',
                'following_error',
                behind,
                up(1.2 * behind),
                'm',
            )
        if not p.mechanical_end_detection_first_torque_limit:
            yield self.found(
                Severity.warning,
                'end-torque',
                'mechanical_end_detection_first_torque_limit is 0: none',
                'the axis pushes against its end with all that the drive has',
                'mechanical_end_detection_first_torque_limit',
                0.0,
                30.0,
                '%',
            )
