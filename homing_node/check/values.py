# SPDX-License-Identifier: Apache-2.0
"""What the parameters of an axis alone tell, wherever its switches are."""

from collections.abc import Iterable, Iterator
from functools import partial
from math import sqrt

from ..core.limits import Limit, limits_of
from ..parameters.axis import AxisParameters
from ..plant.timing import Timing
from ..procedures.events import Event
from ..procedures.motions import Kind, Pace, Way
from ..procedures.states import (
    LATCHES,
    LIMIT_PAIRS,
    LIMIT_SWITCHES,
    HomeType,
    Input,
    LimitPair,
    LSType,
    Role,
)
from ..procedures.steps import HOME_SHIFT
from .finding import Finding, Severity, down, up
from .stopping import fastest, stopping_distance, turning_distance

#: Of the time that a stop takes at the given deceleration; from here on the jerk decides.
SLOWED = 1.5


def check_values(
    axis: str, parameters: AxisParameters, timing: Timing, placed: bool = False
) -> Iterator[Finding]:
    """Yield the findings; ``placed``: a layout is checked besides, which tells some better."""
    check = _Values(axis, parameters, timing)
    yield from check.wiring()
    yield from check.stops()
    yield from check.bounds()
    yield from check.z_pulses()
    yield from check.mechanical_end()
    yield from check.feedback()
    yield from check.second_pass()
    if not placed:
        yield from check.unplaced()
        yield from check.far_end()


class _Values:
    def __init__(self, axis: str, parameters: AxisParameters, timing: Timing) -> None:
        self.axis, self.p, self.timing = axis, parameters, timing
        self.rows = list(parameters.procedure.rows.values())
        self.searches = [row for row in self.rows if row.motion.kind is Kind.SEARCH]

    def found(
        self,
        severity: Severity,
        check: str,
        what: str,
        why: str,
        parameter: str = '',
        value: float | str | None = None,
        right: float | str | bool | None = None,
        unit: str = '',
    ) -> Finding:
        return Finding(severity, self.axis, check, what, why, parameter, value, right, unit)

    # ------------------------------------------------------------------------------------- inputs

    def wiring(self) -> Iterator[Finding]:
        """Find inputs that are wired but not used, and actions without an input."""
        p = self.p
        used = set(p.procedure.inputs) | set(LIMIT_SWITCHES) | {Input.SERVO_ENABLED}
        for name in p.switches:
            if name not in used:
                why = (
                    'its latches are ignored'
                    if name in LATCHES
                    else 'yet no run starts before a message of it has come'
                )
                yield self.found(
                    Severity.info,
                    'wired-unused',
                    f'{name} is in switches, but {p.home_type} does not use it',
                    why,
                    'switches',
                    str(name),
                    f'without {name}',
                )
        for pair in (LimitPair.NEAR, LimitPair.EXTERNAL):
            for switch, ls_type in zip(LIMIT_PAIRS[pair], p.ls_types(pair), strict=True):
                if ls_type is LSType.none and switch in p.switches:
                    yield self.found(
                        Severity.warning,
                        'limit-disabled',
                        f'{switch} is in switches, but its LS Type is None',
                        'it is ignored',
                        f'{pair}_ls_type',
                        'None',
                        'Dec',
                    )
            if any(one is not LSType.none for one in p.ls_types(pair)) and not any(
                switch in p.switches for switch in LIMIT_PAIRS[pair]
            ):
                yield self.found(
                    Severity.warning,
                    'limit-not-wired',
                    f'{pair}_ls_type is {getattr(p, f"{pair}_ls_type")}, but neither of the '
                    f'{pair} limit switches is in switches',
                    'they cannot act',
                    'switches',
                    None,
                    f'with {" and ".join(LIMIT_PAIRS[pair])}',
                )

    def unplaced(self) -> Iterator[Finding]:
        """Find ends at which no limit switch acts; how bad that is only a layout tells."""
        limits = limits_of(self.p).values()
        for way in sorted({row.motion.way for row in self.searches}, reverse=True):
            here = [limit for limit in limits if limit.way is way]
            side = 'ahead' if way is Way.TOWARD else 'behind'
            if self.p.homes_on_mechanical_end and way is Way.TOWARD:
                yield from self._before_the_end(here)
                continue
            if not here:
                yield self.found(
                    Severity.info,
                    'end-unguarded',
                    f'no limit switch {side} is wired',
                    f'only {self.p.search_distance:g} m (max_search_distance) ends a search that '
                    'misses its switch',
                    'switches',
                    None,
                    f'with {self.p.limit_switch(LimitPair.HARDWARE, way)}',
                )
            elif not any(
                limit.action or limit.role in (Role.REVERSAL, Role.REFERENCE) for limit in here
            ):
                names = ', '.join(limit.input for limit in here)
                yield self.found(
                    Severity.warning,
                    'limit-without-action',
                    f'no limit switch {side} stops the axis ({names})',
                    'their LS Type is None, or this home type ignores them',
                    'ls_type',
                    'None',
                    'Dec',
                )

    def _before_the_end(self, ahead: Iterable[Limit]) -> Iterator[Finding]:
        for limit in ahead:
            if limit.role is Role.NORMAL and limit.action:
                yield self.found(
                    Severity.warning,
                    'end-behind-limit',
                    f'{limit.input} acts on the way to the mechanical end',
                    'if it is met before the end, every run ends with LSTriggered',
                    'mechanical_end_detection_ignore_ls',
                    'false',
                    True,
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
            pace = self.searches[0].motion.pace
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
        for pace in dict.fromkeys(row.motion.pace for row in self.searches):
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
                    'whatever stops the axis, it hits an end',
                    str(pace),
                    distance,
                    down(right),
                    'm/s',
                )
        if not self.searches:
            return
        velocity = max(p.pace(row.motion.pace)[0] for row in self.searches)
        for name in ('homing_velocity_fast_dec', 'ls_dec'):
            deceleration = getattr(p, name)
            ideal = velocity / deceleration
            if sqrt(velocity * p.max_jerk) < deceleration:
                distance = stopping_distance(velocity, deceleration, p.max_jerk)
                if distance > SLOWED * ideal * velocity / 2:
                    yield self.found(
                        Severity.info,
                        'jerk-decides',
                        f'a stop from {velocity:g} m/s never reaches {name} of '
                        f'{deceleration:g} m/s^2 and takes {distance:.4g} m',
                        'max_jerk lets the deceleration grow too slowly',
                        'max_jerk',
                        distance,
                        up(deceleration**2 / velocity),
                        'm/s^3',
                    )
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

    def bounds(self) -> Iterator[Finding]:
        """Find bounds that no run can keep."""
        p = self.p
        reverses = Role.REVERSAL in p.procedure.limits_ahead.values()
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

    # ------------------------------------------------------------------------------------ accuracy

    def feedback(self) -> Iterator[Finding]:
        """Check the feedback rate against the timeouts, the speeds, the accuracy."""
        p, rate = self.p, self.timing.feedback_rate
        if rate is None:
            return
        if p.feedback_timeout <= 2.0 / rate:
            severity = Severity.error if p.feedback_timeout <= 1.0 / rate else Severity.warning
            yield self.found(
                severity,
                'feedback-timeout',
                f'feedback_timeout is {p.feedback_timeout:g} s, the feedback comes every '
                f'{1.0 / rate:g} s',
                'one late message ends the run with FeedbackStale',
                'feedback_timeout',
                p.feedback_timeout,
                up(5.0 / rate),
                's',
            )
        accuracy = self.timing.accuracy
        for row in self.rows:
            for event, target in row.on.items():
                if target != HOME_SHIFT or event in (Event.Z_PULSE, Event.TOUCH_PROBE):
                    continue
                velocity = p.pace(row.motion.pace)[0]
                doubt = min(1.0 / rate, p.switch_stamp_error)
                if accuracy and velocity * doubt > accuracy:
                    yield self.found(
                        Severity.warning,
                        'accuracy',
                        f'the edge is taken at {velocity:g} m/s and known to within '
                        f'{velocity * doubt:.3g} m, not {accuracy:g} m',
                        f'the feedback comes every {1.0 / rate:g} s, stamps of switches are good '
                        f'to {p.switch_stamp_error:g} s (switch_stamp_error): go slower, or '
                        'better one of them',
                        str(row.motion.pace),
                        velocity * doubt,
                        down(accuracy / doubt),
                        'm/s',
                    )
        doubt = p.homing_velocity_fast * min(1.0 / rate, p.switch_stamp_error)
        if p.home_type is HomeType.HSHS and doubt > p.edge_agreement:
            yield self.found(
                Severity.warning,
                'edge-tolerance',
                f'the first pass knows its edge to within {doubt:.3g} m, edge_tolerance is '
                f'{p.edge_agreement:.3g} m',
                'the passes may disagree without a fault (EdgeNotRepeated)',
                'edge_tolerance',
                p.edge_agreement,
                up(doubt),
                'm',
            )

    def second_pass(self) -> Iterator[Finding]:
        """Find a second pass that is not slower, or has no room to become so."""
        p = self.p
        if p.home_type not in (HomeType.HSHS, HomeType.HSTouchProbe):
            return
        if p.homing_velocity_slow == p.homing_velocity_fast:
            yield self.found(
                Severity.info,
                'second-pass-fast',
                'homing_velocity_slow is homing_velocity_fast',
                'the second pass gains nothing',
                'homing_velocity_slow',
                p.homing_velocity_slow,
                down(0.1 * p.homing_velocity_fast),
                'm/s',
            )
        fast, _, fast_dec = p.pace(Pace.FAST)
        slow, slow_acc, _ = p.pace(Pace.SLOW)
        room = max(p.homing_reverse_distance, stopping_distance(fast, fast_dec, p.max_jerk))
        needed = stopping_distance(slow, slow_acc, p.max_jerk) + slow * p.switch_debounce
        if room < needed:
            yield self.found(
                Severity.warning,
                'run-up',
                f'the second pass begins {room:.3g} m before the switch, but takes {needed:.3g} m '
                'to reach homing_velocity_slow',
                'its edge is taken while the axis still accelerates',
                'homing_reverse_distance',
                p.homing_reverse_distance,
                up(needed),
                'm',
            )
