# SPDX-License-Identifier: Apache-2.0
"""The hand-over: after a run, the rest of the machine gets the home. One axis; no ROS, no clock.

Theory of operation. The axis rests. The controllers that hold its joint are deactivated, because
a position controller that is active while the driver's coordinates change makes the axis jump.
Then the home is applied (a service of the driver, or the relay), and it counts only once the
feedback shows it. Then the controllers are activated, and the axis is homed.

``TABLE`` in handover_steps.py says for each step what is asked of others, which step each event
leads to, and so what is undone.

Every step is bounded by ``timeout``. What others answer too late is ignored: an answer carries the
number of what was asked. Positions are raw, in m or rad; times in s.
"""

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from ..procedures.states import Error
from .handover_steps import ENDS, SWITCHES, TABLE, UNDO, Asks, Event, Step
from .outcome import Outcome

#: So many samples in a row must show the home.
SAMPLES = 3


class Plan(NamedTuple):
    """What a hand-over needs to know.

    Attributes:
        axis: the name of the axis.
        found: how the run has ended: the home in the coordinates of the feedback.
        controllers: those that are switched.
        timeout: the bound of each step, s.
        tolerance: how far the feedback may be from the homed position, m or rad.
        hold: how far the axis may move when its controllers are activated, m or rad.
        shifts: whether the driver's own coordinates change (a service), or not (the relay).
        applied: what the driver takes off its own coordinates before this hand-over, m or rad.
        wrap: the turn modulo which positions are compared, 0 for none.
    """

    axis: str
    found: Outcome
    controllers: tuple[str, ...]
    timeout: float
    tolerance: float
    hold: float
    shifts: bool
    applied: float = 0.0
    wrap: float = 0.0


class Question(NamedTuple):
    """What is asked of others: its number, its kind, and the positions for a call."""

    number: int
    asks: Asks
    values: Mapping[str, float]


class Handover:
    """The hand-over of one axis.

    Attributes:
        plan: what it needs to know.
        step: where it stands.
        question: what is asked now; None while nothing is.
        outcome: how it has ended; None while it goes on.
        applied: what the driver takes off its own coordinates, as far as it is known, m or rad.
    """

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.step = Step.Rest
        self.question: Question | None = None
        self.outcome: Outcome | None = None
        self.applied = plan.applied
        self._number = 0
        self._until: float | None = None  # the bound of the step, s
        self._failed = Outcome(Error.NoError)
        self._off = False  # the controllers were switched off, and not on again
        self._before = self._target = math.nan  # the feedback before the call, and wanted after it
        self._rest = math.nan  # where the axis was when its controllers were to be activated
        self._newest = math.nan  # the newest feedback
        self._sampled = -math.inf  # when the sample was taken that was judged last
        self._good = 0  # samples in a row that show the home
        self._off_by = 0.0  # the distance of the last of them from the target

    @property
    def exclusive(self) -> bool:
        """Whether it must be alone: it changes coordinates, or switches controllers."""
        return self.plan.shifts or bool(self.plan.controllers)

    def update(self, now: float, raw: float, sampled: float, rests: bool, free: bool) -> None:
        """Follow the feedback and the time.

        Args:
            now: the present time, s.
            raw: the newest feedback, raw.
            sampled: when it was sampled, s.
            rests: whether the axis rests.
            free: whether every other axis lets this hand-over begin.
        """
        self._newest = raw
        if self._until is None or (self.step is Step.Rest and not free):
            self._until = now + self.plan.timeout
        if self.step in (Step.Rest, Step.Settle):
            if rests and (free or self.step is Step.Settle):
                self._take(Event.Rests)
        elif self.step is Step.See and self.plan.shifts:
            self.shown(raw, sampled)
        elif self.step is Step.Activate and abs(self._apart(raw, self._rest)) > self.plan.hold:
            self._take(Event.Changed, f'the axis moved from {self._rest:.6g} to {raw:.6g}')
        if self._until is not None and now > self._until:
            late = Event.Late
            if self.step in (Step.Apply, Step.See) and not self.plan.shifts:
                late = Event.No
            self._take(late, self._overdue())

    def answer(self, number: int, yes: bool, text: str = '') -> None:
        """Take an answer; one to a question that is over is ignored."""
        if self.question is None or self.question.number != number:
            return
        if yes:
            self._take(Event.Yes)
        elif self.step is Step.Apply and self._has_changed():
            self._take(Event.Doubt, f'{text}; but the feedback has changed to {self._newest:.6g}')
        else:
            self._take(Event.No, text or 'the answer was no')

    def shown(self, position: float, sampled: float) -> None:
        """Take a position that should be the homed one, and when it was sampled, s."""
        if self.step is not Step.See or sampled <= self._sampled:
            return
        self._sampled = sampled
        self._off_by = self._apart(position, self._target)
        self._good = self._good + 1 if abs(self._off_by) <= self.plan.tolerance else 0
        if self._good >= SAMPLES:
            self._take(Event.Seen)

    def cancel(self) -> None:
        """Give up, as long as nothing is changed yet; later it goes on to its end."""
        self._take(Event.Canceled, 'canceled', Error.Canceled)

    def stop(self, error: Error, text: str) -> None:
        """Give up for an error of the machine; no controller is activated any more."""
        self._take(Event.Stopped, text, error)

    # ------------------------------------------------------------------------------------- inside

    def _take(self, event: Event, text: str = '', error: Error = Error.HandoverFailed) -> None:
        """Take an event: go to the step that the table names."""
        if self.step in ENDS or event not in TABLE[self.step].after:
            return
        asks, step = TABLE[self.step].asks, TABLE[self.step].after[event]
        if event is Event.Yes and asks in SWITCHES:
            self._off = asks is Asks.Deactivate
        if text and self.step not in UNDO:
            what = '' if error is not Error.HandoverFailed else f'step {self.step}: '
            self._failed = Outcome(error, f'axis {self.plan.axis}: {what}{text}')
        if event is Event.Seen and self.plan.shifts:
            self.applied = self._total
        elif self.step in (Step.Apply, Step.See) and step not in (Step.See, Step.Activate):
            self._guess_applied()
        self._enter(step)

    def _enter(self, step: Step) -> None:
        self.step, self.question, self._until = step, None, None
        if step in ENDS:
            self.outcome = self._success() if step is Step.Done else self._failure()
            return
        asks = TABLE[step].asks
        if asks is None:
            return
        if asks in SWITCHES and not self.plan.controllers:
            self._take(Event.Yes)
            return
        if asks is Asks.Deactivate:
            self._off = True  # it may be, from now on
        self._number += 1
        values = self._values() if asks is Asks.Call else {}
        if step is Step.Activate:
            self._rest = self._newest
        self.question = Question(self._number, asks, values)

    def _values(self) -> Mapping[str, float]:
        """Return the positions for the call, and note what the feedback must show after it."""
        found, raw = self.plan.found, self._newest
        self._before, self._target = raw, raw - found.home_offset
        return {
            'position': self._target,
            'home_offset': self._total,
            'home_offset_change': found.home_offset,
            'raw_position': raw,
            'home_position_raw': found.home_position_raw,
            'uncertainty': found.uncertainty,
        }

    @property
    def _total(self) -> float:
        """What the driver must take off its own coordinates."""
        return self.plan.applied + self.plan.found.home_offset

    def _has_changed(self) -> bool:
        """Whether the feedback is not where it was before the call."""
        return abs(self._apart(self._newest, self._before)) > self.plan.tolerance

    def _guess_applied(self) -> None:
        """Note, after a call that failed, in which coordinates the feedback is."""
        if not self.plan.shifts or math.isnan(self._before):
            return
        to_old = abs(self._apart(self._newest, self._before))
        if abs(self._apart(self._newest, self._target)) < to_old:
            self.applied = self._total

    def _apart(self, one: float, other: float) -> float:
        wrap = self.plan.wrap
        return math.remainder(one - other, wrap) if wrap else one - other

    def _overdue(self) -> str:
        """Say what was waited for in vain."""
        waits = TABLE[self.step].waits
        text = f'waited {self.plan.timeout:g} s (apply_timeout) in vain until {waits}'
        if self.step is Step.See:
            text += (
                f'; wanted {self._target:.9g} +- {self.plan.tolerance:.3g} (apply_tolerance), '
                f'seen {self._target + self._off_by:.9g}'
                if self._sampled > -math.inf
                else '; no feedback came'
            )
        return text

    def _failure(self) -> Outcome:
        failed = self._failed
        if self._off and self.plan.controllers:
            names = ', '.join(self.plan.controllers)
            failed = failed._replace(
                message=f'{failed.message}; left inactive, or perhaps so: {names}'
            )
        return failed._replace(warnings=self.plan.found.warnings)

    def _success(self) -> Outcome:
        found = self.plan.found
        if not self.plan.shifts:
            return found
        return found._replace(
            home_position_raw=found.home_position_raw - found.home_offset,
            home_offset=0.0,
            uncertainty=found.uncertainty + abs(self._off_by),
            applied=self._total,
        )


def may_begin(one: Handover, others: Iterable[Handover], moving: bool) -> bool:
    """Return whether a hand-over may begin: one that must be alone waits for all others.

    Args:
        one: the hand-over.
        others: those of the other axes.
        moving: whether a run moves an axis.
    """
    if not one.exclusive:
        return True
    return not moving and not any(h.exclusive and h.step is not Step.Rest for h in others)
