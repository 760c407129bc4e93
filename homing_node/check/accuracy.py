# SPDX-License-Identifier: Apache-2.0
"""Checks how exactly home is found: the rates of feedback and switches, and the second pass."""

from collections.abc import Iterator

from ..parameters.units import Unit
from ..plant.layout import AxisLayout
from ..procedures.events import Event
from ..procedures.motions import Pace
from ..procedures.states import HomeType, Input
from ..procedures.steps import HOME_SHIFT
from .axis_check import AxisCheck
from .finding import Finding, Severity, down, up
from .stopping import stopping_distance

#: The edges of switches.
EDGES = frozenset({Event.HS_RISES, Event.HS_FALLS, Event.LS_RISES, Event.LS_FALLS})
#: A home that a polled switch leaves open by more than this is worth a warning: of a linear axis,
#: m; of a rotary axis, as part of its travel.
FINE, FINE_PART = 1e-4, 1e-3


class Accuracy(AxisCheck):
    """Feedback or switches that are too slow, and passes that gain nothing."""

    def check(self, layout: AxisLayout | None = None) -> Iterator[Finding]:
        """Yield the findings; a layout tells how the switches are published, and hysteresis."""
        home = layout.switches.get(Input.HOME_SWITCH) if layout else None
        yield from self.feedback()
        yield from self.edges(layout.switch_rate if layout else None)
        yield from self.second_pass(home.hysteresis if home else 0.0)

    def feedback(self) -> Iterator[Finding]:
        """Check the feedback rate against the timeout."""
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

    def edges(self, switch_rate: float | None) -> Iterator[Finding]:
        """Tell how exactly each edge is known that becomes the home, and whether that is enough.

        Args:
            switch_rate: how often the switches are read and published, Hz; 0: on change, None: not
                known.
        """
        for row in self.rows:
            for event, target in row.on.items():
                if target == HOME_SHIFT and event in EDGES:
                    yield from self._edge(row.motion.pace, switch_rate)
                    break

    def _edge(self, pace: Pace, switch_rate: float | None) -> Iterator[Finding]:
        """Tell how exactly an edge is known that is met at a pace."""
        p, wanted = self.p, self.timing.accuracy
        velocity = p.pace(pace)[0]
        gap = 0.5 / switch_rate if switch_rate else 0.0
        doubt = gap + p.switch_stamp_error
        known = velocity * doubt
        if wanted is None:
            enough = not switch_rate or known <= self._fine
            needed = self._fine
        else:
            enough, needed = known <= wanted, wanted
        if enough and switch_rate is None:
            return
        because = f'stamps are good to {p.switch_stamp_error:g} s (switch_stamp_error)'
        if switch_rate:
            because = f'the switch is read {switch_rate:g} times a second (switch_rate), {because}'
        yield self.found(
            Severity.info if enough else Severity.warning,
            'accuracy',
            f'the edge that becomes the home is taken at {velocity:g} m/s and known to within '
            f'{known:.2g} m' + ('' if enough else f', not {needed:g} m'),
            because + ('' if enough else ': go slower, or better one of them'),
            str(pace),
            known,
            None if enough else down(needed / doubt),
            'm/s',
        )

    @property
    def _fine(self) -> float:
        """How exactly home must be known where the user does not say it, m."""
        return FINE_PART * self.p.travel if self.p.unit is Unit.rad else FINE

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
