# SPDX-License-Identifier: Apache-2.0
"""Checks how exactly home is found: the rate of the feedback, and the second pass."""

from collections.abc import Iterator

from ..procedures.events import Event
from ..procedures.motions import Pace
from ..procedures.states import HomeType
from ..procedures.steps import HOME_SHIFT
from .axis_check import AxisCheck
from .finding import Finding, Severity, down, up
from .stopping import stopping_distance


class Accuracy(AxisCheck):
    """Feedback that is too slow, and passes that gain nothing."""

    def check(self, hysteresis: float = 0.0) -> Iterator[Finding]:
        """Yield the findings; the hysteresis of the home switch in m lengthens the run-up."""
        yield from self.feedback()
        yield from self.second_pass(hysteresis)

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

    def second_pass(self, hysteresis: float) -> Iterator[Finding]:
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
        # The switch falls by its hysteresis before the place where it rises.
        overrun = stopping_distance(fast, fast_dec, p.max_jerk)
        room = hysteresis + max(p.homing_reverse_distance, overrun)
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
                up(needed - hysteresis),
                'm',
            )
