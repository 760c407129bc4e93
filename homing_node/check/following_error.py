# SPDX-License-Identifier: Apache-2.0
"""Checks how far the axis stays behind its command, and how long its drive waits for one."""

from collections.abc import Iterator

from ..procedures.states import LATCHES
from .axis_with_layout import AxisWithLayout
from .finding import Finding, Severity, up

#: A drive that hears nothing for this many cycles must not stop.
QUIET_CYCLES = 3


class FollowingError(AxisWithLayout):
    """A lag that the supervision takes for a fault, and a drive that stops by itself."""

    def check(self) -> Iterator[Finding]:
        yield from self.following()
        yield from self.drive()

    def following(self) -> Iterator[Finding]:
        """Check how far the axis stays behind against what is allowed."""
        p, lag = self.p, self.layout.lag
        if not lag or not self.searches:
            return
        age = self.timing.feedback_age
        velocity = max(p.pace(row.motion.pace)[0] for row in p.procedure.rows.values())
        behind, limit = velocity * lag, p.following_error_limit
        if limit < behind + velocity * age and not p.homes_on_mechanical_end:
            # The feedback is compared with the nearest command since its time (core/travel.py).
            always = limit < behind - velocity / self.timing.update_rate
            yield self.found(
                Severity.error if always else Severity.warning,
                'following-error',
                f'at {velocity:g} m/s the axis stays {behind:.3g} m behind and its feedback may '
                f'be {velocity * age:.3g} m old, but following_error is {limit:.3g} m',
                f'{"every" if always else "a"} run ends with FollowingError',
                'following_error',
                behind,
                up(2 * (behind + velocity * age)),
            )
        if p.wrong_direction_limit < behind:
            yield self.found(
                Severity.warning,
                'wrong-direction',
                f'wrong_direction_distance is {p.wrong_direction_limit:.3g} m, less than the '
                f'{behind:.3g} m that the axis stays behind',
                'its way is judged before it follows',
                'wrong_direction_distance',
                p.wrong_direction_limit,
                up(2 * behind),
            )
        if p.open_loop_homing and p.procedure.inputs - set(LATCHES):
            yield self.found(
                Severity.warning,
                'open-loop',
                'open_loop_homing takes the commanded position at an edge, but the axis is up to '
                f'{behind:.3g} m behind it',
                'home is off by that, and depends on the velocity',
                'open_loop_homing',
                behind,
                False,
            )
        if p.homes_on_mechanical_end:
            yield from self._end_too_early(lag, age)

    def _end_too_early(self, lag: float, age: float) -> Iterator[Finding]:
        slow, limit = self.p.homing_velocity_slow, self.p.mechanical_end_detection_pos_diff
        normal = slow * (lag + age)
        if limit < 2 * normal:
            always = limit <= slow * lag
            yield self.found(
                Severity.error if always else Severity.warning,
                'end-too-early',
                f'at {slow:g} m/s the axis stays {normal:.3g} m behind, but '
                f'mechanical_end_detection_pos_diff is {limit:.3g} m',
                f'the end {"is" if always else "may be"} detected anywhere on the way',
                'mechanical_end_detection_pos_diff',
                limit,
                up(4 * normal),
            )

    def drive(self) -> Iterator[Finding]:
        """Check that the drive waits for the next setpoint for long enough."""
        quiet, period = self.layout.command_timeout, 1.0 / self.timing.update_rate
        if quiet and quiet < QUIET_CYCLES * period:
            yield self.found(
                Severity.warning,
                'drive-timeout',
                f'the drive stops after {quiet:g} s without a setpoint, they come every '
                f'{period:g} s',
                'a late setpoint stops the axis',
                'command_timeout',
                quiet,
                up(QUIET_CYCLES * period),
                's',
            )
